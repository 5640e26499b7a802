"""Grounds that Hypothesis draws."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import Cell
from tests import naive

MOST = 9


def free_cells(data: st.DataObject, least: int = 2) -> NDArray[np.bool_]:
    """Return the free cells of a small map, bool (rows, cols), each side at least ``least``."""
    side = st.integers(least, MOST)
    rows, cols = data.draw(side), data.draw(side)
    blocked = data.draw(st.sets(st.tuples(st.integers(0, rows - 1), st.integers(0, cols - 1))))
    free = np.ones((rows, cols), np.bool_)
    for cell in blocked:
        free[cell] = False
    return free


def ground(steps: NDArray[np.uint8], free: NDArray[np.bool_]) -> list[Cell]:
    """Return the cells (row, col) that steps lead to from the first free one, in order."""
    if not free.any():
        return []
    row, col = np.argwhere(free)[0].tolist()
    return sorted(naive.distances(steps, (row, col)))
