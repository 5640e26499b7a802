"""Let each file call of the daemon, the recorder and the compiler fail in turn.

    python -m tests.campaigns.io_faults                       # all of them
    python -m tests.campaigns.io_faults --only orders --again orders:sync:2:EIO

The Nth open, read, write, fsync, rename, mmap and so on under the folders of state, recordings,
configuration and compiled kernels fails, for every N there is, with each error that it may fail
with: once, or from then on, also for all kinds of calls at once. What is run is the real command;
what fails is a call to the C library.

It may end, with a documented exit code and a line that says what was wrong; or go on, and say what
was wrong where it matters. It may not hang, die of a signal, show a traceback, lose a ledger or a
recording without a word, or know of a cell that nobody was in; and started again on what is left,
it has to become ready. Exit code 1 where one of these does not hold; the line that runs this one
fault again is printed.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import random
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import yaml

from fasaco_edge.bus.session import Sample
from fasaco_edge.cli import exits
from fasaco_edge.daemon.ledger_codec import LedgerFileError, decode_ledger
from fasaco_edge.daemon.ledger_file import LedgerFile
from fasaco_edge.errors import UnreadableRecording
from fasaco_edge.kernels import cache
from fasaco_edge.recording.reading import read_summary
from fasaco_edge.recording.repair import repair_folder
from fasaco_edge.wire.keys import Keys
from tests.campaigns.file_calls import Failure, Kind, Watch, why_not
from tests.campaigns.services import Service, service, show
from tests.daemon.hall import begin, drive, lanes
from tests.daemon.ledgers import CELL_M, Cell, contents, lane, visits_of
from tests.daemon.outsider import Outsider
from tests.daemon.processes import ENVIRONMENT, PROGRAM, free_endpoint
from tests.daemon.test_commands import command
from tests.recording.kill_campaign import driving
from tests.recording.recorders import bus_on_free_port

# What each kind may fail with. Who calls again after EINTR, and who writes the rest of what was
# written in part, does not notice.
MAY_FAIL = {
    Kind.OPEN: ("EIO", "ENOSPC", "EROFS", "EACCES", "EMFILE", "EINTR"),
    Kind.READ: ("EIO", "EINTR", "short"),
    Kind.WRITE: ("EIO", "ENOSPC", "EINTR", "short"),
    Kind.SYNC: ("EIO", "ENOSPC"),
    Kind.RENAME: ("EIO", "ENOSPC", "EROFS", "EACCES"),
    Kind.MAP: ("EIO", "EACCES"),
    Kind.UNLINK: ("EIO", "EROFS", "EACCES"),
    Kind.FOLDER: ("EIO", "ENOSPC", "EROFS", "EACCES"),
    Kind.TRUNCATE: ("EIO",),
    Kind.LOOK: ("EIO", "EACCES"),
    Kind.LINK: ("EIO", "EROFS"),
    Kind.ANY: ("EIO", "ENOSPC", "EMFILE"),
}
TIMEOUT_S = 40.0
# What says, on standard error, that something was wrong.
TELLS = ("WARNING", "ERROR", "fasaco-edge:", "kernels not ready")
# What is said after a reset, where all is well.
USUAL = "the ledger before is kept as robot.ledger.reset-"
STATE, RECORDINGS, CACHE = "state", "recordings", "cache"


Completed = subprocess.CompletedProcess[str]


class WrongError(AssertionError):
    """What may not happen has happened."""


@dataclass(frozen=True)
class Outcome:
    """What became of one fault.

    Attributes:
        came: told, unnoticed, or wrong.
        exit_code: of the command.
        said: the line that tells it, or what was wrong.
        on: what the call was made on.
    """

    scenario: str
    failure: str
    came: str
    exit_code: int | None
    said: str
    on: str
    seconds: float


@dataclass(frozen=True)
class Scenario:
    """A command, what it lives through, and what has to be left.

    Attributes:
        prepare: lays down what it finds in the folder.
        run: runs it; returns its exit code and what it said. Raises WrongError.
        after: checks what it has left, given whether something was told. Raises WrongError.
        under: where in the folder calls may fail.
    """

    prepare: Callable[[Path], None]
    run: Callable[[Path, dict[str, str]], tuple[int | None, str]]
    after: Callable[[Path, bool], None]
    under: tuple[str, ...]


# ---- daemons ----


def _lay_ledgers(folder: Path) -> None:
    (folder / STATE).mkdir()
    file = LedgerFile(folder / STATE, "robot")
    for length in (3, 4):
        file.write(lane(length))
    _lay_config(folder)


def _lay_config(folder: Path) -> None:
    sections = {"bus": {"listen": [free_endpoint()]}, "mission": {"lost_pose_s": 0.0}}
    (folder / "etc").mkdir()
    (folder / "etc" / "config.yaml").write_text(yaml.safe_dump(sections))


def _daemon_words(folder: Path) -> list[str]:
    config = str(folder / "etc" / "config.yaml")
    return ["run", "--config", config, "--state", str(folder / STATE)]


def _endpoint(folder: Path) -> str:
    document = yaml.safe_load((folder / "etc" / "config.yaml").read_text())
    return str(document["bus"]["listen"][0])


def _give_orders(folder: Path, environment: dict[str, str]) -> tuple[int | None, str]:
    """Let a daemon without a map be told what to do, and end."""
    with service(folder, _daemon_words(folder), environment) as daemon:
        if _is_ready(daemon):
            with Outsider(_endpoint(folder)) as outsider:
                outsider.ask_status()
                for order in ("pause", "start", "reset", "start"):
                    if "code" in (answer := command(outsider, order)):
                        raise WrongError(f"{order} is refused: {answer}")
        return daemon.stop(), daemon.said()


def _is_ready(daemon: Service) -> bool:
    """Wait until a daemon is ready, or has ended."""
    is_ready = daemon.wait_ready(TIMEOUT_S)
    if not is_ready and daemon.process.poll() is None:
        raise WrongError(f"neither ready nor gone: {daemon.said()[-600:]}")
    return is_ready


def _keeps_the_four(folder: Path, is_told: bool) -> None:
    """Check that the four cells are still there, and that a daemon goes on with nothing else."""
    names = sorted(os.listdir(folder / STATE))
    kept = [_holds(folder / STATE / name) for name in names]
    if contents(lane(4)) not in kept:
        raise WrongError(f"the ledger of four cells is gone: {names}")
    if not is_told and not any(".reset-" in name for name in names):
        raise WrongError(f"it was reset, and still goes on with what was: {names}")
    _starts_again(folder, [{}, *map(visits_of, [lane(3), lane(4)] if is_told else [])])


def _holds(path: Path) -> object:
    try:
        return contents(decode_ledger(path.read_bytes(), CELL_M))
    except (OSError, LedgerFileError):
        return None


def _drive(folder: Path, environment: dict[str, str]) -> tuple[int | None, str]:
    """Let a daemon with a recorder plan, and its robot drive over some cells."""
    words = [*_daemon_words(folder), "--record", str(folder / RECORDINGS)]
    with service(folder, words, environment) as daemon:
        if _is_ready(daemon):
            with Outsider(_endpoint(folder)) as outsider:
                begin(outsider)
                drive(outsider, lanes(DRIVEN))
            if daemon.process.poll() is None:
                time.sleep(1.2)  # the recorder begins some time after the daemon
        return daemon.stop(), daemon.said()


def _knows_its_drive(folder: Path, is_told: bool) -> None:
    """Check that what was driven is kept, and nothing else."""
    found = LedgerFile(folder / STATE, "robot").load(CELL_M)
    cells = set(visits_of(found.ledger)) if found.ledger else set()
    driven = {(math.floor(y / CELL_M), math.floor(x / CELL_M)) for x, y in lanes(DRIVEN)}
    if not cells <= driven:
        raise WrongError(f"invented: {sorted(cells - driven)}")
    if not is_told and cells != driven:
        raise WrongError(f"lost without a word: {sorted(driven - cells)}")
    _starts_again(folder, [dict.fromkeys(cells, 1)])
    _recordings_read(folder, is_told)


def _starts_again(folder: Path, may_hold: Sequence[dict[Cell, int]]) -> None:
    """Start a daemon where nothing fails any more: it has to become ready.

    Args:
        may_hold: the visited cells that it may know of.
    """
    found = LedgerFile(folder / STATE, "robot").load(CELL_M)
    visits = visits_of(found.ledger) if found.ledger else {}
    if visits not in may_hold:
        raise WrongError(f"what it goes on with was never so: {visits}")
    with service(folder, _daemon_words(folder)) as daemon:
        if not daemon.wait_ready():
            raise WrongError(f"does not start again: {daemon.said()[-600:]}")
        if (code := daemon.stop()) != 0:
            raise WrongError(f"started again, it ends with {code}: {daemon.said()[-600:]}")


# ---- recorders ----


def _record(folder: Path, environment: dict[str, str]) -> tuple[int | None, str]:
    """Let a recorder write for a while."""
    with bus_on_free_port() as (bus, endpoint), driving(bus):
        words = ["record", "--out", str(folder / RECORDINGS), "--connect", endpoint]
        enough = threading.Event()
        bus.subscribe(Keys().recorder, lambda sample: _hear(sample, enough), latched=True)
        with service(folder, words, environment) as recorder:
            deadline = time.monotonic() + TIMEOUT_S
            while recorder.process.poll() is None and not enough.wait(0.05):
                if time.monotonic() > deadline:
                    raise WrongError(f"says nothing: {recorder.said()[-600:]}")
            return recorder.stop(), recorder.said()


def _hear(sample: Sample, enough: threading.Event) -> None:
    if json.loads(sample.payload)["messages"] >= MESSAGES:
        enough.set()


def _recordings_read(folder: Path, is_told: bool) -> None:
    """Check that what was recorded can be read, once the next recorder has looked it through."""
    recordings = folder / RECORDINGS
    rows = 0
    if recordings.is_dir():
        repair_folder(recordings)
        for part in recordings.glob("*.rrd"):
            try:
                rows += sum(read_summary(part).rows.values())
            except UnreadableRecording as error:
                if part.stat().st_size and not is_told:
                    raise WrongError(f"not readable after its repair: {error}") from error
    if not is_told and not rows:
        raise WrongError(f"nothing recorded, and not a word: {sorted(os.listdir(folder))}")


# ---- compiled kernels ----


def _lay_cache(folder: Path) -> None:
    """Copy compiled kernels, all but one."""
    shutil.copytree(cache.usable_folder().parent, folder / CACHE)
    for gone in sorted((folder / CACHE).glob(f"*/*/{TO_COMPILE}*")):
        gone.unlink()


def _warm_up(folder: Path, environment: dict[str, str]) -> tuple[int | None, str]:
    done = _command(folder, environment, "warmup")
    return done.returncode, done.stderr


def _command(folder: Path, environment: dict[str, str], *words: str) -> Completed:
    environment = ENVIRONMENT | {"NUMBA_CACHE_DIR": str(folder / CACHE)} | environment
    try:
        return subprocess.run(
            [*PROGRAM, *words],
            env=environment,
            capture_output=True,
            text=True,
            timeout=180,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise WrongError(f"{words} hangs") from error


def _is_warm(folder: Path, is_told: bool) -> None:
    """Check that the kernels are there, or were said not to be and are with the next try."""
    if is_told:
        again = _command(folder, {}, "warmup")
        if again.returncode != 0:
            raise WrongError(f"the next try ends with {again.returncode}: {again.stderr[-600:]}")
    check = _command(folder, {}, "warmup", "--check")
    if check.returncode != 0:
        raise WrongError(f"not ready: {check.stderr[-600:]}")


DRIVEN, MESSAGES = 6, 60
LASTING_SHARE, STRIDE = 0.2, 3
TO_COMPILE = "regions."
SCENARIOS = {
    "orders": Scenario(_lay_ledgers, _give_orders, _keeps_the_four, (STATE, "etc")),
    "mission": Scenario(_lay_config, _drive, _knows_its_drive, (STATE, RECORDINGS)),
    "recorder": Scenario(lambda _: None, _record, _recordings_read, (RECORDINGS,)),
    "warmup": Scenario(_lay_cache, _warm_up, _is_warm, (CACHE,)),
}


# ---- the campaign ----


def outcome_of(name: str, failure: Failure | None) -> tuple[Outcome, dict[Kind, int]]:
    """Run a scenario in which one call fails; also return how many calls of each kind it made."""
    scenario, started = SCENARIOS[name], time.monotonic()
    with tempfile.TemporaryDirectory(prefix="io-fault-") as scratch:
        folder = Path(scratch)
        scenario.prepare(folder)
        code, came, said = None, "", ""
        with Watch([folder / place for place in scenario.under], failure) as watch:
            try:
                code, log = scenario.run(folder, watch.environment)
                said = _told_by(log)
                _check_end(code, log, said, str(failure))
                scenario.after(folder, bool(said))
                came = "told" if said else "unnoticed"
            except Exception as error:
                came, said = "wrong", f"{type(error).__name__}: {error}"
            seconds = round(time.monotonic() - started, 2)
            on, counts = watch.failed_on(), watch.counts()
    place = os.path.relpath(on, folder) if on else ""
    return Outcome(name, str(failure or ""), came, code, said, place, seconds), counts


def _told_by(log: str) -> str:
    """Return the first line of a log that tells of something wrong."""
    lines = [line for line in log.splitlines() if line.startswith(TELLS) and USUAL not in line]
    return lines[0] if lines else ""


def _check_end(code: int | None, log: str, said: str, failure: str) -> None:
    if code is None:
        raise WrongError(f"hangs: {log[-600:]}")
    if code not in (exits.OK, exits.ERROR, exits.CONFIG):
        raise WrongError(f"ended with {code}: {log[-600:]}")
    if "Traceback" in log:
        raise WrongError(f"a traceback: {log[-900:]}")
    if code == exits.CONFIG and "EACCES" not in failure and "EROFS" not in failure:
        raise WrongError(f"a service is not started again, for a fault that may pass: {said}")
    if code != exits.OK and not said:
        raise WrongError(f"ended with {code} and not a word: {log[-600:]}")


def failures_of(counts: dict[Kind, int], most: int, seed: int, *, every: bool) -> list[Failure]:
    """Return for each call a failure, by turns with another error; some last for good.

    Args:
        counts: how many calls there are of each kind.
        most: so many at most, 0 for all.
        seed: chooses the errors, and which are left out.
        every: each call with each error, once and for good.
    """
    rng, failures = random.Random(seed), list[Failure]()
    for kind, count in counts.items():
        errors = [(error, False) for error in MAY_FAIL[kind]]
        lasting = [(error, True) for error, _ in errors if error not in ("EINTR", "short")]
        if kind is Kind.ANY:
            errors = []  # a disk that is gone from then on
        for at in range(1, count + 1, STRIDE if kind is Kind.ANY and not every else 1):
            chosen = lasting if not errors or rng.random() < LASTING_SHARE else errors
            for error, for_good in errors + lasting if every else [rng.choice(chosen)]:
                failures.append(Failure(kind, at, error, for_good))
    if not 0 < most < len(failures):
        return failures
    return sorted(rng.sample(failures, most), key=failures.index)


def main() -> int:
    """Run the campaign, and report."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--only", choices=SCENARIOS, action="append", metavar="SCENARIO",
        help=f"run these alone, of {', '.join(SCENARIOS)}",
    )  # fmt: skip
    parser.add_argument(
        "--most", type=int, default=0, metavar="N", help="so many faults of each scenario, chosen "
        "by --seed; 0 for all (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--every-error", action="store_true", help="each call with each error, once and for good; "
        "otherwise by turns",
    )  # fmt: skip
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--again", metavar="SCENARIO:KIND:N:ERROR", help="run one fault; ERROR+ from then on"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all outcomes")
    args = parser.parse_args()
    if why := why_not():
        print(f"not possible here: {why}", file=sys.stderr)
        return 2
    if args.again:
        name, _, text = args.again.partition(":")
        outcome, _ = outcome_of(name, Failure.of_text(text))
        print(json.dumps(asdict(outcome), indent=1))
        return int(outcome.came == "wrong")
    outcomes: list[Outcome] = []
    try:
        for name in args.only or SCENARIOS:
            for outcome in _all_of(name, args.most, args.seed, every=args.every_error):
                outcomes.append(outcome)
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
    _tell(outcomes)
    if args.json:
        args.json.write_text(json.dumps([asdict(outcome) for outcome in outcomes], indent=1))
    return int(any(outcome.came == "wrong" for outcome in outcomes))


