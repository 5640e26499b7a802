"""Picture of a pheromone trail: its direction at each cell, and how decided it is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fasaco_edge.drawing import palette
from fasaco_edge.drawing.plot import Plot, PlotView, bounds_of
from fasaco_edge.drawing.sheet import KeyEntry, Sheet
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.kernels import COL_STEP, EAST, NORTH, ROW_STEP, SOUTH, WEST
from fasaco_edge.planners.living_trail import Tau, directions

WAYS = {
    EAST: ("right", palette.SKY),
    NORTH: ("up", palette.GREEN),
    WEST: ("left", palette.ORANGE),
    SOUTH: ("down", palette.PURPLE),
}
# Least spacing of arrows.
ARROW_EVERY_PX = 16
SMALLEST, LARGEST = 0.2, 0.5
"""Sizes of arrow heads, as a share of their spacing."""


def draw_trail(
    lattice: CoverageLattice,
    tau: Tau,
    *,
    grid: OccupancyGrid | None,
    title: str,
    lines: Sequence[str],
) -> Image.Image:
    """Return a picture, RGB, of a trail over the lattice, with the map below it.

    Args:
        lattice: the planning grid.
        tau: the trail, over the lattice's window.
        grid: the map that the lattice was made from; None draws the lattice's own states.
        title: heading.
        lines: caption below it.
    """
    pointed, decided = pointed_and_decided(tau)
    # Relative to the most decided cell with a choice.
    choice = decided[np.count_nonzero(tau > 0, axis=2) > 1]
    decided = np.minimum(decided / (float(choice.max(initial=0.0)) or 1.0), 1.0)
    colours = np.full((*pointed.shape, 3), palette.PAPER, np.float64)
    key = []
    for direction, (name, colour) in WAYS.items():
        here = (pointed == direction) & (decided > 0.0)
        # Undecided cells are white: a multiplication by white leaves the map unchanged.
        share = 0.15 + 0.85 * decided[here][:, np.newaxis]
        colours[here] += share * (np.array(colour) - palette.PAPER)
        key.append(KeyEntry("tile", colour, f"{name} ({np.count_nonzero(here):,} cells)"))
    view = PlotView.over(bounds_of(grid, lattice, np.empty((0, 2))), lattice.cell_m)
    plot = Plot(view)
    plot.ground(lattice if grid is None else grid)
    plot.tint(lattice, np.rint(colours).astype(np.uint8))
    every = int(np.ceil(ARROW_EVERY_PX / (view.scale * lattice.cell_m)))
    window = lattice.window
    for row, col in _most_decided(decided, every):
        direction = int(pointed[row, col])
        cell = np.array([[row + window.row0, col + window.col0]], np.int32)
        along = np.array((COL_STEP[direction], ROW_STEP[direction]), np.float64)
        size = SMALLEST + (LARGEST - SMALLEST) * float(decided[row, col])
        plot.arrow(lattice.centres(cell)[0], along, size * every * lattice.cell_m)
    return Sheet(title, lines, key, None, view.scale).around(plot.finished())


def pointed_and_decided(tau: Tau) -> tuple[NDArray[np.int8], NDArray[np.float64]]:
    """Return the direction of the strongest step out of each cell, and how decided the cell is.

    Returns:
        direction, int8 (rows, cols), -1 without a step; decidedness, float64 (rows, cols): 0 if all
        steps have equal pheromone, 1 if the strongest has all of it, or is the only one.
    """
    pointed, share = directions(tau)
    ways = np.count_nonzero(tau > 0, axis=2)
    even = 1.0 / np.maximum(ways, 1)
    decided = np.where(ways == 1, 1.0, (share - even) / np.maximum(1.0 - even, 1e-9))
    # A rounding error in an even cell decides nothing.
    decided[(decided < 1e-5) | (ways == 0)] = 0.0
    return pointed, np.minimum(decided, 1.0)


def _most_decided(decided: NDArray[np.float64], every: int) -> list[tuple[int, int]]:
    """Return the most decided cell of each block of ``every`` by ``every`` cells."""
    rows, cols = decided.shape
    padded = np.pad(decided, ((0, -rows % every), (0, -cols % every)))
    down, across = padded.shape[0] // every, padded.shape[1] // every
    blocks = padded.reshape(down, every, across, every).swapaxes(1, 2)
    flat = blocks.reshape(down, across, -1)
    best, some = flat.argmax(axis=2), np.argwhere(flat.max(axis=2) > 0.0)
    return [
        (row * every + int(best[row, col]) // every, col * every + int(best[row, col]) % every)
        for row, col in some.tolist()
    ]
