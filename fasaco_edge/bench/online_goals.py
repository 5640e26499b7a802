"""What missions in buildings are to reach; of the goals, those that were measured."""

from __future__ import annotations

from collections.abc import Iterator

from fasaco_edge.bench.benchmark import Goal
from fasaco_edge.bench.online_figures import LARGE_CELLS, Summary, steps_ratio, time_ratio

# Steps to those of the known building, by the share of cells misread: median, worst.
STEPS = {0.0: (1.015, 1.07), 0.05: (1.04, 1.10)}
WORST_LARGE = 1.03
TIME = 1.05
REPLAN_MS, REPLAN_TO_FULL = 10.0, 1 / 20
INGEST_MS = 10.0
KEPT, WAITING = 0.88, 0.001


def goals(summary: Summary, misread: float, *, with_turns: bool) -> Iterator[Goal]:
    """Yield the goals that missions in buildings have something to say on."""
    covered = summary.covered_all
    yield Goal(
        "all reachable cells covered (1 = always)",
        None if covered is None else float(covered),
        1.0,
        at_least=True,
    )
    if with_turns:
        what = "mission time to the same planner's, building known, median"
        yield _goal(what, summary.ratio_median(time_ratio), TIME)
    elif misread in STEPS:
        median, worst = STEPS[misread]
        what = "steps to the near-optimal walk, building known"
        yield _goal(f"{what}, median", summary.ratio_median(steps_ratio), median)
        yield _goal(f"{what}, worst", summary.ratio_worst(steps_ratio), worst)
        large = summary.ratio_worst(steps_ratio, LARGE_CELLS)
        if large is not None and not misread:
            yield _goal(f"{what}, worst from {LARGE_CELLS} cells on", large, WORST_LARGE)
    yield _goal("replan, p99", summary.replan_ms(99), REPLAN_MS, "ms")
    yield _goal("replan p99 to a full plan, median", summary.replan_to_full, REPLAN_TO_FULL)
    yield _goal("map ingest, p99", summary.ingest_ms(99), INGEST_MS, "ms")
    for what, share in (
        ("next 5 m kept at new paths, share", summary.kept),
        ("maps that leave the next 5 m as they were, share", summary.unchanged),
    ):
        yield Goal(what, None if share is None else round(share, 4), KEPT, at_least=True)
    yield _goal("robot waiting, share of time", summary.waiting, WAITING)


def _goal(what: str, measured: float | None, limit: float, unit: str = "") -> Goal:
    return Goal(what, None if measured is None else round(measured, 4), limit, unit)