def _all_of(name: str, most: int, seed: int, *, every: bool) -> Iterator[Outcome]:
    """Run a scenario without a fault, then with each."""
    golden, counts = outcome_of(name, None)
    if golden.came == "wrong":
        yield golden
        return
    failures = failures_of(counts, most, seed, every=every)
    started = time.monotonic()
    for number, failure in enumerate(failures, 1):
        outcome, _ = outcome_of(name, failure)
        if outcome.on or outcome.came == "wrong":
            yield outcome
        if outcome.came == "wrong":
            print(f"{name}: {failure} on {outcome.on}: {outcome.said}", flush=True)
            print(f"  again: python -m tests.campaigns.io_faults --again {name}:{failure}")
        left_s = (len(failures) - number) * (time.monotonic() - started) / number
        show(f"{name}: {number} of {len(failures)} faults, {left_s / 60:.0f} min left")


def _tell(outcomes: list[Outcome]) -> None:
    """Print a table: what came of the faults of each kind in each scenario."""
    counted = Counter((o.scenario, o.failure.partition(":")[0], o.came) for o in outcomes)
    print(f"{'scenario':10} {'call':10} {'faults':>7} {'told':>7} {'unnoticed':>10} {'wrong':>7}")
    for scenario, kind in sorted({key[:2] for key in counted}):
        came = [counted[scenario, kind, word] for word in ("told", "unnoticed", "wrong")]
        print(f"{scenario:10} {kind:10} {sum(came):7} {came[0]:7} {came[1]:10} {came[2]:7}")
    seconds = sum(outcome.seconds for outcome in outcomes)
    print(f"{len(outcomes)} faults in {seconds / 60:.1f} min")


if __name__ == "__main__":
    sys.exit(main())
