"""Grounds for tests over generated maps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import Cell
from tests import naive


def ground(steps: NDArray[np.uint8], free: NDArray[np.bool_]) -> list[Cell]:
    """Return the cells (row, col) that steps connect with the first free cell, in order."""
    if not free.any():
        return []
    row, col = np.argwhere(free)[0].tolist()
    return sorted(naive.distances(steps, (row, col)))
