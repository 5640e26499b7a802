"""Tables and charts of runs on buildings of several sizes, with the exponents of growth."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

from PIL import Image

from fasaco_edge.bench.benchmark import Goal, Report
from fasaco_edge.drawing.spread import Spread
from tests.benchmarks.chart import COLOURS, Axis, Line, Panel, draw_panels
from tests.benchmarks.scale.process import TARGETS, ScaleRun, SizedRun

MOST_GROWTH = 1.1
# By size.
MOST_FIRST_WALK_S = {5_000: 0.005, 1_000_000: 2.0}
MOST_GAP = {100_000: (0.03, 5.0), 1_000_000: (0.04, 60.0)}
MOST_MEMORY_MB = {100_000: 300.0, 1_000_000: 1500.0}

HEADER = (
    "cells", "budget\n[s]", "first\n[ms]", *(f"to {100 * target:g} %\n[s]" for target in TARGETS),
    "gap\n[%]", "memory\n[MB]", "own\n[MB]", "perturb-\nations", "tried\n[10^6]",
)  # fmt: skip


@dataclass(frozen=True)
class Size:
    """The runs on buildings of one size; one at least."""

    size: int
    runs: tuple[ScaleRun, ...]

    def spread(self, figure: Callable[[ScaleRun], float]) -> Spread:
        """Return the spread of a figure over the seeds."""
        spread = Spread.of([figure(run) for run in self.runs])
        assert spread is not None
        return spread

    def reached_s(self, target: float) -> Spread | None:
        """Return when a gap was reached [s]; None if not by all."""
        times = [dict(run.target_s)[target] for run in self.runs]
        reached = [at for at in times if at is not None]
        return Spread.of(reached) if len(reached) == len(times) else None

    def gap_within(self, seconds: float) -> float | None:
        """Return the median gap after so long; None if the budget was less."""
        if min(run.budget_s for run in self.runs) < seconds:
            return None
        return self.spread(lambda run: _gap_at(run, seconds)).median

    def document(self) -> dict[str, Any]:
        """Return this as JSON values."""
        reached = {f"{target:g}": self.reached_s(target) for target in TARGETS}
        figures: dict[str, Callable[[ScaleRun], float]] = {
            "cells": lambda run: run.cells,
            "first_walk_s": lambda run: run.first_walk_s,
            "gap": lambda run: run.gap,
            "wall_s": lambda run: run.wall_s,
            "peak_mb": lambda run: run.peak_mb,
            "idle_mb": lambda run: run.idle_mb,
            "own_mb": lambda run: run.own_mb,
        }
        return {
            "size": self.size,
            "budget_s": self.runs[0].budget_s,
            "seeds": len(self.runs),
            **{name: self.spread(figure).document() for name, figure in figures.items()},
            "gap_reached_s": {gap: at and at.document() for gap, at in reached.items()},
            "runs": [asdict(run) for run in self.runs],
        }


def _gap_at(run: ScaleRun, seconds: float) -> float:
    """Return the gap after so long; without a walk until then it is endless."""
    return min((gap for at, gap in run.noted if at <= seconds), default=math.inf)


def by_size(runs: Sequence[SizedRun]) -> tuple[Size, ...]:
    """Return the runs, put together size by size."""
    sizes = sorted({run.size for run in runs})
    return tuple(Size(size, tuple(one.run for one in runs if one.size == size)) for size in sizes)


def exponent(points: Sequence[tuple[float, float]]) -> float | None:
    """Return b of the y = a x^b that fits points (x, y) best, by least squares of logarithms.

    None where there are not two different x above zero, with y above zero.
    """
    logs = [(math.log(x), math.log(y)) for x, y in points if x > 0.0 and y > 0.0]
    if len({x for x, _ in logs}) < 2:
        return None
    return statistics.linear_regression(*zip(*logs, strict=True)).slope


def growth(runs: Sequence[SizedRun]) -> dict[str, float | None]:
    """Return the exponents of the time to the first walk and of own memory against cells.

    None for a single size: its buildings differ by chance alone.
    """
    fitted = runs if len({one.size for one in runs}) > 1 else ()
    return {
        name: exponent([(one.run.cells, getattr(one.run, name)) for one in fitted])
        for name in ("first_walk_s", "own_mb")
    }


def report(seeds: int, runs: Sequence[SizedRun]) -> Report:
    """Sum up any number of runs, even none."""
    sizes = by_size(runs)
    exponents = growth(runs)
    return Report(
        title=f"buildings of several sizes, {seeds} seeds, one thread",
        header=HEADER,
        rows=tuple(_row(size) for size in sizes),
        figures={
            "seeds": seeds,
            "sizes": [size.document() for size in sizes],
            "exponents": exponents,
        },
        goals=tuple(_goals(sizes, exponents)),
        remarks=tuple(_remarks(exponents)),
    )


def _row(size: Size) -> tuple[str, ...]:
    return (
        f"{size.size:,}",
        f"{size.runs[0].budget_s:g}",
        _two(size.spread(lambda run: 1e3 * run.first_walk_s), ".3g"),
        *(_two(size.reached_s(target), ".3g") for target in TARGETS),
        _two(size.spread(lambda run: 100.0 * run.gap), ".2f"),
        _two(size.spread(lambda run: run.peak_mb), ".0f"),
        _two(size.spread(lambda run: run.own_mb), ".1f"),
        _two(size.spread(lambda run: run.work["perturbations"]), ".0f"),
        _two(size.spread(lambda run: run.work["proposals"] / 1e6), ".0f"),
    )


def _two(spread: Spread | None, style: str) -> str:
    """Return the median, and below it the most."""
    return "-" if spread is None else f"{spread.median:{style}}\n{spread.high:{style}}"


def _goals(sizes: Sequence[Size], exponents: dict[str, float | None]) -> Iterator[Goal]:
    """Yield the goals that were measured."""
    for size in sizes:
        cells = f"{size.size:,} cells"
        if size.size in MOST_FIRST_WALK_S:
            first_s = size.spread(lambda run: run.first_walk_s).median
            yield Goal(f"{cells}: first walk", first_s, MOST_FIRST_WALK_S[size.size], "s")
        if size.size in MOST_GAP:
            most, seconds = MOST_GAP[size.size]
            gap = size.gap_within(seconds)
            if gap is not None:
                yield Goal(f"{cells}: gap within {seconds:g} s", 100.0 * gap, 100.0 * most, "%")
        if size.size in MOST_MEMORY_MB:
            peak = size.spread(lambda run: run.peak_mb).median
            yield Goal(f"{cells}: memory", peak, MOST_MEMORY_MB[size.size], "MB")
    for name, what in (("first_walk_s", "time to first walk"), ("own_mb", "own memory")):
        if exponents[name] is not None:
            yield Goal(f"growth of {what}: exponent", exponents[name], MOST_GROWTH)


def _remarks(exponents: dict[str, float | None]) -> Iterator[str]:
    yield (
        "Above the median over the seeds, below the most. first: from the call to the first "
        "complete walk. to 5 %: until the walk is proven to be that near to the shortest; - where "
        "not all came there. memory: the most the process was resident with, interpreter and "
        "kernels included; own: above what it had before there was a map. tried: moves proposed."
    )
    yield "Every walk was judged legal and complete by code that shares nothing with the planner."
    time_growth, memory_growth = exponents["first_walk_s"], exponents["own_mb"]
    if time_growth is not None and memory_growth is not None:
        yield (
            f"time to the first walk grows with cells to the power of {time_growth:.2f}, own "
            f"memory to that of {memory_growth:.2f}"
        )


COLUMNS = 2


def draw(runs: Sequence[SizedRun]) -> Image.Image:
    """Return a picture, RGB, of runs, one at least."""
    sizes, exponents = by_size(runs), growth(runs)
    measured = {size.size for size in sizes}
    cells = Axis.decades("cells", [size.size for size in sizes])
    panels = (
        _over_cells(
            "Time to the first complete walk",
            _grows(exponents["first_walk_s"]),
            cells,
            "ms",
            (_line(sizes, "", 0, lambda run: 1e3 * run.first_walk_s),),
            {at: 1e3 * limit for at, limit in MOST_FIRST_WALK_S.items() if at in measured},
        ),
        _over_cells(
            "Peak memory",
            f"own: {_grows(exponents['own_mb'])}",
            cells,
            "MB",
            (
                _line(sizes, "the process", 0, lambda run: run.peak_mb),
                _line(sizes, "own", 1, lambda run: max(run.own_mb, 0.1)),
            ),
            {at: limit for at, limit in MOST_MEMORY_MB.items() if at in measured},
        ),
        _over_cells(
            "Time to a gap",
            "of the runs that came there",
            cells,
            "s",
            tuple(
                _line(sizes, f"{100 * target:g} %", index, partial(_reached, target=target))
                for index, target in enumerate(TARGETS)
            ),
            {},
        ),
        _gap_over_time(sizes),
    )
    seeds = max(len(size.runs) for size in sizes)
    captions = [f"Dots are runs, {seeds} of each size, lines their medians; dashes: goals."]
    shown = [panel for panel in panels if any(line.points for line in panel.lines)]
    return draw_panels("Growth with the size of the building", captions, shown, COLUMNS)


def _grows(exponent: float | None) -> str:
    return "one size only" if exponent is None else f"grows with cells^{exponent:.2f}"


def _reached(run: ScaleRun, target: float) -> float | None:
    return dict(run.target_s)[target]


def _line(
    sizes: Sequence[Size], label: str, index: int, figure: Callable[[ScaleRun], float | None]
) -> tuple[Line, Line]:
    """Return the line through the medians, and a dot for each run."""
    found = [
        [(float(run.cells), value) for run in size.runs if (value := figure(run)) is not None]
        for size in sizes
    ]
    medians = tuple(
        (statistics.median(x for x, _ in dots), statistics.median(y for _, y in dots))
        for dots in found
        if dots
    )
    runs = tuple(dot for dots in found for dot in dots)
    colour = COLOURS[index]
    return Line(label, colour, medians, dotted=False), Line("", colour, runs, joined=False)


def _over_cells(
    title: str,
    caption: str,
    cells: Axis,
    unit: str,
    pairs: Sequence[tuple[Line, Line]],
    goals: dict[int, float],
) -> Panel:
    lines = tuple(line for pair in pairs for line in pair)
    marks = tuple(goals.items())
    values = [y for line in lines for _, y in line.points]
    y = Axis.decades(unit, [*values, *(limit for _, limit in marks)] or [1.0])
    return Panel(title, caption, cells, y, lines, marks)


def _gap_over_time(sizes: Sequence[Size]) -> Panel:
    """Return a panel of how the gap falls, a line for each size's first seed."""
    firsts = [size.runs[0] for size in sizes]
    lines = tuple(
        Line(
            f"{size.size:,} cells",
            COLOURS[index % len(COLOURS)],
            tuple((at, 100.0 * gap) for at, gap in size.runs[0].noted if gap > 0.0),
            dotted=False,
        )
        for index, size in enumerate(sizes)
    )
    times = [at for run in firsts for at, _ in run.noted]
    gaps = [y for line in lines for _, y in line.points] or [1.0]
    goals = {size: goal for size, goal in MOST_GAP.items() if size in {s.size for s in sizes}}
    marks = tuple((seconds, 100.0 * most) for most, seconds in goals.values())
    x = Axis.decades("seconds", [*times, *(at for at, _ in marks)])
    y = Axis.decades("%", [*gaps, *(gap for _, gap in marks)])
    return Panel("Gap to the lower bound", "a search of each size, over time", x, y, lines, marks)
