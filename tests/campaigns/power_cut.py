"""Power cuts at each write of a first start and a mission, and the next start.

    python -m tests.campaigns.power_cut --cuts 2000

Takes hours.

A real daemon with its recorder is watched while its robot drives, is told to begin anew, and while
it is started again; and the compiler, while it fills an empty cache. From each call that changed a
file, what a loss of power may leave is rebuilt: what was synchronised is there, of the rest the
bytes may be whole, those from before, none, zeros or half, the names moved or not. On each of these
a real daemon is started as a service starts it, or the compiler goes on. It has to become ready
without help; to know all that was on the disk and nothing else, or say that it does not; and what
is left of recordings has to be readable, once a recorder has looked it through.

Exit code 1 where one of these does not hold; the folder of each such cut is kept, and the command
that starts a daemon on it again is printed.
"""

from __future__ import annotations

import argparse
import json
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import yaml

from fasaco_edge.daemon.ledger.codec import decode_ledger
from fasaco_edge.daemon.ledger.file import LedgerFile
from fasaco_edge.errors import LedgerFileError, UnreadableRecording
from fasaco_edge.recording.read.torn import repair_folder
from tests.campaigns.file_calls import Call, Kind, Watch, why_not
from tests.campaigns.power_states import Cut, Disk, Spread, cuts_of
from tests.campaigns.roaming import entries, roaming_robot
from tests.campaigns.services import START_S, service, show
from tests.daemon.test_commands import command
from tests.support.compilers import compile_into, why_not_whole
from tests.support.ledgers import CELL_M, Cell, contents
from tests.support.outsider import Outsider
from tests.support.processes import free_endpoint
from tests.support.recordings import begun_parts, read_summary

