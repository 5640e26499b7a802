"""``benchmarks by-room``: costs and savings of finishing a room before the next.

Missions in unknown homes and offices are simulated with each ``mission.by_room``. The true
rooms and the robot's track give the number of its returns to unfinished rooms.
"""

from __future__ import annotations

import argparse
import itertools
from collections import Counter
from collections.abc import Generator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bench.benchmark import Benchmark, MeasuredGoal, Report, Say, positive
from fasaco_edge.grid.lattice import Cell, CoverageLattice, Footprint
from fasaco_edge.mission.config import ByRoom, MissionPolicy
from tests.benchmarks.harness import add_floors
from tests.benchmarks.online.buildings import Building
from tests.benchmarks.online.mission import Conditions, CountedPlanning, OnlineMission
from tests.benchmarks.online.robot import Pace
from tests.benchmarks.rooms.homes import KINDS, Home, home

POLICIES: tuple[ByRoom, ...] = ("never", "auto", "always")
FOOTPRINT, PACE, RANGE_M = Footprint(0.3, 0.18), Pace(0.25, 1.5), 3.0
PROPOSALS, SPARE_SHARE = 200_000, 0.05
# A stay in a room is one to sweep if it has at least this many new cells; ways through have fewer.
LEAST_CELLS = 4
GOAL_TIME, GOAL_SHARE = 1.01, 1 / 3
HEADER = ("floor", "by_room", "missions", "time", "came back", "also through", "crossings")


@dataclass(frozen=True, slots=True)
class Drive:
    """What a mission came to.

    Attributes:
        kind: of the floor.
        number: of the floor and the start.
        policy: ``mission.by_room``.
        seconds: until it was done [s].
        returns: stays to sweep in a room after an earlier one, but for rooms on the way to others.
        returns_in_all: the same in all rooms.
        crossings: how often it drove from one room into another.
        is_done: whether the mission said so.
    """

    kind: str
    number: tuple[int, int]
    policy: ByRoom
    seconds: float
    returns: int
    returns_in_all: int
    crossings: int
    is_done: bool


def building_of(floor: Home) -> Building:
    """Return a floor as a building that starts in the free cell nearest to its start."""
    lattice = CoverageLattice.from_map(floor.grid, FOOTPRINT)
    row, col = floor.start
    start = np.array(lattice.cell_at(*floor.grid.geometry.to_map(col + 0.5, row + 0.5)))
    corner = np.array((lattice.window.row0, lattice.window.col0))
    cells = np.argwhere(lattice.coverable) + corner
    nearest: Cell = tuple(cells[np.abs(cells - start).sum(axis=1).argmin()].tolist())
    return Building(floor.name, floor.grid, FOOTPRINT, lattice, nearest)


def drive(floor: Home, start: int, policy: ByRoom, kind: str, number: int) -> Drive:
    """Run a mission and judge it by the true rooms."""
    conditions = Conditions(
        range_m=RANGE_M,
        pace=PACE,
        cost=PACE.cost(FOOTPRINT.cell_m, with_turns=True),
        seat=CountedPlanning(start, PROPOSALS),
        policy=MissionPolicy(retries=0, lost_pose_s=0.0, by_room=policy),
        spare_share=SPARE_SHARE,
    )
    mission = OnlineMission(building_of(floor).started_at(start), conditions)
    mission.run()
    stays = stays_of(np.array(mission.robot.trail), floor)
    returns = returns_to(stays)
    through = passages(stays)
    few = sum(count for room, count in returns.items() if room not in through)
    return Drive(
        *(kind, (number, start), policy, mission.now),
        *(few, returns.total(), len(stays) - 1, mission.done),
    )


