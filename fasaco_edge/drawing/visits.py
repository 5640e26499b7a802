"""Cells of a lattice, tinted by a walk's number of visits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.drawing import palette
from fasaco_edge.drawing.plot import Plot
from fasaco_edge.drawing.sheet import KeyEntry
from fasaco_edge.grid.lattice import COVERABLE, Cell, CoverageLattice
from fasaco_edge.kernels.lattice.reach import reachable_from

ENDS = (KeyEntry("disc", palette.START, "start"), KeyEntry("square", palette.END, "end"))


def draw_visits(
    plot: Plot,
    lattice: CoverageLattice,
    visits: NDArray[np.integer],
    start: Cell,
) -> list[KeyEntry]:
    """Tint the lattice's cells by number of visits; return the key of the tints.

    Args:
        plot: the plot to draw on.
        lattice: the planning grid.
        visits: number of visits of each cell, shape of the lattice.
        start: cell (row, col) from which reachable cells are found.
    """
    never = lattice.coverable & (visits == 0)
    reachable = _reachable(lattice, start)
    left_out, unreachable = never & reachable, never & ~reachable

    tints = np.array([palette.PAPER, palette.COVERED, *palette.RECOVERED], np.uint8)
    colours = tints[np.minimum(visits, len(tints) - 1)]
    colours[left_out] = palette.LEFT_OUT
    plot.tint(lattice, colours)
    plot.hatch(lattice, unreachable, palette.UNREACHABLE)

    key = _visit_key(visits)
    if left_out.any():
        key.append(_entry("tile", palette.LEFT_OUT, "not passed", left_out))
    if unreachable.any():
        key.append(_entry("hatch", palette.UNREACHABLE, "unreachable", unreachable))
    return key


def _reachable(lattice: CoverageLattice, start: Cell) -> NDArray[np.bool_]:
    if not lattice.contains(start) or lattice.states[lattice.local(start)] != COVERABLE:
        # Without a valid start, all cells count as reachable.
        return np.ones(lattice.states.shape, np.bool_)
    return reachable_from(lattice.steps, *lattice.local(start)).astype(np.bool_)


def _visit_key(visits: NDArray[np.integer]) -> list[KeyEntry]:
    key = [
        *ENDS,
        _entry("tile", palette.COVERED, "covered once", visits == 1),
    ]
    most = len(palette.RECOVERED) + 1
    for times, colour in enumerate(palette.RECOVERED, start=2):
        cells = visits >= times if times == most else visits == times
        if cells.any():
            label = f"{times} times or more" if times == most else f"{times} times"
            key.append(_entry("tile", colour, label, cells))
    return key


def _entry(symbol: str, colour: palette.Colour, label: str, cells: NDArray[np.bool_]) -> KeyEntry:
    count = int(np.count_nonzero(cells))
    return KeyEntry(symbol, colour, f"{label} ({count:,} cell{'s' * (count != 1)})")


def visits_of(lattice: CoverageLattice, cells: NDArray[np.int32]) -> NDArray[np.int64]:
    """Return the number of visits of a walk to each cell, int64, shape of the lattice."""
    visits = np.zeros(lattice.states.shape, np.int64)
    window = lattice.window
    np.add.at(visits, (cells[:, 0] - window.row0, cells[:, 1] - window.col0), 1)
    return visits
