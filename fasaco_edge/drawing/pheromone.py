"""A picture of the pheromone that a colony has laid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import Image

from fasaco_edge.drawing import palette
from fasaco_edge.drawing.plot import Plot
from fasaco_edge.drawing.sheet import Sheet
from fasaco_edge.drawing.view import View, bounds_around
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.planners.planner import ColonySnapshot

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
    plot = Plot(View.over(bounds, lattice.cell_m, FIELD_PX, FIELD_PX))
    plot.ground(lattice)
    plot.tint(lattice, colours)
    bar = (f"{low:.3f}", f"{high:.3f}")
    scale = plot.view.scale * lattice.cell_m
    return Sheet(title, lines, (), bar, scale, unit="cells").around(plot.finished())
