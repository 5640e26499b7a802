"""Each part of a robot fails in each way: the robot stops in time, or drives on where it should.

    python -m tests.campaigns.fault_matrix [--only WORDS] [--stages 2] [--watch 14]

Takes minutes.

Two daemons of one name, two followers, a source of poses and their router are processes; a base
moves as the commands say. Each part is frozen, killed, restarted in a loop, cut off from the
network, or slow: what it sends arrives 1 s late. The planner also hangs while something else
fails. Where a fault should stop the robot, no command that moves may come later than 2.5 s after
it (where all links are slow: than 4.5 s, as both status and command are 1 s late), until a
successor is in charge: a daemon that plans, a follower that drives. Elsewhere the robot has to
drive on. Nowhere may two followers drive at once, or the robot leave the hall.
Exit code 1 where one of these is violated.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import sys
import tempfile
import time
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

from tests.campaigns.fault_stage import DELAY_S, PARTS, Stage
from tests.campaigns.services import show

LIMIT_S = 2.5
# What a machine that is busy with much else may take for a turn [s].
SLACK_S = 0.3
# The longest time without a command that moves, where the robot should drive on [s]: at corners it
# stands for a moment, and its successor begins.
GAP_S = 4.0
FAULTS = ("frozen", "killed", "restarted", "cut off", "slow")
STOPS, DRIVES, EITHER = "stops", "drives on", "either"
# What the robot should do, by part, in the order of the faults.
EXPECTED = {
    "planner": (STOPS, STOPS, STOPS, STOPS, DRIVES),
    "second daemon": (DRIVES,) * 5,
    "router": (STOPS, STOPS, EITHER, STOPS, EITHER),
    "follower": (STOPS, STOPS, EITHER, STOPS, EITHER),
    "pose": (STOPS, STOPS, EITHER, STOPS, EITHER),
    "second follower": (DRIVES,) * 5,
}
# What else fails, a moment before the planner hangs.
BESIDE = (
    *(("second daemon", fault) for fault in FAULTS),
    *(("second follower", "restarted"), ("router", "slow"), ("pose", "slow")),
)

Faults = tuple[tuple[str, str], ...]


@dataclass
class Cell:
    """A combination, and what the robot did.

    Attributes:
        faults: parts and how they failed, the last one at the beginning of the watch.
        expected: what the robot should do.
        last_s: the last command that moved before a successor was in charge, after the fault [s];
            None without one.
        successor_s: when a successor was in charge, after the fault [s]; None without one.
        longest_gap_s: longest time without a command that moved [s].
        together: commands that moved within a cycle of another follower's.
        violations: what was wrong.
    """

    faults: Faults
    expected: str
    last_s: float | None = None
    successor_s: float | None = None
    longest_gap_s: float = 0.0
    together: int = 0
    violations: list[str] = field(default_factory=list)

    @property
    def title(self) -> str:
        """Its faults in words."""
        return ", ".join(" ".join(fault) for fault in self.faults)


def cells() -> list[Cell]:
    """Return all combinations."""
    single = [
        Cell(((part, fault),), wanted)
        for part in PARTS
        for fault, wanted in zip(FAULTS, EXPECTED[part], strict=True)
    ]
    return single + [Cell((beside, ("planner", "frozen")), STOPS) for beside in BESIDE]


def run_cell(cell: Cell, watch_s: float) -> Cell:
    """Run a combination."""
    with tempfile.TemporaryDirectory(prefix="fault-") as folder:
        stage = Stage(Path(folder))
        try:
            stage.begin()
            for part, fault in cell.faults[:-1]:
                stage.fail(part, fault)
                time.sleep(1.0)
            driver, planner = stage.base.moves[-1][1], stage.base.planned[-1][1]
            since = time.monotonic()
            stage.fail(*cell.faults[-1])
            time.sleep(watch_s)
            moves = [(at - since, by) for at, by in stage.base.moves if at >= since]
            planned = [(at - since, by) for at, by in stage.base.planned if at >= since]
            left_hall = stage.base.left_hall
        finally:
            stage.close()
    part = cell.faults[-1][0]
    successors = {
        "planner": [at for at, by in planned if by != planner],
        "follower": [at for at, by in moves if by != driver],
    }.get(part, [])
    cell.successor_s = round(min(successors), 2) if successors else None
    until = min(successors, default=math.inf)
    cell.last_s = max((round(at, 2) for at, _ in moves if at < until), default=None)
    times = [0.0, *(at for at, _ in moves), watch_s]
    cell.longest_gap_s = round(max(after - at for at, after in pairwise(times)), 2)
    cell.together = sum(
        other != by and at_other - at < 0.2 and at_other - at >= 0.0
        for (at, by), (at_other, other) in pairwise(moves)
    )
    drives_on = any(at > until for at, _ in moves) or until > watch_s - GAP_S
    judge(cell, left_hall=left_hall, drives_on=drives_on)
    return cell


def judge(cell: Cell, *, left_hall: bool, drives_on: bool) -> None:
    """Note what was wrong; ``drives_on``: whether it does under a successor, if there is time."""
    limit_s = LIMIT_S + SLACK_S + (2.0 * DELAY_S if ("router", "slow") in cell.faults else 0.0)
    if cell.expected == STOPS and cell.last_s is not None and cell.last_s > limit_s:
        cell.violations.append(f"moved {cell.last_s:.1f} s after the fault")
    if cell.expected == DRIVES and cell.longest_gap_s > GAP_S:
        cell.violations.append(f"stood for {cell.longest_gap_s:.1f} s")
    if not drives_on:
        cell.violations.append("stands under the successor")
    # One change of the driver is a takeover.
    if cell.together > 1:
        cell.violations.append(f"two followers drove together, {cell.together} times")
    if left_hall:
        cell.violations.append("left the hall")


def row(cell: Cell) -> str:
    """Return a line of the table."""
    last = "-" if cell.last_s is None else f"{cell.last_s:.2f}"
    successor = "-" if cell.successor_s is None else f"{cell.successor_s:.1f}"
    wrong = "; ".join(cell.violations) or "ok"
    return (
        f"{cell.title:44} {cell.expected:10} {last:>6} {successor:>6} "
        f"{cell.longest_gap_s:6.2f} {cell.together:4}  {wrong}"
    )


def _run(job: tuple[Cell, float]) -> Cell:
    cell = run_cell(*job)
    show(row(cell))
    return cell


def main() -> int:
    """Run the campaign."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--only", default="", help="combinations whose words have this in them")
    parser.add_argument("--stages", type=int, default=2, help="at a time")
    parser.add_argument("--watch", type=float, default=14.0, help="time after the fault [s]")
    args = parser.parse_args()
    jobs = [(cell, args.watch) for cell in cells() if args.only in cell.title]
    with multiprocessing.get_context("spawn").Pool(args.stages) as pool:
        done = pool.map(_run, jobs, chunksize=1)
    print(f"{'fault':44} {'should':10} {'last s':>6} {'next s':>6} {'gap s':>6} both")
    print("\n".join(map(row, done)))
    return 1 if any(cell.violations for cell in done) else 0


if __name__ == "__main__":
    sys.exit(main())
