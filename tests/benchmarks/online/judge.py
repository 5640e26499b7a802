"""Figures of a mission: its driven path, judged on the true map, and the part that it saw."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bench.spread import percentile
from fasaco_edge.grid.lattice import Cell
from tests.benchmarks.judge import check_walk
from tests.benchmarks.online.mission import Elapsed, OnlineMission
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
        revisits: visits of cells after each one's first.
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
    """Judge a mission that is over: each step of its trail is to be one of the true lattice."""
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


def _milestones(
    first_visits: NDArray[np.int64], cells: int, times: list[float]
) -> tuple[Moment | None, ...]:
    """Return when each share of ``cells`` was visited; ``first_visits`` are steps, in order."""
    needed = [-(-cells * percent // 100) for percent in MILESTONES]
    at = [int(first_visits[count - 1]) if count <= len(first_visits) else None for count in needed]
    return tuple(None if step is None else (times[step], step) for step in at)


@dataclass(frozen=True, slots=True)
class Reference:
    """A robot that knew the building.

    Attributes:
        steps, time_s: of its near-optimal walk.
        full_plan: how long the mission's planner takes for all of the building.
    """

    steps: int
    time_s: float
    full_plan: Elapsed


@dataclass(frozen=True, slots=True)
class MissionRun:
    """One mission.

    Attributes:
        building: where.
        cells: that could be reached.
        start, range_m, seed: of the robot.
        ended: the mission's own words for how it was at the end.
        done: whether it said that all is covered.
        missed: cells it could have reached and never was in.
        problems: what is wrong with the trail, and what the mission refused.
        steps, revisits, quarters: of the trail.
        time_s, waiting_s: of the mission, and how long of it the robot had no way to go [s].
        reference: what it is compared with; None for none.
        reached: see ``Verdict``.
        plans, paths: how many were asked for, and published.
        held_up: how often the robot stood before an obstacle that its path led into.
        stale_m: way driven on a path that the newest map had blocked further on [m].
        replans, ingests, kept, updates: see ``Watch``.
        planner: one of ``contenders.CONTENDERS``.
    """

    building: str
    cells: int
    start: Cell
    range_m: float
    seed: int
    ended: str
    done: bool
    missed: int
    problems: tuple[str, ...]
    steps: int
    revisits: int
    quarters: float
    time_s: float
    waiting_s: float
    reference: Reference | None
    reached: tuple[Moment | None, ...]
    plans: int
    paths: int
    held_up: int
    stale_m: float
    replans: tuple[Elapsed, ...]
    ingests: tuple[Elapsed, ...]
    kept: tuple[float, ...]
    updates: tuple[bool, ...]
    planner: str

    @property
    def covered_all(self) -> bool:
        """Whether every cell that could be reached was, and by legal steps."""
        return self.done and self.missed == 0 and not self.problems

    @property
    def steps_ratio(self) -> float:
        """Steps to those of the reference; NaN without one."""
        return self.steps / self.reference.steps if self.reference else math.nan

    @property
    def time_ratio(self) -> float:
        """Time to that of the reference; NaN without one."""
        return self.time_s / self.reference.time_s if self.reference else math.nan

    def document(self) -> dict[str, Any]:
        """Return this as JSON values."""
        document = asdict(self)
        for name in ("replans", "ingests", "kept", "updates"):
            del document[name]
        for name, times in (("replan", self.replans), ("ingest", self.ingests)):
            for percent in (50, 99, 100):
                walls = [elapsed.wall_ms for elapsed in times]
                document[f"{name}_ms_p{percent}"] = percentile(walls, percent)
        document["kept_share"] = sum(self.kept) / len(self.kept) if self.kept else None
        named = zip(MILESTONES, self.reached, strict=True)
        document["reached"] = {str(percent): moment for percent, moment in named}
        return {**document, "covered_all": self.covered_all}
