"""A picture of a walk over the lattice: a line that keeps right, so there and back are two."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fasaco_edge.drawing.plot import Plot
from fasaco_edge.drawing.sheet import KeyEntry, Sheet
from fasaco_edge.drawing.view import View, bounds_of
from fasaco_edge.drawing.visits import draw_visits
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid

Points = NDArray[np.float64]


def directions(points: Points) -> Points:
    """Return unit vectors (n - 1, 2) along points (n, 2), no two in succession equal."""
    steps = np.diff(points, axis=0)
    unit: Points = steps / np.hypot(steps[:, 0], steps[:, 1])[:, None]
    return unit


def lanes(points: Points, offset: float) -> tuple[Points, Points]:
    """Return start and end of every segment, both (m, 2), of the line beside ``points``.

    Args:
        points: a walk (n, 2) of right angles, no two points in succession equal.
        offset: how far to the right of the walk [same unit].
    """
    along = directions(points)
    right = np.stack([along[:, 1], -along[:, 0]], axis=1)
    cosine = (along[:-1] * along[1:]).sum(axis=1)
    turns, back = np.abs(cosine) < 0.5, cosine <= -0.5
    at_start, at_end = right.copy(), right.copy()
    # Where it turns, the two lanes meet beside the corner.
    at_end[:-1][turns] += right[1:][turns]
    at_start[1:][turns] += right[:-1][turns]
    # Where it turns back, they are joined a little beyond the centre.
    at_end[:-1][back] += along[:-1][back]
    at_start[1:][back] += along[:-1][back]
    starts, ends = points[:-1] + offset * at_start, points[1:] + offset * at_end
    corners = np.stack([starts, ends], axis=1).reshape(-1, 2)
    moved = (np.abs(np.diff(corners, axis=0)) > 1e-9).any(axis=1)
    return corners[:-1][moved], corners[1:][moved]


def arrow_places(points: Points, every: float) -> NDArray[np.intp]:
    """Return which segments of a walk carry an arrow: straight ones, about ``every`` apart."""
    along = directions(points)
    travelled = np.cumsum(np.hypot(*np.diff(points, axis=0).T))
    goes_on = (along[1:] * along[:-1]).sum(axis=1) > 0.99
    straight = np.zeros(len(along), np.bool_)
    straight[1:] |= goes_on
    straight[:-1] |= goes_on
    candidates = np.flatnonzero(straight)
    if not len(candidates):
        return candidates
    wanted = np.arange(every / 2, travelled[-1], every)
    nearest = np.searchsorted(travelled[candidates], wanted)
    return np.unique(candidates[nearest[nearest < len(candidates)]])


# In cells.
LANE_OFFSET = 0.11
LINE_WIDTH = 0.13
ARROW_SIZE = 0.34

SMALLEST_ARROW_PX = 7
ARROW_EVERY_PX = 170
MOST_ARROWS = 400


def draw_walk(
    lattice: CoverageLattice,
    cells: NDArray[np.int32],
    *,
    grid: OccupancyGrid | None,
    title: str,
    lines: Sequence[str],
) -> Image.Image:
    """Return a picture, RGB, of a walk over the lattice, with the map below it.

    Args:
        lattice: the planning grid.
        cells: int32 (n, 2), n >= 1: the walk's cells (row, col), the start first; all
            inside the lattice's window.
        grid: the map the lattice was made from; None draws the lattice's own states.
        title: heading.
        lines: caption below it.
    """
    centres = lattice.centres(cells)
    plot = Plot(View.over(bounds_of(grid, lattice, centres), lattice.cell_m))
    plot.ground(lattice if grid is None else grid)
    key = plot_walk(plot, lattice, cells)
    bar = ("0", f"{len(cells) - 1:,} steps")
    return Sheet(title, lines, key, bar, plot.view.scale).around(plot.finished())


def plot_walk(plot: Plot, lattice: CoverageLattice, cells: NDArray[np.int32]) -> list[KeyEntry]:
    """Draw a walk, int32 (n, 2) as in ``draw_walk``; return what its tints and marks mean."""
    centres = lattice.centres(cells)
    key = draw_visits(plot, lattice, _visits(lattice, cells), tuple(cells[0].tolist()))
    _draw_line(plot, centres, lattice.cell_m)
    if (cells[0] != cells[-1]).any():
        plot.end_mark(centres[-1])
    plot.start_mark(centres[0])
    return key


def _visits(lattice: CoverageLattice, cells: NDArray[np.int32]) -> NDArray[np.int64]:
    visits = np.zeros(lattice.states.shape, np.int64)
    window = lattice.window
    np.add.at(visits, (cells[:, 0] - window.row0, cells[:, 1] - window.col0), 1)
    return visits


def _draw_line(plot: Plot, centres: NDArray[np.float64], cell_m: float) -> None:
    moves = np.ones(len(centres), np.bool_)
    moves[1:] = (np.diff(centres, axis=0) != 0).any(axis=1)
    points = centres[moves]
    offset = LANE_OFFSET * cell_m
    plot.trail(*lanes(points, offset), LINE_WIDTH * cell_m)

    along = directions(points)
    right = np.stack([along[:, 1], -along[:, 0]], axis=1)
    middles = (points[:-1] + points[1:]) / 2 + right * offset
    size = max(ARROW_SIZE * cell_m, SMALLEST_ARROW_PX / plot.view.scale)
    every = max(ARROW_EVERY_PX / plot.view.scale, len(along) * cell_m / MOST_ARROWS)
    for place in arrow_places(points, every).tolist():
        plot.arrow(middles[place], along[place], size)
