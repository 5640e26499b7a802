"""Time, memory and gap over size, and the gap over time."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from functools import partial

from PIL import Image

from fasaco_edge.drawing.chart import COLOURS, Axis, Line, Panel, draw_panels
from tests.benchmarks.scale.process import TARGETS, ScaleRun
from tests.benchmarks.scale.report import (
    MOST_FIRST_WALK_S,
    MOST_GAP,
    MOST_MEMORY_MB,
    Size,
    by_size,
    growth,
)
from tests.benchmarks.scale.runs import SizedRun

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
