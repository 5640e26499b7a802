"""Figures of several missions (medians and worst values), and the goals for them."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from fasaco_edge.bench.benchmark import MeasuredGoal
from fasaco_edge.bench.spread import percentile
from tests.benchmarks.online.judge import MILESTONES, MissionRun
from tests.benchmarks.online.mission import Elapsed

# From so many cells on, the worst of all missions has a stricter goal.
LARGE_CELLS = 900


@dataclass(frozen=True, slots=True)
class Summary:
    """Some missions; every figure is None where there is nothing to take it from."""

    runs: Sequence[MissionRun]

    @property
    def covered_all(self) -> bool | None:
        """Whether each covered all, by legal steps."""
        return all(run.covered_all for run in self.runs) if self.runs else None

    def ratio_median(self, ratio: Callable[[MissionRun], float]) -> float | None:
        """Return the median of a ratio to the reference."""
        return _median(ratio(run) for run in self.runs if run.reference)

    def ratio_worst(
        self, ratio: Callable[[MissionRun], float], least_cells: int = 0
    ) -> float | None:
        """Return the worst ratio to the reference, of buildings with so many cells."""
        ratios = [ratio(run) for run in self.runs if run.reference and run.cells >= least_cells]
        return max(ratios, default=None)

    @property
    def overlap(self) -> float | None:
        """Revisits a cell, median."""
        return _median(run.revisits / run.cells for run in self.runs)

    @property
    def quarters(self) -> float | None:
        """Quarter-turns a cell, median."""
        return _median(run.quarters / run.cells for run in self.runs)

    @property
    def kept(self) -> float | None:
        """Share of the next metres kept at new paths: mean of a mission, median of these."""
        return _median(statistics.fmean(run.kept) for run in self.runs if run.kept)

    @property
    def unchanged(self) -> float | None:
        """Share of maps that changed nothing of the next metres, median of missions."""
        return _median(sum(run.updates) / len(run.updates) for run in self.runs if run.updates)

    def replan_ms(self, percent: float, *, cpu: bool = False) -> float | None:
        """Return a percentile of all replans, by the clock or of processors [ms]."""
        return percentile([_ms(one, cpu) for run in self.runs for one in run.replans], percent)

    def ingest_ms(self, percent: float, *, cpu: bool = False) -> float | None:
        """Return a percentile of all steps with a map, by the clock or of processors [ms]."""
        return percentile([_ms(one, cpu) for run in self.runs for one in run.ingests], percent)

    def full_plan_ms(self, *, cpu: bool = False) -> float | None:
        """Time of a full plan, by the clock or of processors, median [ms]."""
        return _median(_ms(run.reference.full_plan, cpu) for run in self.runs if run.reference)

    @property
    def replan_to_full(self) -> float | None:
        """A mission's 99th percentile of replans to a full plan, median."""
        walls = [
            (percentile([one.wall_ms for one in run.replans], 99), run.reference)
            for run in self.runs
        ]
        return _median(
            slow_ms / reference.full_plan.wall_ms
            for slow_ms, reference in walls
            if slow_ms is not None and reference is not None
        )

    @property
    def waiting(self) -> float | None:
        """Share of all time that robots had no way to go."""
        time_s = sum(run.time_s for run in self.runs)
        return sum(run.waiting_s for run in self.runs) / time_s if time_s else None

    @property
    def stale_m(self) -> float:
        """Way driven on paths that were blocked further on, all in all [m]."""
        return sum(run.stale_m for run in self.runs)

    def steps_until(self, percent: int) -> float | None:
        """Return steps a cell until so much was covered, median of those that came to it."""
        return self._until(percent, lambda moment: moment[1])

    def seconds_until(self, percent: int) -> float | None:
        """Return seconds a cell until so much was covered, median of those that came to it."""
        return self._until(percent, lambda moment: moment[0])

    def _until(self, percent: int, of: Callable[[tuple[float, int]], float]) -> float | None:
        moments = [(run.reached[MILESTONES.index(percent)], run.cells) for run in self.runs]
        return _median(of(moment) / cells for moment, cells in moments if moment is not None)

    def document(self) -> dict[str, Any]:
        """Return this as JSON values."""
        figures = {
            "steps_ratio_median": self.ratio_median(steps_ratio),
            "steps_ratio_worst": self.ratio_worst(steps_ratio),
            "steps_ratio_worst_large": self.ratio_worst(steps_ratio, LARGE_CELLS),
            "time_ratio_median": self.ratio_median(time_ratio),
            "time_ratio_worst": self.ratio_worst(time_ratio),
            "overlap_median": self.overlap,
            "quarter_turns_per_cell_median": self.quarters,
            "replan_ms_p50": self.replan_ms(50),
            "replan_ms_p99": self.replan_ms(99),
            "replan_ms_max": self.replan_ms(100),
            "full_plan_ms": self.full_plan_ms(),
            "replan_p99_to_full_plan": self.replan_to_full,
            "ingest_ms_p50": self.ingest_ms(50),
            "ingest_ms_p99": self.ingest_ms(99),
            "replan_cpu_ms_p50": self.replan_ms(50, cpu=True),
            "replan_cpu_ms_p99": self.replan_ms(99, cpu=True),
            "full_plan_cpu_ms": self.full_plan_ms(cpu=True),
            "ingest_cpu_ms_p99": self.ingest_ms(99, cpu=True),
            "kept_share": self.kept,
            "unchanged_share": self.unchanged,
            "waiting_share": self.waiting,
            "stale_m": self.stale_m,
            **{f"steps_per_cell_to_{p}": self.steps_until(p) for p in MILESTONES},
            **{f"seconds_per_cell_to_{p}": self.seconds_until(p) for p in MILESTONES},
        }
        rounded = {n: None if v is None else round(v, 6) for n, v in figures.items()}
        return {"missions": len(self.runs), "covered_all": self.covered_all, **rounded}


