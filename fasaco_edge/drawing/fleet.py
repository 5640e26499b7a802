"""Picture of a fleet's plan: whose cells are whose, and each robot's walk."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fasaco_edge.drawing import palette
from fasaco_edge.drawing.pictures import draw_line, in_pieces
from fasaco_edge.drawing.plot import Plot, View, bounds_of
from fasaco_edge.drawing.sheet import KeyEntry, Sheet
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid

ROBOTS = (
    palette.BLUE,
    palette.ORANGE,
    palette.GREEN,
    palette.PURPLE,
    palette.SKY,
    palette.VERMILION,
)
# How much of its colour a robot's cells have; those that two robots pass have none.
TINT = 0.35


def draw_fleet(
    lattice: CoverageLattice,
    walks: Sequence[NDArray[np.int32]],
    *,
    grid: OccupancyGrid | None,
    title: str,
    lines: Sequence[str],
) -> Image.Image:
    """Return a picture, RGB, of the walks of several robots, with the map below them.

    Args:
        lattice: the planning grid.
        walks: of each robot, int32 (n, 2), n >= 1: cells (row, col), its start first.
        grid: the map the lattice was made from; None draws the lattice's own states.
        title: heading.
        lines: caption below it.
    """
    centres = [lattice.centres(walk) for walk in walks]
    everywhere = bounds_of(grid, lattice, np.vstack(centres))
    plot = Plot(View.over(everywhere, lattice.cell_m))
    plot.ground(lattice if grid is None else grid)
    plot.tint(lattice, _tints(lattice, walks))
    for points in centres:
        if len(points) > 1:
            draw_line(plot, in_pieces(points, lattice.cell_m), lattice.cell_m)
    for points in centres:
        if (points[0] != points[-1]).any():
            plot.end_mark(points[-1])
        plot.start_mark(points[0])
    longest = max(map(len, walks)) - 1
    key = [KeyEntry("disc", palette.START, "start"), *_key(walks)]
    return Sheet(title, lines, key, ("0", f"{longest:,} steps"), plot.view.scale).around(
        plot.finished()
    )


def _tints(lattice: CoverageLattice, walks: Sequence[NDArray[np.int32]]) -> NDArray[np.uint8]:
    """Return a tint for each cell, uint8 (rows, cols, 3)."""
    window = lattice.window
    colours = np.full((*lattice.states.shape, 3), palette.PAPER, np.uint8)
    passed = np.zeros(lattice.states.shape, np.int32)
    for number, walk in enumerate(walks):
        rows, cols = np.unique(walk - (window.row0, window.col0), axis=0).T
        colours[rows, cols] = _tint(number)
        passed[rows, cols] += 1
    colours[passed > 1] = palette.RULE
    return colours


def _tint(number: int) -> palette.Colour:
    colour = np.array(ROBOTS[number % len(ROBOTS)])
    red, green, blue = np.rint(255 - TINT * (255 - colour)).astype(int).tolist()
    return red, green, blue


def _key(walks: Sequence[NDArray[np.int32]]) -> list[KeyEntry]:
    key = [
        KeyEntry("tile", _tint(number), f"robot {number + 1} ({len(walk) - 1:,} steps)")
        for number, walk in enumerate(walks)
    ]
    return [*key, KeyEntry("tile", palette.RULE, "passed by two or more")]
