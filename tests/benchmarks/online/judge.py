"""What a robot's trail came to, told from where it was and what was there alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.judge import check_walk, reachable
from tests.benchmarks.online.buildings import CASE
from tests.benchmarks.online.mission import OnlineMission
from tests.benchmarks.online.robot import cells_of

# Shares of the reachable cells, in percent.
MILESTONES = (90, 99, 100)

Moment = tuple[float, int]


@dataclass(frozen=True, slots=True)
class Verdict:
    """How a mission went in truth.

    Attributes:
        cells: that could be reached, at the end.
        missed: those of them that the robot never was in.
        problems: what is wrong, such as steps through walls; empty if nothing is.
        steps: from cell to cell.
        revisits: visits of cells beyond each one's first.
        quarters: how far the robot turned, in quarter-turns.
        reached: after what time [s] and how many steps each of MILESTONES was reached, None
            where it was not.
    """

    cells: int
    missed: int
    problems: tuple[str, ...]
    steps: int
    revisits: int
    quarters: float
    reached: tuple[Moment | None, ...]


def judged(mission: OnlineMission) -> Verdict:
    """Judge a mission that is over.

    In a building that stays as it is, the trail is a walk over its lattice: each step is to be
    one of that. In one that changes, what counts is which of the cells that can be reached in
    the end, and where the map has them in the end, the tool has passed over.
    """
    return _judged_case(mission) if mission.building.kind == CASE else _judged_walk(mission)


def _judged_walk(mission: OnlineMission) -> Verdict:
    building, robot = mission.building, mission.robot
    lattice = building.lattice
    corner = (lattice.window.row0, lattice.window.col0)
    walk = cells_of(robot.trail, mission.sight, lattice.cell_m) - corner
    verdict = check_walk(lattice.steps, lattice.coverable, walk, lattice.local(building.start))
    wanted = building.reachable
    first_visits = np.sort(np.unique(walk, axis=0, return_index=True)[1])
    cells = int(np.count_nonzero(wanted))
    return Verdict(
        cells=cells,
        missed=cells - len(first_visits) if verdict.legal else -1,
        problems=verdict.problems,
        steps=verdict.steps,
        revisits=verdict.revisits,
        quarters=verdict.turns_90 + 2 * verdict.turns_180,
        reached=_milestones(first_visits, cells, robot.times),
    )


def _judged_case(mission: OnlineMission) -> Verdict:
    robot, sight = mission.robot, mission.sight
    lattice = sight.true_lattice()
    corner = (lattice.window.row0, lattice.window.col0)
    walk = cells_of(robot.trail, sight, lattice.cell_m) - corner
    # Somebody may stand where it is: then from where it last stood free.
    free = np.flatnonzero(lattice.coverable[tuple(walk.T)])
    last: tuple[int, int] = tuple(walk[free[-1]].tolist())
    wanted = np.argwhere(reachable(lattice.steps, last) & lattice.coverable)
    places = lattice.centres((wanted + corner).astype(np.int32))
    way = np.array([sight.geometry.to_map(*point) for point in robot.trail])
    swept_by = _first_sweep(places, way, 0.5 * lattice.cell_m)
    first_visits = np.sort(swept_by[swept_by >= 0])
    return Verdict(
        cells=len(wanted),
        missed=len(wanted) - len(first_visits),
        problems=(),
        steps=len(walk) - 1,
        revisits=len(walk) - len(np.unique(walk, axis=0)),
        quarters=robot.quarters,
        reached=_milestones(first_visits, len(wanted), robot.times),
    )


def _milestones(
    first_visits: NDArray[np.int64], cells: int, times: list[float]
) -> tuple[Moment | None, ...]:
    """Return when each share of ``cells`` was visited; ``first_visits`` are steps, in order."""
    needed = [-(-cells * percent // 100) for percent in MILESTONES]
    at = [int(first_visits[count - 1]) if count <= len(first_visits) else None for count in needed]
    return tuple(None if step is None else (times[step], step) for step in at)


def _first_sweep(
    places: NDArray[np.float64], way: NDArray[np.float64], reach: float
) -> NDArray[np.int64]:
    """Return which step first passes within ``reach`` of each place, int64 (n,); -1 for none.

    Args:
        places: points (x, y), float64 (n, 2).
        way: the ends of the steps, float64 (m, 2).
        reach: the tool's.
    """
    swept_by = np.full(len(places), -1)
    for step in range(len(way)):
        start, end = way[max(step - 1, 0)], way[step]
        ahead = end - start
        length2 = float(ahead @ ahead)
        along = (places - start) @ ahead / length2 if length2 else np.zeros(len(places))
        nearest = start + np.clip(along, 0.0, 1.0)[:, np.newaxis] * ahead
        near = np.hypot(*(places - nearest).T) < reach
        swept_by[near & (swept_by < 0)] = step
    return swept_by
