"""Pictures of benchmarks: walks side by side on one sheet, and a colony's pheromone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from fasaco_edge.drawing import palette
from fasaco_edge.drawing.pictures import draw_driven
from fasaco_edge.drawing.plot import Plot, PlotView
from fasaco_edge.drawing.sheet import LINE_PX, TEXT_PX, KeyEntry, Sheet, font_of, wrapped
from fasaco_edge.drawing.tints import draw_visits, visits_of
from fasaco_edge.grid.geometry import Bounds
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.planners.planner import ColonySnapshot

PANEL_PX = 500
GAP_PX = 24
COLUMNS = 2

TIMES = ("2 times", "3 times", "4 times or more")


@dataclass(frozen=True, slots=True, eq=False)
class LabelledWalk:
    """A walk over a lattice, int32 (n, 2) as in ``draw_walk``, and two lines to stand over it."""

    label: str
    caption: str
    lattice: CoverageLattice
    cells: NDArray[np.int32]


def draw_walks(
    walks: Sequence[LabelledWalk], *, title: str, lines: Sequence[str], columns: int = COLUMNS
) -> Image.Image:
    """Return a picture, RGB, of walks, at least one, at one scale.

    Args:
        walks: what to show, to the right first, then down; all in cells of one size.
        title: heading.
        lines: caption below it.
        columns: most walks in a row.
    """
    cell_m = walks[0].lattice.cell_m
    centres = np.concatenate([walk.lattice.centres(walk.cells) for walk in walks])
    view = PlotView.over(bounds_around(centres, cell_m), cell_m, PANEL_PX, PANEL_PX)
    panels = _arranged([_panel(view, walk) for walk in walks], columns)
    scale = view.scale * cell_m
    sheet = Sheet(title, lines, _key(walks), ("start", "end"), scale, unit="cells")
    return sheet.around(panels)


def _key(walks: Sequence[LabelledWalk]) -> tuple[KeyEntry, ...]:
    closed = all((walk.cells[0] == walk.cells[-1]).all() for walk in walks)
    return (
        KeyEntry("disc", palette.START, "start and end" if closed else "start"),
        *(() if closed else (KeyEntry("square", palette.END, "end"),)),
        KeyEntry("tile", palette.COVERED, "covered once"),
        *(
            KeyEntry("tile", colour, times)
            for colour, times in zip(palette.REVISITED, TIMES, strict=True)
        ),
    )


def _panel(view: PlotView, walk: LabelledWalk) -> Image.Image:
    plot = Plot(view)
    plot.ground(walk.lattice)
    lattice, cells = walk.lattice, walk.cells
    draw_visits(plot, lattice, visits_of(lattice, cells), tuple(cells[0].tolist()))
    draw_driven(plot, lattice.centres(cells), None, lattice.cell_m)
    return _headed(plot.finished(), walk.label, walk.caption)


def _headed(plot: Image.Image, label: str, caption: str) -> Image.Image:
    """Return ``plot``, RGB, with a label and a caption over it: one of several on a sheet."""
    lines = [(line, palette.INK) for line in wrapped([label], TEXT_PX, plot.width)]
    lines += [(line, palette.FAINT_INK) for line in wrapped([caption], TEXT_PX, plot.width)]
    panel = Image.new("RGB", (plot.width, plot.height + len(lines) * LINE_PX), palette.PAPER)
    draw = ImageDraw.Draw(panel)
    for row, (line, colour) in enumerate(lines):
        draw.text((0, row * LINE_PX), line, colour, font_of(TEXT_PX))
    panel.paste(plot, (0, panel.height - plot.height))
    return panel


def _arranged(panels: Sequence[Image.Image], columns: int) -> Image.Image:
    width, height = max(p.width for p in panels), max(p.height for p in panels)
    columns = min(columns, len(panels))
    rows = -(-len(panels) // columns)
    size = (columns * (width + GAP_PX) - GAP_PX, rows * (height + GAP_PX) - GAP_PX)
    together = Image.new("RGB", size, palette.PAPER)
    for index, panel in enumerate(panels):
        row, column = divmod(index, columns)
        # Against the row's lower edge: a longer caption must not move a map.
        below = height - panel.height
        together.paste(panel, (column * (width + GAP_PX), row * (height + GAP_PX) + below))
    return together


FIELD_PX = 640


def draw_pheromone(
    lattice: CoverageLattice, snapshot: ColonySnapshot, *, title: str, lines: Sequence[str]
) -> Image.Image:
    """Return a picture, RGB, of the mean pheromone on the moves into each cell.

    Args:
        lattice: the planning grid the colony walked on.
        snapshot: the colony after a cohort, over the lattice's window; of two cells or more.
        title: heading.
        lines: caption below it.
    """
    # Cells no ant can step into have no moves, hence no pheromone.
    walked = snapshot.trail > 0.0
    trail = snapshot.trail.astype(np.float64)
    low, high = float(trail[walked].min()), float(trail[walked].max())
    fractions = (trail[walked] - low) / max(high - low, np.finfo(np.float64).tiny)
    colours = np.full((*trail.shape, 3), palette.PAPER, np.uint8)
    colours[walked] = palette.gradient(fractions)
    corner = np.array((snapshot.window.row0, snapshot.window.col0))
    centres = lattice.centres((np.argwhere(walked) + corner).astype(np.int32))
    bounds = bounds_around(centres, lattice.cell_m)
    plot = Plot(PlotView.over(bounds, lattice.cell_m, FIELD_PX, FIELD_PX))
    plot.ground(lattice)
    plot.tint(lattice, colours)
    bar = (f"{low:.3f}", f"{high:.3f}")
    scale = plot.view.scale * lattice.cell_m
    return Sheet(title, lines, (), bar, scale, unit="cells").around(plot.finished())


def bounds_around(centres: NDArray[np.float64], cell_m: float) -> Bounds:
    """Return the bounds of cells, n >= 1, by their centres [m], float64 (n, 2)."""
    x0, y0 = (centres.min(axis=0) - cell_m / 2).tolist()
    x1, y1 = (centres.max(axis=0) + cell_m / 2).tolist()
    return x0, y0, x1, y1