# At so small a distance from the border of "under the tool", rounding may decide.
DOUBT_M = 0.01
MOST_LOST_S = 1.0
STATE, RECORDINGS, CACHE = "state", "recordings", "cache"
MISSION, FIRST_START = "mission", "first-start"
# Of the cuts, so many are of a first start: to compile the kernels again takes seconds.
FIRST_SHARE = 0.15
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
        driven: when the tool first passed over each cell that the daemon has poses of [s].
        touched: cells that it may have passed over.
    """

    root: Path
    calls: list[Call]
    driven: dict[Cell, float]
    touched: set[Cell]


@dataclass(frozen=True)
class Outcome:
    """What became of a cut; ``wrong`` is "" where all was well."""

    part: str
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
    with roaming_robot("basement") as (robot, endpoint), Watch([root], is_logged=True) as watch:
        words = ["--state", str(root / STATE), "--record", str(root / RECORDINGS)]
        began_s = time.monotonic()
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
        trail = robot.trail.between(began_s, time.monotonic())
        driven = entries([point for point in trail if point[3]], DOUBT_M)
        return Trace(root, watch.calls(), driven, set(entries(trail, -DOUBT_M)))


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


def outcomes_of(
    part: str, trace: Trace, cuts: Sequence[Cut], folder: Path, keep: Path
) -> Iterator[Outcome]:
    """Cut a part of the campaign, and judge what each cut leaves."""
    judge, disk, done = PARTS[part][1](trace), Disk(trace.root), 0
    for cut in cuts:
        for call in trace.calls[done : cut.after]:
            disk.do(call)
        done = cut.after
        place = folder / "cut"
        place.mkdir()
        started = time.monotonic()
        disk.write(cut, place)
        wrong, is_torn, fault = judge(cut, place)
        kept = ""
        if wrong:
            kept = str(keep / f"{part}-{cut.salt}")
            shutil.copytree(place, kept, dirs_exist_ok=True)
        shutil.rmtree(place)
        seconds = time.monotonic() - started
        yield Outcome(part, str(cut), wrong, round(seconds, 3), is_torn, fault, kept)


# What is wrong with what a cut left, whether a recording is torn, and what fault the ledger has.
Judge = Callable[[Cut, Path], tuple[str, bool, str]]


def judge_of_mission(trace: Trace) -> Judge:
    """Return what starts a daemon on what a cut of a mission left."""
    history = ledgers_of(trace)

    def judge(cut: Cut, place: Path) -> tuple[str, bool, str]:
        found, fault, wrong = _found(place / STATE, allowed_after(history, cut.after))
        is_torn, unreadable = _recordings(place / RECORDINGS)
        wrong = wrong or unreadable or _start(place, found, records=cut.salt % RECORDS_EACH == 0)
        return wrong, is_torn, fault

    return judge


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


def _start(
    place: Path,
    cells: int,
    environment: Mapping[str, str] | None = None,
    *,
    records: bool = False,
) -> str:
    """Start a daemon on what a cut has left; return what is wrong with it.

    Args:
        place: where that is.
        cells: how many it has to know of.
        environment: beside ours.
        records: whether it is to go on recording there, too.
    """
    told = _run(place, "", "--state", str(place / STATE))
    if records:
        told += ["--record", str(place / RECORDINGS)]
    before = set(place.rglob("*.rrd"))
    with service(place, told, environment) as daemon:
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


def watched_first_start(folder: Path) -> Trace:
    """Let the compiler fill an empty cache; write down what is written."""
    root = folder / "computer"
    root.mkdir()
    with Watch([root], is_logged=True) as watch:
        compile_into(root / CACHE / "kernels", watch.environment)
        return Trace(root, watch.calls(), {}, set())


def judge_of_first_start(trace: Trace) -> Judge:
    """Return what lets the compiler go on from what a cut of a first start left."""

    def judge(cut: Cut, place: Path) -> tuple[str, bool, str]:
        ended = compile_into(place / CACHE / "kernels")
        return ended.stderr[-500:] or why_not_whole(place / CACHE / "kernels"), False, ""

    return judge


PARTS = {
    MISSION: (watched_mission, judge_of_mission, Spread.ALL),
    FIRST_START: (watched_first_start, judge_of_first_start, Spread.ONE),
}


def run_campaign(
    cuts: Mapping[str, int], seed: int, scratch: Path, keep: Path
) -> Iterator[tuple[Outcome, int]]:
    """Yield what became of each cut, and how many there are in its part.

    Args:
        cuts: how many of each part.
        seed: which of those there could be.
        scratch: an empty folder.
        keep: where what went wrong is kept.
    """
    for part, most in cuts.items():
        watched, _, spread = PARTS[part]
        (scratch / part).mkdir()
        trace = watched(scratch / part)
        chosen = cuts_of(trace.root, trace.calls, most, seed, spread)
        for outcome in outcomes_of(part, trace, chosen, scratch, keep):
            yield outcome, len(chosen)


def main() -> int:
    """Run the campaign, and report."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cuts", type=int, default=200, help="in all (default: %(default)s)")
    parser.add_argument("--only", choices=PARTS, metavar="PART", help=f"one of {', '.join(PARTS)}")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, default=Path("runs/power_cut"), metavar="DIR",
                        help="where what went wrong is kept (default: %(default)s)")  # fmt: skip
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all outcomes")
    args = parser.parse_args()
    if why := why_not():
        print(f"not possible here: {why}", file=sys.stderr)
        return 2
    first = round(FIRST_SHARE * args.cuts)
    cuts = {MISSION: args.cuts - first, FIRST_START: first}
    if args.only:
        cuts = {args.only: args.cuts}
    # As Ctrl-C, which a shell keeps from what it runs in the background.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    outcomes: list[Outcome] = []
    with tempfile.TemporaryDirectory(prefix="power-cut-") as scratch:
        try:
            for outcome, many in run_campaign(cuts, args.seed, Path(scratch), args.keep):
                outcomes.append(outcome)
                _show(outcome, sum(o.part == outcome.part for o in outcomes), many)
        except KeyboardInterrupt:
            print("\ninterrupted", file=sys.stderr)
    _tell(outcomes)
    if args.json:
        args.json.write_text(json.dumps([asdict(outcome) for outcome in outcomes], indent=1))
    return int(any(outcome.wrong for outcome in outcomes))


def _show(outcome: Outcome, number: int, many: int) -> None:
    if outcome.wrong:
        print(f"{outcome.part}: {outcome.cut}: {outcome.wrong}")
        print(f"  again: fasaco-edge run --state {outcome.kept}/{STATE}", flush=True)
    show(f"{outcome.part}: {number} of {many} cuts, the last took {outcome.seconds:.1f} s")


def _tell(outcomes: Sequence[Outcome]) -> None:
    """Print a table: what came of the cuts of each part."""
    print(f"{'part':12} {'cuts':>6} {'not ready or wrong':>19} {'told':>6} {'torn recordings':>16}")
    for part in PARTS:
        came = [outcome for outcome in outcomes if outcome.part == part]
        numbers = [sum(map(bool, column)) for column in zip(
            *((o.wrong, o.fault, o.is_torn) for o in came), strict=True)] or [0, 0, 0]  # fmt: skip
        print(f"{part:12} {len(came):6} {numbers[0]:19} {numbers[1]:6} {numbers[2]:16}")
    seconds = sum(outcome.seconds for outcome in outcomes)
    print(f"{len(outcomes)} cuts in {seconds / 60:.1f} min")


if __name__ == "__main__":
    sys.exit(main())
