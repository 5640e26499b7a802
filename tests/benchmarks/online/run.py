"""What is known of a mission after it: all figures of a report come from these."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from fasaco_edge.drawing.spread import percentile
from fasaco_edge.grid.lattice import Cell
from tests.benchmarks.online.judge import MILESTONES, Moment
from tests.benchmarks.online.mission import Elapsed


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
        building, kind: where.
        cells: that could be reached.
        start, range_m, seed: of the robot.
        ended: the mission's own words for how it was at the end.
        done: whether it said that all is covered.
        missed: cells it could have reached and never was in.
        problems: what is wrong with the trail, and what the mission refused.
        happened: of a case, whether it came to it.
        steps, revisits, quarters: of the trail.
        time_s, waiting_s: of the mission, and how long of it the robot had no way to go [s].
        reference: what it is compared with; None in cases.
        reached: see ``Verdict``.
        plans, paths: how many were asked for, and published.
        held_up: how often the robot stood before an obstacle that its path led into.
        stale_m: way driven on a path that the newest map had blocked further on [m].
        replans, ingests, kept, updates: see ``Watch``.
    """

    building: str
    kind: str
    cells: int
    start: Cell
    range_m: float
    seed: int
    ended: str
    done: bool
    missed: int
    problems: tuple[str, ...]
    happened: bool
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
