"""Tables of missions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

from fasaco_edge.bench.benchmark import Report, ResultTable
from fasaco_edge.host.processes import peak_mb
from tests.benchmarks.online.figures import Summary, goals, steps_ratio, time_ratio
from tests.benchmarks.online.judge import MILESTONES, MissionRun

HEADER = (
    "", "missions,\ncells", "steps\nto known", "time\nto known", "overlap,\nturns",
    "kept,\nsame", "waiting\n[%],\nstale [m]",
)  # fmt: skip
LATENCY_HEADER = (
    "", "replan\np50", "\np99", "\nmax", "p99 to\nfull", "full\nplan", "ingest\np50", "\np99",
)  # fmt: skip
PLANNER_HEADER = (*HEADER[:-1], "replan\np50, p99\n[ms]")
UNTIL_HEADER = ("", *(f"{percent} %:\nsteps,\n[s]" for percent in MILESTONES))

REMARKS = (
    "to known: to the near-optimal walk of a robot that knew the building from the start; the "
    "median over missions, below it the worst. overlap, turns: revisits and quarter-turns a "
    "cell. kept: how much of the next 5 m stayed the same, up to the first change, at each new "
    "path in place of one still valid; same: the share of maps that changed nothing of it. "
    "stale: driven on a path that the newest map had blocked further on.",
    "replan: from the request to the path, but for the first; full plan: of all the building by "
    "the same planner; p99 to full: of a mission, the median. ingest: a step of the mission with "
    "a map, without planning. held up: how often the robot stood before an obstacle that its "
    "path led into.",
    "Every trail was judged, by code that shares nothing with mission and planner: each step "
    "legal in the true building, every reachable cell visited.",
)


def report(*, with_turns: bool, about: dict[str, object], runs: Sequence[MissionRun]) -> Report:
    """Sum up any number of missions, even none; ``about`` says under what conditions.

    Figures and goals are of the planner that comes first; the last table has all of them.
    """
    all_runs = runs
    of_planner = _by_planner(runs)
    runs = next(iter(of_planner.values()), [])
    buildings, groups = Summary(runs), list(_groups(runs))
    further = [
        ResultTable(
            "latency [ms], below it time of processors",
            LATENCY_HEADER,
            tuple(_latency_row(*one) for one in groups),
        ),
        ResultTable(
            "steps and seconds a cell until so much was covered",
            UNTIL_HEADER,
            tuple(_until_row(*one) for one in groups),
        ),
    ]
    if len(of_planner) > 1:
        rows = [_planner_row(name, group) for name, group in of_planner.items()]
        further.append(ResultTable("planners", PLANNER_HEADER, tuple(rows)))
    return Report(
        title=f"{len(buildings.runs)} missions in unknown buildings",
        header=HEADER,
        rows=tuple(_row(*one) for one in groups),
        figures={
            **buildings.document(),
            "conditions": about,
            "planners": {name: Summary(group).document() for name, group in of_planner.items()},
            "runs": [run.document() for run in all_runs],
        },
        goals=tuple(goals(buildings, with_turns=with_turns)),
        remarks=(*REMARKS, *_complaints(all_runs), f"peak memory of this process {peak_mb()} MB"),
        further=tuple(table for table in further if table.rows),
    )


def _by_planner(runs: Sequence[MissionRun]) -> dict[str, list[MissionRun]]:
    names = dict.fromkeys(run.planner for run in runs)
    return {name: [run for run in runs if run.planner == name] for name in names}


def _planner_row(name: str, runs: Sequence[MissionRun]) -> tuple[str, ...]:
    summary = Summary(runs)
    name, missions, *figures, _ = _row(name, summary)
    return name, missions, *figures, _lines(".1f", summary.replan_ms(50), summary.replan_ms(99))


def _by_building(runs: Sequence[MissionRun]) -> list[list[MissionRun]]:
    names = dict.fromkeys(run.building for run in runs)
    return [[run for run in runs if run.building == name] for name in names]


def _groups(buildings: Sequence[MissionRun]) -> Iterator[tuple[str, Summary]]:
    if buildings:
        yield "all buildings", Summary(buildings)
    for group in _by_building(buildings):
        for range_m in dict.fromkeys(run.range_m for run in group):
            chosen = [run for run in group if run.range_m == range_m]
            yield f"{group[0].building}, {range_m:g} m", Summary(chosen)


def _row(name: str, summary: Summary) -> tuple[str, ...]:
    cells = sorted({run.cells for run in summary.runs})
    covered = "" if summary.covered_all else "\nNOT ALL COVERED"
    return (
        f"{name}{covered}",
        f"{len(summary.runs)}\n{cells[0] if len(cells) == 1 else f'{cells[0]}-{cells[-1]}'}",
        _lines(".4f", summary.ratio_median(steps_ratio), summary.ratio_worst(steps_ratio)),
        _lines(".3f", summary.ratio_median(time_ratio), summary.ratio_worst(time_ratio)),
        _lines(".3f", summary.overlap, summary.quarters),
        _lines(".3f", summary.kept, summary.unchanged),
        f"{_percent(summary.waiting)}\n{summary.stale_m:.1f}",
    )


def _latency_row(name: str, summary: Summary) -> tuple[str, ...]:
    return (
        name,
        *(_both(partial(summary.replan_ms, percent)) for percent in (50, 99, 100)),
        _lines(".3f", summary.replan_to_full),
        _both(summary.full_plan_ms),
        *(_both(partial(summary.ingest_ms, percent)) for percent in (50, 99)),
    )


def _until_row(name: str, summary: Summary) -> tuple[str, ...]:
    until = [(summary.steps_until(at), summary.seconds_until(at)) for at in MILESTONES]
    return name, *(_lines(".3f", *moment) for moment in until)


def _complaints(runs: Sequence[MissionRun]) -> Iterator[str]:
    """Yield what is wrong with missions, one by one."""
    for run in runs:
        about = f"{run.building}, start {run.start}, {run.range_m:g} m, seed {run.seed}"
        if not run.done:
            yield f"{about}: ended with {run.ended}; {run.missed} cells missed"
        elif run.missed:
            yield f"{about}: said to be done, {run.missed} cells missed"
        if run.problems:
            yield f"{about}: {'; '.join(run.problems[:3])}"


def _both(figure: Callable[..., float | None]) -> str:
    """Return a time by the clock, and below it that of processors."""
    return _lines(".1f", figure(cpu=False), figure(cpu=True))


def _lines(style: str, *values: float | None) -> str:
    return "\n".join("-" if value is None else f"{value:{style}}" for value in values)


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100.0 * share:.2f}"
