"""Chords across free pixels, and the clearance beside them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import lean_inner_kernel

# Squared clearance, relative to that in the mouth of a passage: inside the passage it is at most
# EVEN; before it, not farther away than the passage is wide, it reaches at least MOUTH. Where
# two passages cross, it is 2.
EVEN, MOUTH = 1.3, 4.0
# Least squared clearance on the wider side of a door, relative to that in the door.
WIDER = 1.32


class RoomPixels(NamedTuple):
    """What the pixels of a map are, each (rows, cols).

    Attributes:
        clearance: int32, squared distance to the nearest solid pixel [pixels^2].
        solid: bool, not free, furniture excepted.
        occupied: bool, walls that have been seen.
        unseen: bool, large unknown areas, such as a room that has not been seen yet.
    """

    clearance: NDArray[np.int32]
    solid: NDArray[np.bool_]
    occupied: NDArray[np.bool_]
    unseen: NDArray[np.bool_]


class Place(NamedTuple):
    """A point, row and column [pixels], and a direction, a unit vector."""

    row: float
    col: float
    down: float
    right: float


@lean_inner_kernel
def holds(row: int, col: int, shape: tuple[int, int]) -> bool:
    return 0 <= row < shape[0] and 0 <= col < shape[1]


@lean_inner_kernel
def way(solid: NDArray[np.bool_], place: Place, most: float) -> float:
    """Return how far free pixels reach from a place in its direction, at most ``most`` [pixels]."""
    far = 0.5
    while far < most:
        row = int(np.floor(place.row + far * place.down))
        col = int(np.floor(place.col + far * place.right))
        if not holds(row, col, solid.shape) or solid[row, col]:
            break
        far += 0.5
    return far


@lean_inner_kernel
def widest(clearance: NDArray[np.int32], place: Place, reach: int) -> int:
    """Return the largest squared clearance along a line from a place [pixels^2]."""
    most = 0
    for far in range(1, reach + 1):
        row = int(np.floor(place.row + far * place.down))
        col = int(np.floor(place.col + far * place.right))
        if not holds(row, col, clearance.shape) or clearance[row, col] == 0:
            break
        most = max(most, clearance[row, col])
    return most


@lean_inner_kernel
def sides(centre: tuple[int, int], chord: Place) -> tuple[Place, Place]:
    """Return a pixel's middle with the directions to both sides of a chord through it."""
    row, col = centre[0] + 0.5, centre[1] + 0.5
    return Place(row, col, -chord.right, chord.down), Place(row, col, chord.right, -chord.down)


@lean_inner_kernel
def is_mouth(
    clearance: NDArray[np.int32], one: Place, other: Place, narrow: int, wide: int, here: int
) -> bool:
    """Return whether a gap of clearance ``here`` is the mouth of a passage on either side.

    The passage is at least ``narrow`` pixels long, and the space widens within ``wide`` before it.
    """
    return _leads_in(clearance, one, other, narrow, wide, here) or _leads_in(
        clearance, other, one, narrow, wide, here
    )


@lean_inner_kernel
def _leads_in(
    clearance: NDArray[np.int32], inside: Place, outside: Place, narrow: int, wide: int, here: int
) -> bool:
    for far in range(1, narrow + 1):
        row = int(np.floor(inside.row + far * inside.down))
        col = int(np.floor(inside.col + far * inside.right))
        if not holds(row, col, clearance.shape) or not 0 < clearance[row, col] <= EVEN * here:
            return False
    widens: bool = widest(clearance, outside, wide) >= MOUTH * here
    return widens
