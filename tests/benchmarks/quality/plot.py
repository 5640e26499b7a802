"""Ratios over budgets, a panel for each grid and kind of problem."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from PIL import Image

from fasaco_edge.drawing.spread import Spread
from tests.benchmarks.chart import COLOURS, LINE_PX, Axis, Line, Panel, draw_panels
from tests.benchmarks.quality.figures import (
    MISSION_TURN_S,
    MOST_STEPS,
    MOST_TIME,
    VARIANTS,
    GridFigures,
    by_grid,
)
from tests.benchmarks.quality.runs import QualityRun

COLUMNS = 3


def draw(runs: Sequence[QualityRun], turn_s: float) -> Image.Image:
    """Return a picture, RGB, of runs, one at least."""
    figures = by_grid(runs)
    panels: list[Panel | None] = []
    for kind in dict.fromkeys(map(_kind, figures)):
        mine = [grid for grid in figures if _kind(grid) == kind]
        panels += _panels(mine, turn_s)
        # Each kind of problem begins in a row of its own.
        panels += [None] * (-len(panels) % COLUMNS)
    captions = [
        "Steps, or time where turns have a price, above the best known [%]: medians over "
        f"{max(len(grid.runs) for grid in figures)} seeds,",
        "pale: from the best seed to the worst; dashes: goals, those of time in the median over "
        "grids.",
    ]
    return draw_panels("What a budget buys", captions, panels, COLUMNS)


def _kind(grid: GridFigures) -> tuple[str, str, bool]:
    """Return what panels of the same scale have in common: end, cost, and having a rival.

    Walks that have but a lower bound to be measured by would flatten all the others.
    """
    known, setting = grid.known, grid.setting
    rival = bool(known.walks) if setting.counts_turns else known.best_steps is not None
    return setting.end, setting.cost, rival


def _panels(figures: Sequence[GridFigures], turn_s: float) -> Iterator[Panel]:
    """Yield a panel for each grid, all of the same scale, of runs of one kind."""
    above = {id(grid): _above(grid, turn_s) for grid in figures}
    grids = list(dict.fromkeys(grid.grid for grid in figures))
    variants = list(dict.fromkeys(grid.setting.variant for grid in figures))
    goals = {name: tuple(_goals(figures, name, turn_s)) for name in grids}
    x = Axis.marked("budget [s]", [grid.budget_s for grid in figures])
    seen = [value for spread in above.values() for value in (spread.low, spread.high)]
    y = Axis.linear("%", seen + [goal for marks in goals.values() for _, goal in marks])
    for name in grids:
        mine = [grid for grid in figures if grid.grid == name]
        lines: list[Line] = []
        for index, variant in enumerate(variants):
            found = [(grid.budget_s, above[id(grid)]) for grid in mine if _is(grid, variant)]
            label = VARIANTS[variant] if len(variants) > 1 and name == grids[0] else ""
            band = [(at, spread.low, spread.high) for at, spread in found if len(variants) == 1]
            medians = tuple((at, spread.median) for at, spread in found)
            # Where lines meet, those below look out from under those above.
            width = LINE_PX * (1.0 + 2.0 * index)
            lines.append(Line(label, COLOURS[index], medians, tuple(band), width=width))
        yield Panel(name, _caption(mine[0], turn_s), x, y, tuple(lines), goals[name])


def _is(grid: GridFigures, variant: str) -> bool:
    return grid.setting.variant == variant


def _above(grid: GridFigures, turn_s: float) -> Spread:
    ratio = grid.mission_ratio(turn_s) if grid.setting.counts_turns else grid.ratio
    return Spread(*(100.0 * (part - 1.0) for part in (ratio.median, ratio.low, ratio.high)))


def _goals(
    figures: Sequence[GridFigures], name: str, turn_s: float
) -> Iterator[tuple[float, float]]:
    """Yield the budgets [s] that there are goals for on a grid, and the goals [%]."""
    mine = [grid for grid in figures if grid.grid == name]
    end, cost, rival = _kind(mine[0])
    if end == "home" or not rival or (cost == "turns" and turn_s != MISSION_TURN_S):
        return
    most = MOST_TIME if cost == "turns" else MOST_STEPS
    for budget_s in {grid.budget_s for grid in mine} & most.keys():
        yield budget_s, 100.0 * (most[budget_s] - 1.0)


def _caption(grid: GridFigures, turn_s: float) -> str:
    known, cells = grid.known, f"{grid.runs[0].cells:,} cells"
    home = ", home again" if grid.setting.closed else ""
    if grid.setting.counts_turns:
        quickest = known.quickest(turn_s)
        by = f"best: {quickest.planner}" if quickest else "above the lower bound"
        return f"steps and turns{home}; {cells}; {by}"
    if known.best_steps is None:
        return f"steps{home}; {cells}; above the bound, {grid.runs[0].bound:,}"
    what = "best known" if known.optimum is None else "optimum"
    return f"steps{home}; {cells}; {what} {known.best_steps:,}"