def stays_of(trail: NDArray[np.float64], floor: Home) -> list[tuple[int, int]]:
    """Return the rooms that a robot was in, one after the other, and the new cells in each stay.

    Args:
        trail: float64 (n, 2), the robot's way (x, y) [pixels].
        floor: the true rooms.
    """
    legs = itertools.pairwise(trail)
    ways = [np.linspace(a, b, int(np.abs(b - a).max()) + 1, endpoint=False) for a, b in legs]
    pixels = np.concatenate(ways).astype(int)
    rooms = floor.rooms[pixels[:, 1], pixels[:, 0]]
    side = max(round(FOOTPRINT.cell_m / floor.grid.geometry.resolution), 1)
    first = np.zeros(len(pixels), bool)
    first[np.unique(pixels // side, axis=0, return_index=True)[1]] = True
    rooms, first = rooms[rooms > 0], first[rooms > 0]
    begins = np.flatnonzero(np.diff(rooms, prepend=-1))
    new = np.add.reduceat(first, begins)
    return list(zip(rooms[begins].tolist(), new.tolist(), strict=True))


def returns_to(stays: Sequence[tuple[int, int]]) -> Counter[int]:
    """Return for each room how many stays to sweep it came after the first one."""
    swept = Counter(room for room, new in stays if new >= LEAST_CELLS)
    return Counter({room: count - 1 for room, count in swept.items()})


def passages(stays: Sequence[tuple[int, int]]) -> set[int]:
    """Return the rooms on the way to others: without one, the rest falls apart."""
    rooms = {room for room, _ in stays}
    doors = {frozenset((one[0], other[0])) for one, other in itertools.pairwise(stays)}
    return {room for room in rooms if not _is_joined(rooms - {room}, doors)}


def _is_joined(rooms: set[int], doors: set[frozenset[int]]) -> bool:
    left, reached = set(rooms), set[int]()
    while left and (new := {left.pop()} if not reached else _beside(reached, doors) & left):
        reached |= new
        left -= new
    return not left


def _beside(rooms: set[int], doors: set[frozenset[int]]) -> set[int]:
    return set[int]().union(*(door for door in doors if door & rooms))


def _measure(args: argparse.Namespace, say: Say) -> Generator[Drive, None, None]:
    for kind in KINDS:
        for number in range(args.seed, args.seed + args.floors):
            floor = home(kind, number)
            for start in range(args.starts):
                say(f"{floor.name}, start {start}")
                for policy in POLICIES:
                    yield drive(floor, start, policy, kind, number)


def _add_options(parser: argparse.ArgumentParser) -> None:
    add_floors(parser, 4)
    parser.add_argument(
        "--starts", type=positive, default=2, help="on each floor (default: %(default)s)"
    )


def _report(args: argparse.Namespace, samples: Sequence[Drive]) -> Report:
    never = {(one.kind, one.number): one for one in samples if one.policy == POLICIES[0]}
    figures, rows = [], []
    for policy in POLICIES:
        for kind in (*KINDS, "all"):
            drives = [one for one in samples if one.policy == policy and kind in (one.kind, "all")]
            ratios = [one.seconds / never[one.kind, one.number].seconds for one in drives]
            sums = {
                name: sum(getattr(one, name) for one in drives)
                for name in ("returns", "returns_in_all", "crossings")
            }
            time = float(np.mean(ratios))
            done = sum(one.is_done for one in drives)
            figures.append({"kind": kind, "by_room": policy, "time": round(time, 4), **sums})
            figures[-1] |= {"missions": len(drives), "done": done}
            rows.append((kind, policy, str(len(drives)), f"{time:.4f}", *map(str, sums.values())))
    total = {each["by_room"]: each for each in figures if each["kind"] == "all"}
    least = max(int(total["never"]["returns"]), 1)
    share = round(int(total["auto"]["returns"]) / least, 3)
    return Report(
        title="a room finished before the next",
        header=HEADER,
        rows=tuple(rows),
        figures={"by_room": figures},
        goals=(
            MeasuredGoal("time of auto, over never", float(total["auto"]["time"]), GOAL_TIME),
            MeasuredGoal("rooms come back to, auto over never", share, round(GOAL_SHARE, 3)),
        ),
        remarks=(
            "came back: stays with four or more new cells in a room with such a stay before, "
            "except for rooms on the way to others; also through: including these rooms; time: "
            "mean of the ratios to the same mission with never",
        ),
    )


BY_ROOM = Benchmark(
    name="by-room",
    summary="costs and savings of finishing a room before the next",
    description="Simulate missions in unknown generated homes and offices with mission.by_room "
    "never, auto and always. Count the robot's returns to unfinished rooms, by its track and the "
    "true rooms.",
    add_options=_add_options,
    count=lambda args: len(KINDS) * args.floors * args.starts * len(POLICIES),
    measure=_measure,
    report=_report,
    epilog="""\
examples:
  python -m tests.benchmarks by-room
  python -m tests.benchmarks by-room --floors 2 --seed 900

A mission takes some 30 s on a quiet machine.
""",
)
