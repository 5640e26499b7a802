"""Causes of unswept floor."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import Window
from fasaco_edge.kernels.floor.bits import WORD, unpacked


class Unswept(IntEnum):
    """Why a pixel of the floor is not swept; 0 if it is, or if it is no floor."""

    NARROW = 1
    CLOSED = 2
    KEPT_OUT = 3
    PASSED = 4
    BESIDE = 5
    AHEAD = 6


# Why the tool cannot reach a pixel.
OUT_OF_REACH = {
    Unswept.NARROW: "too narrow for the robot, or too near to a wall or to furniture",
    Unswept.CLOSED: "closed off: no way leads there that the robot fits through",
    Unswept.KEPT_OUT: "in a keep-out zone, or too near to one",
}


def causes_of(
    floor: FloorMap, free: FloorMap, reachable: NDArray[np.bool_], part: Window
) -> NDArray[np.uint8]:
    """Return why the tool cannot reach each pixel in a window of the raster, uint8 (rows, cols).

    The value is 0 where the tool can reach the pixel, and where the pixel is not free.

    Args:
        floor: the floor with keep-out zones.
        free: the floor of the same map without these zones; the same object if there are none.
        reachable: bool (rows, cols) of the lattice, the reachable cells.
        part: window of the raster.
    """
    anywhere = floor.stands.lattice.coverable
    fits = floor.reached(anywhere, part)
    fits_free = fits if free is floor else free.reached(free.stands.lattice.coverable, part)
    first, end = part.col0 // WORD, -(-part.col1 // WORD)
    words = unpacked(free.blocked[part.row0 : part.row1, first:end], (end - first) * WORD)
    is_free = ~words[:, part.col0 - first * WORD : part.col1 - first * WORD]
    causes = np.full(fits.shape, Unswept.NARROW, np.uint8)
    causes[fits_free] = Unswept.KEPT_OUT
    causes[fits] = 0
    if (anywhere & ~reachable).any():
        causes[fits & ~floor.reached(reachable, part)] = Unswept.CLOSED
    causes[~is_free] = 0
    return causes
