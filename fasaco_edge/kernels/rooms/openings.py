"""Wide gaps that separate rooms: openings in straight walls, and mouths of corridors.

Such a gap is wider than any door. In an opening, the wall continues straight on at both ends, and
the free space widens on both sides. A corridor is long and as wide everywhere as at its mouth, and
the space before the mouth is much wider.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import lean_inner_kernel
from fasaco_edge.kernels.rooms.chords import (
    WIDER,
    Place,
    RoomPixels,
    holds,
    is_mouth,
    sides,
    widest,
)

# Squared clearance half the gap's width before and behind it, relative to that in the gap: least on
# the wider side, and on the other.
AHEAD, LEAST_AHEAD = 1.6, 0.6
# An opening is in a wall at least this multiple of its width long, on both sides together, holes up
# to MOST_HOLE [pixels] included. A corridor is at least this multiple of its width long.
STUBS, MOST_HOLE, CORRIDOR = 1.0, 3.0, 2.0


@lean_inner_kernel
def may_be_wide(
    clearance: NDArray[np.int32], row: int, col: int, directions: NDArray[np.float64]
) -> bool:
    """Return whether the free space widens beside a pixel, as beside a wide opening or mouth."""
    here = clearance[row, col]
    half = np.sqrt(float(here))
    for number in range(len(directions)):
        down, right = half * directions[number, 0], half * directions[number, 1]
        one, other = 0, 0
        at_row, at_col = int(np.floor(row + 0.5 + down)), int(np.floor(col + 0.5 + right))
        if holds(at_row, at_col, clearance.shape):
            one = clearance[at_row, at_col]
        at_row, at_col = int(np.floor(row + 0.5 - down)), int(np.floor(col + 0.5 - right))
        if holds(at_row, at_col, clearance.shape):
            other = clearance[at_row, at_col]
        if max(one, other) >= AHEAD * here and min(one, other) >= LEAST_AHEAD * here:
            return True
    return False


@lean_inner_kernel
def _wall_length(pixels: RoomPixels, end: Place, most: float) -> float:
    """Return how far a wall continues a chord beyond its end, at most ``most`` [pixels]."""
    row, col, seen = end.row, end.col, 0.0
    way = 0
    while way < most and way - seen <= MOST_HOLE:
        row, col, way = row + end.down, col + end.right, way + 1
        for side in range(3):
            # Straight on, then a pixel to either side.
            aside = (side + 1) // 2 * (1.0 - 2.0 * (side % 2))
            at_row = int(np.floor(row - aside * end.right))
            at_col = int(np.floor(col + aside * end.down))
            if holds(at_row, at_col, pixels.solid.shape) and pixels.occupied[at_row, at_col]:
                row, col, seen = row - aside * end.right, col + aside * end.down, float(way)
                break
    return seen


@lean_inner_kernel
def is_wide(
    pixels: RoomPixels, first: Place, last: Place, centre: tuple[int, int], gap: float
) -> bool:
    """Return whether a wide gap is an opening in a straight wall, or the mouth of a corridor.

    Args:
        first, last: both ends of its chord, each with the direction away from the other.
        centre: the pixel that the chord was laid through.
        gap: its width [pixels].
    """
    clearance, here = pixels.clearance, pixels.clearance[centre]
    one, other = sides(centre, first)
    reach = int(gap / 2.0)
    if min(widest(clearance, one, reach), widest(clearance, other, reach)) >= WIDER * here:
        walls = _wall_length(pixels, first, gap) + _wall_length(pixels, last, gap)
        return walls >= STUBS * gap
    return is_mouth(clearance, one, other, int(CORRIDOR * gap), int(gap), here)
