"""Power cuts at each write of a mission, and the next start.

    python -m tests.campaigns.power_cut --cuts 2000

Takes hours.

A real daemon with its recorder is watched while its robot drives, is told to begin anew, and while
it is started again. From each call that changed a file, what a loss of power may leave is rebuilt:
what was synchronised is there, of the rest the bytes may be whole, those from before, none, zeros
or half, the names moved or not. On each of these a real daemon is started as a service starts it.
It has to become ready without help; to know all that was on the disk and nothing else, or say that
it does not; and what is left of recordings has to be readable, once a recorder has looked it
through. (Compiled kernels have digests: ``tests.kernels`` damages them.)

Exit code 1 where one of these does not hold; the folder of each such cut is kept, and the command
that starts a daemon on it again is printed.
"""

from __future__ import annotations

import argparse
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import yaml

from fasaco_edge.daemon.ledger.codec import decode_ledger
from fasaco_edge.daemon.ledger.file import LedgerFile
from fasaco_edge.errors import LedgerFileError, UnreadableRecording
from fasaco_edge.recording.read.torn import repair_folder
from tests.campaigns.file_calls import Call, Kind, Watch, why_not
from tests.campaigns.power_states import Cut, Disk, cuts_of
from tests.campaigns.roaming import roaming_robot
from tests.campaigns.services import START_S, service, show
from tests.daemon.test_commands import command
from tests.support.ledgers import CELL_M, contents
from tests.support.outsider import Outsider
from tests.support.processes import free_endpoint
from tests.support.recordings import begun_parts, read_summary

STATE, RECORDINGS = "state", "recordings"
# A recorder takes longer to start than all the rest: one is, after each so many cuts.
RECORDS_EACH = 8
NEW = "robot.ledger.new"
MISSION_S = 5.0


@dataclass(frozen=True)
class Written:
    """A ledger as it went to the disk, or that there is to be none any more.

    Attributes:
        begun, done: the number of the call with which it was begun, and after which it is there.
        holds: what it holds.
    """

    begun: int
    done: float
    holds: object


@dataclass(frozen=True)
class Trace:
    """What a run has done to files.

    Attributes:
        root: the folder they lie in.
        calls: in order.
    """

    root: Path
    calls: list[Call]


@dataclass(frozen=True)
class Outcome:
    """What became of a cut; ``wrong`` is "" where all was well."""

    cut: str
    wrong: str
    seconds: float
    is_torn: bool
    fault: str
    kept: str = ""


def watched_mission(folder: Path, seconds: float = MISSION_S) -> Trace:
    """Let a robot drive, begin anew, and go on after a restart; write down what is written."""
    root = folder / "robot"
    root.mkdir()
    with roaming_robot("basement") as (_, endpoint), Watch([root], is_logged=True) as watch:
        words = ["--state", str(root / STATE), "--record", str(root / RECORDINGS)]
        for order in ("reset", "pause"):
            with service(folder, _run(folder, endpoint, *words), watch.environment) as daemon:
                assert daemon.wait_ready(), daemon.said()
                with Outsider(endpoint) as outsider:
                    outsider.wait_status(lambda status: bool(status["coverage"]))
                    time.sleep(seconds)
                    assert "code" not in command(outsider, order), order
                    command(outsider, "start")
                    time.sleep(0.3 * seconds)
                assert daemon.stop() == 0, daemon.said()
        return Trace(root, watch.calls())


def _run(folder: Path, connect: str, *words: str) -> list[str]:
    """Return the words that start a daemon without a listener of its own."""
    config = folder / "config.yaml"
    bus = {"mode": "client", "listen": [], "connect": [connect]} if connect else {}
    sections = {
        "bus": bus or {"listen": [free_endpoint()]},
        "mission": {"lost_pose_s": 0.0},
        "planner": {"line": "cells"},  # what was driven is known by its cells
    }
    config.write_text(yaml.safe_dump(sections))
    return ["run", "--config", str(config), *words]


def ledgers_of(trace: Trace) -> list[Written]:
    """Return what was to be on the disk, in order; nothing comes first."""
    history = [Written(0, 0, contents(None))]
    begun, holds, waiting = 0, contents(None), False
    newest = b""
    for number, call in enumerate(trace.calls, 1):
        name = Path(call.path).name
        if call.kind is Kind.OPEN and name == NEW:
            begun, newest = number, b""
        elif call.kind is Kind.WRITE and name == NEW:
            newest += call.data
        elif call.kind is Kind.RENAME and name == NEW and call.second.endswith(".ledger"):
            holds, waiting = contents(decode_ledger(newest, CELL_M)), True
        elif call.kind is Kind.RENAME and ".ledger.reset" in call.second and not waiting:
            begun, holds, waiting = number, contents(None), True
        elif call.kind is Kind.SYNC and waiting and name == STATE:
            history.append(Written(begun, number, holds))
            waiting = False
    return history


def allowed_after(history: Sequence[Written], after: int) -> list[object]:
    """Return what may be found after so many calls: the last that is there, and what was begun."""
    last = max(number for number, written in enumerate(history) if written.done <= after)
    return [w.holds for w in history[last:] if w.begun <= after]


