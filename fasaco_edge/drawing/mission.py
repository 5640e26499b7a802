"""A picture of a whole mission: what was covered, and how the robot drove."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fasaco_edge.drawing.plot import Plot
from fasaco_edge.drawing.sheet import Sheet
from fasaco_edge.drawing.view import MAX_HEIGHT, MAX_WIDTH, View, bounds_of
from fasaco_edge.drawing.visits import draw_visits
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid

# In cells.
LINE_WIDTH = 0.12


def draw_mission(
    grid: OccupancyGrid,
    lattice: CoverageLattice,
    driven_xy: NDArray[np.float64],
    visits: NDArray[np.uint16],
    *,
    title: str,
    lines: Sequence[str],
    room: tuple[int, int] = (MAX_WIDTH, MAX_HEIGHT),
    jump_m: float = math.inf,
) -> Image.Image:
    """Return a picture, RGB, of a mission's result.

    Args:
        grid: the map at its end.
        lattice: the planning grid at its end.
        driven_xy: float64 (n, 2), n >= 1: where the robot was, (x, y) [m], in order.
        visits: uint16, shape of the lattice: how often each cell was covered.
        title: heading.
        lines: caption below it.
        room: the most the map may take (width, height) [px].
        jump_m: two places further apart than this [m] are no drive, and not joined.
    """
    plot = Plot(View.over(bounds_of(grid, lattice, driven_xy), lattice.cell_m, *room))
    plot.ground(grid)
    start = lattice.cell_at(*driven_xy[0].tolist())
    key = draw_visits(plot, lattice, visits, start)
    lengths_m = np.hypot(*np.diff(driven_xy, axis=0).T)
    driven = lengths_m <= jump_m
    plot.trail(driven_xy[:-1][driven], driven_xy[1:][driven], LINE_WIDTH * lattice.cell_m)
    plot.end_mark(driven_xy[-1])
    plot.start_mark(driven_xy[0])
    bar = ("0", f"{lengths_m[driven].sum():,.0f} m driven")
    return Sheet(title, lines, key, bar, plot.view.scale).around(plot.finished())