def steps_ratio(run: MissionRun) -> float:
    """Return a mission's steps to those of its reference."""
    return run.steps_ratio


def time_ratio(run: MissionRun) -> float:
    """Return a mission's time to that of its reference."""
    return run.time_ratio


def _ms(elapsed: Elapsed, cpu: bool) -> float:
    return elapsed.cpu_ms if cpu else elapsed.wall_ms


def _median(values: Iterable[float]) -> float | None:
    found = list(values)
    return statistics.median(found) if found else None


# Goals for the steps, relative to those in the known building.
STEPS_MEDIAN, STEPS_WORST = 1.015, 1.07
# The worst of large buildings.
WORST_LARGE = 1.03
TIME = 1.05
REPLAN_MS, REPLAN_TO_FULL = 10.0, 1 / 20
INGEST_MS = 10.0
KEPT, WAITING = 0.88, 0.001


def goals(summary: Summary, *, with_turns: bool) -> Iterator[MeasuredGoal]:
    """Yield the goals that missions in buildings have something to say on."""
    covered = summary.covered_all
    yield MeasuredGoal(
        "all reachable cells covered (1 = always)",
        None if covered is None else float(covered),
        1.0,
        at_least=True,
    )
    if with_turns:
        what = "mission time to the same planner's, building known, median"
        yield _goal(what, summary.ratio_median(time_ratio), TIME)
    else:
        what = "steps to the near-optimal walk, building known"
        yield _goal(f"{what}, median", summary.ratio_median(steps_ratio), STEPS_MEDIAN)
        yield _goal(f"{what}, worst", summary.ratio_worst(steps_ratio), STEPS_WORST)
        large = summary.ratio_worst(steps_ratio, LARGE_CELLS)
        if large is not None:
            yield _goal(f"{what}, worst from {LARGE_CELLS} cells on", large, WORST_LARGE)
    yield _goal("replan, p99", summary.replan_ms(99), REPLAN_MS, "ms")
    yield _goal("replan p99 to a full plan, median", summary.replan_to_full, REPLAN_TO_FULL)
    yield _goal("map ingest, p99", summary.ingest_ms(99), INGEST_MS, "ms")
    for what, share in (
        ("next 5 m kept at new paths, share", summary.kept),
        ("maps that leave the next 5 m as they were, share", summary.unchanged),
    ):
        yield MeasuredGoal(what, None if share is None else round(share, 4), KEPT, at_least=True)
    yield _goal("robot waiting, share of time", summary.waiting, WAITING)


def _goal(what: str, measured: float | None, limit: float, unit: str = "") -> MeasuredGoal:
    return MeasuredGoal(what, None if measured is None else round(measured, 4), limit, unit)