def outcomes_of(trace: Trace, cuts: Sequence[Cut], folder: Path, keep: Path) -> Iterator[Outcome]:
    """Cut, and judge what each cut leaves."""
    history, disk, done = ledgers_of(trace), Disk(trace.root), 0
    for cut in cuts:
        for call in trace.calls[done : cut.after]:
            disk.do(call)
        done = cut.after
        place = folder / "cut"
        place.mkdir()
        started = time.monotonic()
        disk.write(cut, place)
        wrong, is_torn, fault = judged(cut, history, place)
        kept = ""
        if wrong:
            kept = str(keep / f"{cut.salt}")
            shutil.copytree(place, kept, dirs_exist_ok=True)
        shutil.rmtree(place)
        seconds = time.monotonic() - started
        yield Outcome(str(cut), wrong, round(seconds, 3), is_torn, fault, kept)


def judged(cut: Cut, history: Sequence[Written], place: Path) -> tuple[str, bool, str]:
    """Start a daemon on what a cut left.

    Returns:
        what is wrong with that, whether a recording is torn, and what fault the ledger has.
    """
    found, fault, wrong = _found(place / STATE, allowed_after(history, cut.after))
    is_torn, unreadable = _recordings(place / RECORDINGS)
    wrong = wrong or unreadable or _start(place, found, records=cut.salt % RECORDS_EACH == 0)
    return wrong, is_torn, fault


def _found(state: Path, allowed: Sequence[object]) -> tuple[int, str, str]:
    """Return how many cells a daemon will know of, what it will say, and what is wrong with it."""
    with tempfile.TemporaryDirectory() as scratch:
        copied = Path(scratch, STATE)
        if state.is_dir():
            shutil.copytree(state, copied)
        found = LedgerFile(copied, "robot").load(CELL_M)
    cells = found.ledger.cells if found.ledger else 0
    fault = str(found.fault) if found.fault else ""
    if found.fault is not None and not isinstance(found.fault, LedgerFileError):
        return cells, fault, f"not the ledger's own fault: {found.fault!r}"
    if contents(found.ledger) not in allowed:
        return cells, fault, f"{cells} cells, {fault or 'nothing told'}: not what was written last"
    return cells, fault, ""


def _recordings(folder: Path) -> tuple[bool, str]:
    """Repair a copy as a recorder does; return whether that was needed, and what is unreadable."""
    if not folder.is_dir():
        return False, ""
    with tempfile.TemporaryDirectory() as scratch:
        copied = Path(shutil.copytree(folder, Path(scratch, RECORDINGS)))
        is_torn = bool(repair_folder(copied))
        for part in begun_parts(copied):
            try:
                read_summary(part)
            except UnreadableRecording as error:
                if "No recording store" in str(error):
                    continue  # not so much as its first message
                return is_torn, f"{part.name} is not readable after its repair: {error}"
    return is_torn, ""


def _start(place: Path, cells: int, *, records: bool = False) -> str:
    """Start a daemon on what a cut has left; return what is wrong with it.

    Args:
        place: where that is.
        cells: how many it has to know of.
        records: whether it is to go on recording there, too.
    """
    told = _run(place, "", "--state", str(place / STATE))
    if records:
        told += ["--record", str(place / RECORDINGS)]
    before = set(place.rglob("*.rrd"))
    with service(place, told) as daemon:
        if not daemon.wait_ready():
            return f"not ready: {daemon.said()[-500:]}"
        deadline = time.monotonic() + START_S
        while records and set(place.rglob("*.rrd")) <= before:
            if time.monotonic() > deadline:
                return f"nothing is recorded: {daemon.said()[-500:]}"
            time.sleep(0.05)
        code, said = daemon.stop(), daemon.said()
    if code != 0 or "Traceback" in said:
        return f"ended with {code}: {said[-500:]}"
    if f": {cells} cells covered before" not in said:
        return f"does not know of {cells} cells: {said[-500:]}"
    return ""


def main() -> int:
    """Run the campaign, and report."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cuts", type=int, default=200, help="(default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, default=Path("runs/power_cut"), metavar="DIR",
                        help="where what went wrong is kept (default: %(default)s)")  # fmt: skip
    args = parser.parse_args()
    if why := why_not():
        print(f"not possible here: {why}", file=sys.stderr)
        return 2
    # As Ctrl-C, which a shell keeps from what it runs in the background.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    outcomes: list[Outcome] = []
    with tempfile.TemporaryDirectory(prefix="power-cut-") as scratch:
        try:
            trace = watched_mission(Path(scratch))
            cuts = cuts_of(trace.root, trace.calls, args.cuts, args.seed)
            for outcome in outcomes_of(trace, cuts, Path(scratch), args.keep):
                outcomes.append(outcome)
                _show(outcome, len(outcomes), len(cuts))
        except KeyboardInterrupt:
            print("\ninterrupted", file=sys.stderr)
    _tell(outcomes)
    return int(any(outcome.wrong for outcome in outcomes))


def _show(outcome: Outcome, number: int, many: int) -> None:
    if outcome.wrong:
        print(f"{outcome.cut}: {outcome.wrong}")
        print(f"  again: fasaco-edge run --state {outcome.kept}/{STATE}", flush=True)
    show(f"{number} of {many} cuts, the last took {outcome.seconds:.1f} s")


def _tell(outcomes: Sequence[Outcome]) -> None:
    """Print what came of the cuts."""
    for name, what in (("not ready or wrong", "wrong"), ("told", "fault"), ("torn", "is_torn")):
        print(f"{sum(bool(getattr(outcome, what)) for outcome in outcomes):6} {name}")
    seconds = sum(outcome.seconds for outcome in outcomes)
    print(f"{len(outcomes)} cuts in {seconds / 60:.1f} min")


if __name__ == "__main__":
    sys.exit(main())
