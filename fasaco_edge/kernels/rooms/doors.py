"""Doors: narrow gaps between the ends of walls.

A door is a short chord across free pixels, from jamb to jamb, beyond which the free space widens on
both sides. A jamb is the end of a wall that continues along the chord: thin across it, with free
pixels on both sides. If the far side has not been seen yet, the near side suffices. The other jamb
may also be a corner or the side of a cabinet.

The mouth of a passage separates rooms as a door does, although its jambs are corners: on one side
the free space stays as narrow as in the mouth, and on the other side it becomes much wider.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import kernel, lean_inner_kernel
from fasaco_edge.kernels.rooms.chords import (
    WIDER,
    Place,
    RoomPixels,
    holds,
    is_mouth,
    sides,
    way,
    widest,
)
from fasaco_edge.kernels.rooms.openings import is_wide, may_be_wide

# Kinds of jambs, from worst to best: no wall; a thick wall or a corner; a wall that is thin as far
# as it has been seen; a thin wall.
NONE, THICK, HALF_SEEN, THIN = 0, 1, 2, 3
# Depth of a jamb that is examined [pixels], and how much of it must be occupied.
DEPTH, LEAST_MARKS = 4, 3
# A chord may meet its jambs at their edges, not in the middle. So walls are also sought along lines
# that are turned by this slope, or shifted aside [pixels].
TURN, ASIDE = 0.2, 1.0
# Largest change of a jamb's half thickness from one pixel of depth to the next [pixels].
ASLANT = 1.2
# Least sum of the kinds of both jambs: one thin and the other a corner, or both half seen.
LEAST_SURE = THIN + THICK
# How far a chord's middle may be from the middle of the gap [pixels].
OFF_CENTRE = 2.0
# Squared clearance beside a door relative to that in the door: least ratio on the other side than
# the wider one, and there if that side is half seen.
OTHER, OTHER_HALF_SEEN = 1.1, 0.8
# Limit on the chords that are kept; a gap gives several, and one of them is enough.
MOST_GAPS = 20_000


class DoorLimits(NamedTuple):
    """Limits on the size of a door.

    Attributes:
        width: of a door [pixels].
        opening: width of an opening in a wall, or of a corridor's mouth [pixels].
        wall: thickness of a wall with a door [pixels].
        reach: distance beside a door in which the free space is examined [pixels].
        passage: least length of a passage behind its mouth [pixels].
    """

    width: float
    opening: float
    wall: float
    reach: int
    passage: int


@lean_inner_kernel
def _is_ridge(clearance: NDArray[np.int32], row: int, col: int) -> bool:
    """Return whether a pixel is as far from walls as its neighbours on two opposite sides."""
    here = clearance[row, col]
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        one, other = clearance[row + down, col + right], clearance[row - down, col - right]
        if here >= one and here >= other and (here > one or here > other):
            return True
    return False


@lean_inner_kernel
def _face(pixels: RoomPixels, place: Place, most: float) -> float:
    """Return how far a wall reaches from a place inside it, in the place's direction [pixels].

    Negative if the wall ends at unseen pixels, 0 if it reaches further than ``most``.
    """
    way = 0.5
    while way <= most:
        row = int(np.floor(place.row + way * place.down))
        col = int(np.floor(place.col + way * place.right))
        if not holds(row, col, pixels.solid.shape) or pixels.unseen[row, col]:
            return -way
        if not pixels.solid[row, col]:
            return way
        way += 0.5
    return 0.0


@lean_inner_kernel
def _nearest_solid(pixels: RoomPixels, row: float, col: float) -> tuple[int, int, bool]:
    """Return the solid pixel at a point, or the nearest beside it, and whether any is occupied.

    The row is -1 if no pixel is solid.
    """
    at_row, at_col = int(np.floor(row)), int(np.floor(col))
    found_row, found_col, is_wall, nearest = -1, -1, False, 9.0
    for there_row in range(at_row - 1, at_row + 2):
        for there_col in range(at_col - 1, at_col + 2):
            if not holds(there_row, there_col, pixels.solid.shape):
                continue
            is_wall = is_wall or pixels.occupied[there_row, there_col]
            if not pixels.solid[there_row, there_col]:
                continue
            down, right = there_row + 0.5 - row, there_col + 0.5 - col
            far = down * down + right * right
            if there_row == at_row and there_col == at_col:
                far = -1.0
            if far < nearest:
                found_row, found_col, nearest = there_row, there_col, far
    return found_row, found_col, is_wall


@lean_inner_kernel
def _jamb_along(pixels: RoomPixels, end: Place, wall: float) -> int:
    """Return the kind of the jamb that continues a chord beyond its end, straight on."""
    marks, kind = 0, THIN
    left_before, right_before = 0.0, 0.0
    for depth in range(DEPTH):
        row, col = end.row + (depth + 0.5) * end.down, end.col + (depth + 0.5) * end.right
        at_row, at_col, is_wall = _nearest_solid(pixels, row, col)
        marks += is_wall
        if depth == 0:
            continue
        if at_row < 0:
            return NONE
        if depth > 2:
            continue
        if at_row != int(np.floor(row)) or at_col != int(np.floor(col)):
            row, col = at_row + 0.5, at_col + 0.5
        left = _face(pixels, Place(row, col, -end.right, end.down), wall)
        right = _face(pixels, Place(row, col, end.right, -end.down), wall)
        if left <= 0.0 and right <= 0.0:
            if left < 0.0 or right < 0.0:
                return NONE
            kind = THICK
        elif left == 0.0 or right == 0.0 or abs(left) + abs(right) > wall:
            kind = THICK
        elif (left < 0.0 or right < 0.0) and kind == THIN:
            kind = HALF_SEEN
        # A wall that the chord meets at an angle has faces that run away from the chord.
        if depth > 1 and (
            (min(left, left_before) > 0.0 and abs(left - left_before) > ASLANT)
            or (min(right, right_before) > 0.0 and abs(right - right_before) > ASLANT)
        ):  # fmt: skip
            kind = THICK
        left_before, right_before = left, right
    return kind if marks >= LEAST_MARKS else NONE


@lean_inner_kernel
def _jamb(pixels: RoomPixels, end: Place, wall: float) -> int:
    """Return the kind of the jamb at the end of a chord."""
    best = _jamb_along(pixels, end, wall)
    for turned in range(3):
        for moved in range(3):
            if best >= HALF_SEEN:
                return best
            turn, aside = (turned - 1) * TURN, (moved - 1) * ASIDE
            place = Place(
                end.row - aside * end.right,
                end.col + aside * end.down,
                end.down + turn * end.right,
                end.right - turn * end.down,
            )
            if _jamb_along(pixels, place, wall) == HALF_SEEN:
                best = HALF_SEEN
    return best


@lean_inner_kernel
def _certainty(
    pixels: RoomPixels, first: Place, last: Place, centre: tuple[int, int], limits: DoorLimits
) -> int:
    """Return the certainty of a door or mouth between two jambs, no wider than a door; 0 if none.

    Args:
        first, last: both ends of the chord, each with the direction away from the other.
        centre: the pixel that the chord was laid through.
    """
    kind = _jamb(pixels, first, limits.wall)
    if kind == NONE:
        return 0
    other_kind = _jamb(pixels, last, limits.wall)
    if other_kind == NONE:
        return 0
    clearance, here = pixels.clearance, pixels.clearance[centre]
    one, other = sides(centre, first)
    if kind + other_kind >= LEAST_SURE:
        beside = widest(clearance, one, limits.reach), widest(clearance, other, limits.reach)
        least = OTHER_HALF_SEEN if HALF_SEEN in (kind, other_kind) else OTHER
        separates = max(beside) >= WIDER * here and min(beside) >= least * here
    else:
        wide = int(np.hypot(first.row - last.row, first.col - last.col))
        separates = is_mouth(clearance, one, other, limits.passage, wide, here)
    return kind + other_kind if separates else 0


@lean_inner_kernel
def _door_at(
    pixels: RoomPixels,
    centre: tuple[int, int],
    directions: NDArray[np.float64],
    limits: DoorLimits,
    door: NDArray[np.float64],
) -> bool:
    """Fill in the door through a pixel, as a row of ``find_doors``; return whether there is one."""
    row, col = centre[0] + 0.5, centre[1] + 0.5
    is_wider = 4 * pixels.clearance[centre] > limits.width * limits.width
    shortest, ahead, chord = limits.opening if is_wider else limits.width, 0.0, -1
    for number in range(len(directions)):
        down, right = directions[number]
        one = way(pixels.solid, Place(row, col, down, right), shortest)
        if one >= shortest:
            continue
        other = way(pixels.solid, Place(row, col, -down, -right), shortest - one)
        if one + other < shortest:
            shortest, ahead, chord = one + other, one, number
    behind = shortest - ahead
    if chord < 0 or abs(ahead - behind) > OFF_CENTRE:
        return False
    down, right = directions[chord]
    first = Place(row + ahead * down, col + ahead * right, down, right)
    last = Place(row - behind * down, col - behind * right, -down, -right)
    if is_wider:
        certainty = THICK + THICK if is_wide(pixels, first, last, centre, shortest) else 0
    else:
        certainty = _certainty(pixels, first, last, centre, limits)
    door[0], door[1], door[2], door[3] = first.row, first.col, last.row, last.col
    door[4] = certainty
    return certainty > 0


@kernel
def find_doors(
    pixels: RoomPixels,
    middles: NDArray[np.bool_],
    directions: NDArray[np.float64],
    limits: DoorLimits,
) -> NDArray[np.float64]:
    """Return the chords of all doors and mouths of passages, several of each, float64 (n, 5).

    A row holds row and column of the first end and of the last end [pixels], and the certainty of
    the door: the sum of the kinds of its jambs, at least LEAST_SURE.

    Args:
        pixels: what the pixels are.
        middles: pixels through which chords are looked for, bool (rows, cols).
        directions: of the chords, unit vectors (row, col), float64 (m, 2), over half a turn.
        limits: on the size of a door.
    """
    rows, cols = pixels.solid.shape
    most, widest = int((limits.width / 2 + 1) ** 2), int((limits.opening / 2) ** 2)
    doors, count = np.empty((MOST_GAPS, 5)), 0
    for row in range(1, rows - 1):
        for col in range(1, cols - 1):
            here = pixels.clearance[row, col]
            if not (middles[row, col] and 4 <= here <= widest and count < MOST_GAPS):
                continue
            if _is_ridge(pixels.clearance, row, col) and (
                here <= most or may_be_wide(pixels.clearance, row, col, directions)
            ):
                count += _door_at(pixels, (row, col), directions, limits, doors[count])
    return doors[:count].copy()
