"""Failures of each file call of daemon and recorder, in turn.

    python -m tests.campaigns.io_faults                       # all, hours
    python -m tests.campaigns.io_faults --most 20             # 20 of each kind of call
    python -m tests.campaigns.io_faults --only orders --again orders:sync:2:EIO

Takes hours.

The Nth open, read, write, fsync, rename, mmap and so on under the folders of state, recordings and
configuration fails, for every N there is, with each error that it may fail
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
import operator
import os
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from fasaco_edge.cli.console.arguments import Exit
from tests.campaigns.file_calls import Failure, Kind, Watch, why_not
from tests.campaigns.io_scenarios import SCENARIOS, WrongError
from tests.campaigns.services import show

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
# Share of the faults that last.
LASTING_SHARE = 0.2
# Stride between the calls at which a disk disappears.
STRIDE = 3
# What says, on standard error, that something was wrong.
TELLS = ("WARNING", "ERROR", "fasaco-edge:", "kernels not ready")
# What is said where no call fails: after a reset, and where the computer is busy with much else.
USUAL = ("the previous ledger is kept as robot.ledger.reset-", "recorder did not end in ")


@dataclass(frozen=True)
class Outcome:
    """What became of one fault.

    Attributes:
        came: told, unnoticed, or wrong.
        exit_code: of the command.
        said: the line that reports it, or what was wrong.
        on: what the call was made on.
    """

    scenario: str
    failure: str
    came: str
    exit_code: int | None
    said: str
    on: str
    seconds: float


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
    """Return the first line of a log that reports something wrong."""
    for line in log.splitlines():
        if line.startswith(TELLS) and not any(usual in line for usual in USUAL):
            return line
    return ""


def _check_end(code: int | None, log: str, said: str, failure: str) -> None:
    if code is None:
        raise WrongError(f"hangs: {log[-600:]}")
    if code not in (Exit.OK, Exit.ERROR, Exit.CONFIG):
        raise WrongError(f"ended with {code}: {log[-600:]}")
    if "Traceback" in log:
        raise WrongError(f"a traceback: {log[-900:]}")
    if code == Exit.CONFIG and "EACCES" not in failure and "EROFS" not in failure:
        raise WrongError(f"a service is not started again, for a fault that may pass: {said}")
    if code != Exit.OK and not said:
        raise WrongError(f"ended with {code} and not a word: {log[-600:]}")


def failures_of(counts: dict[Kind, int], most: int, seed: int, *, every: bool) -> list[Failure]:
    """Return for each call a failure, by turns with another error; some last for good.

    Args:
        counts: how many calls there are of each kind.
        most: so many of each kind at most, 0 for all.
        seed: chooses the errors, and which are left out.
        every: each call with each error, once and for good.

    Returns:
        the failures, those of the rarest kind first: the others are much alike.
    """
    rng, failures = random.Random(seed), list[Failure]()
    for kind, count in sorted(counts.items(), key=operator.itemgetter(1)):
        of_kind = list[Failure]()
        errors = [(error, False) for error in MAY_FAIL[kind]]
        lasting = [(error, True) for error, _ in errors if error not in ("EINTR", "short")]
        if kind is Kind.ANY:
            errors = []  # a disk that is gone from then on
        for at in range(1, count + 1, STRIDE if kind is Kind.ANY and not every else 1):
            chosen = lasting if not errors or rng.random() < LASTING_SHARE else errors
            for error, for_good in errors + lasting if every else [rng.choice(chosen)]:
                of_kind.append(Failure(kind, at, error, for_good))
        if 0 < most < len(of_kind):
            of_kind = sorted(rng.sample(of_kind, most), key=of_kind.index)
        failures += of_kind
    return failures


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
        "--most", type=int, default=0, metavar="N", help="so many faults of each kind of call "
        "in each scenario, chosen by --seed; 0 for all (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--every-error", action="store_true", help="each call with each error, once and for good; "
        "otherwise by turns",
    )  # fmt: skip
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--again", metavar="SCENARIO:KIND:N:ERROR", help="run one fault; ERROR+ from then on"
    )
    args = parser.parse_args()
    if why := why_not():
        print(f"not possible here: {why}", file=sys.stderr)
        return 2
    if args.again:
        name, _, text = args.again.partition(":")
        outcome, _ = outcome_of(name, Failure.of_text(text))
        print(json.dumps(asdict(outcome), indent=1))
        return int(outcome.came == "wrong")
    # As Ctrl-C, which a shell keeps from what it runs in the background.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    outcomes: list[Outcome] = []
    try:
        for name in args.only or SCENARIOS:
            for outcome in _all_of(name, args.most, args.seed, every=args.every_error):
                outcomes.append(outcome)
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
    _tell(outcomes)
    return int(any(outcome.came == "wrong" for outcome in outcomes))


def _all_of(name: str, most: int, seed: int, *, every: bool) -> Iterator[Outcome]:
    """Run a scenario without a fault, then with each."""
    golden, counts = outcome_of(name, None)
    if golden.came == "wrong":
        print(f"{name}: wrong without any fault: {golden.said}", flush=True)
        yield golden
        return
    failures = failures_of(counts, most, seed, every=every)
    started = time.monotonic()
    for number, failure in enumerate(failures, 1):
        outcome, _ = outcome_of(name, failure)
        # A call that was not made this time shows nothing.
        if outcome.on or outcome.came == "wrong":
            yield outcome
        if outcome.came == "wrong":
            print(f"{name}: {failure} on {outcome.on}: {outcome.said}")
            print(
                f"  again: python -m tests.campaigns.io_faults --again {name}:{failure}", flush=True
            )
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
