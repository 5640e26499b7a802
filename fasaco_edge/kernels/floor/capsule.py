"""Capsules: the area covered by a disc whose centre moves straight from one point to another.

All lengths are in pixels, and pixel (i, j) is the unit square around the point (y = i, x = j). A
capsule is convex, so it meets each row of pixels in one stretch, found from the two discs at its
ends and the two straight sides between them.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.floor.bits import any_between, is_marked
from fasaco_edge.kernels.jit import inlined, lean_inner_kernel, lean_kernel

# Tolerance of contact: a robot exactly as wide as a door fits.
TOUCH = 1e-3
# In place of a row: no row blocks the segment; the segment leads out of the raster.
CLEAR, BEYOND = -1, -2
# A line that rises by less counts as level.
LEVEL = 1e-9


@inlined
def right_of(
    y: float,
    ay: float,
    ax: float,
    by: float,
    bx: float,
    side_y: float,
    side_x: float,
    slope: float,
    square: float,
) -> float:
    """Return the largest x of a capsule at height y; -inf where it has none.

    Args:
        y: height.
        ay, ax, by, bx: the capsule's ends, the lower one first.
        side_y, side_x: offset from its ends to its right side; ``slope``: columns of that side per
            row. ``side_y`` is infinite for a level capsule, whose sides are rows.
        square: square of its radius.
    """
    x = -np.inf
    if (y - ay) * (y - ay) <= square:
        x = ax + np.sqrt(square - (y - ay) * (y - ay))
    if (y - by) * (y - by) <= square:
        x = max(x, bx + np.sqrt(square - (y - by) * (y - by)))
    if ay <= y - side_y <= by:
        x = max(x, ax + side_x + (y - side_y - ay) * slope)
    return x


@inlined
def right_side(
    ay: float, ax: float, by: float, bx: float, radius: float
) -> tuple[float, float, float]:
    """Return ``side_y``, ``side_x`` and ``slope`` of a capsule whose lower end is the first."""
    dy, dx = by - ay, bx - ax
    if dy <= LEVEL:
        return np.inf, 0.0, 0.0
    length = np.sqrt(dy * dy + dx * dx)
    return -dx / length * radius, dy / length * radius, dx / dy


@inlined
def _blocked_row(
    blocked: NDArray[np.uint64], ay: float, ax: float, by: float, bx: float, radius: float
) -> tuple[int, int, int]:
    """Return the first row with a blocked pixel nearer than ``radius`` to the segment a to b.

    Also return the first and the last column in which that pixel may be; ``CLEAR`` or ``BEYOND`` in
    place of the row if no pixel is blocked.

    A pixel is a square: the stretch of a row whose pixels touch the capsule is widest at the height
    in the row that is nearest to the capsule's outermost point.

    Args:
        blocked: uint64 (rows, words), see ``bits``. Pixels outside count as blocked.
        ay, ax, by, bx: the segment [pixels].
        radius: of the robot [pixels].
    """
    rows, cols = blocked.shape[0], blocked.shape[1] << 6
    radius -= TOUCH
    if ay > by:
        ay, ax, by, bx = by, bx, ay, ax
    side_y, side_x, slope = right_side(ay, ax, by, bx, radius)
    square = radius * radius
    low, high = ay - radius, by + radius
    first, last = int(np.floor(low + 0.5)), int(np.ceil(high - 0.5))
    if first < 0 or last >= rows:
        return BEYOND, 0, 0
    right_y = ay if ax > bx else by
    left_y = ay if ax < bx else by
    for i in range(first, last + 1):
        y0, y1 = max(i - 0.5, low), min(i + 0.5, high)
        if y0 > y1:
            continue
        if ax == bx:
            # All points between the two ends are outermost.
            y = min(max(min(max(y0, ay), by), y0), y1)
            right = right_of(y, ay, ax, by, bx, side_y, side_x, slope, square)
            left = 2.0 * ax - right
        else:
            y = min(max(right_y, y0), y1)
            right = right_of(y, ay, ax, by, bx, side_y, side_x, slope, square)
            y = min(max(left_y, y0), y1)
            left = -right_of(y, ay, -ax, by, -bx, -side_y, side_x, -slope, square)
        from_col, to_col = int(np.floor(left + 0.5)), int(np.ceil(right - 0.5))
        if from_col < 0 or to_col >= cols:
            return BEYOND, 0, 0
        if from_col <= to_col and any_between(blocked[i], from_col, to_col):
            return i, from_col, to_col
    return CLEAR, 0, 0


@inlined
def _is_box_clear(
    blocked: NDArray[np.uint64], ay: float, ax: float, by: float, bx: float, radius: float
) -> bool:
    """Return whether nothing is blocked in the box around a capsule, a fast test."""
    first, last = (
        int(np.floor(min(ay, by) - radius + 0.5)),
        int(np.ceil(max(ay, by) + radius - 0.5)),
    )
    begin, end = int(np.floor(min(ax, bx) - radius + 0.5)), int(np.ceil(max(ax, bx) + radius - 0.5))
    if first < 0 or begin < 0 or last >= blocked.shape[0] or end >= blocked.shape[1] << 6:
        return False
    row = first
    while row <= last and not any_between(blocked[row], begin, end):
        row += 1
    return row > last


@lean_kernel
def is_clear(
    blocked: NDArray[np.uint64], ay: float, ax: float, by: float, bx: float, radius: float
) -> bool:
    """Return whether no blocked pixel is nearer than ``radius`` to the segment a to b.

    Args:
        blocked: uint64 (rows, words), see ``bits``. Pixels outside count as blocked.
        ay, ax, by, bx: the segment [pixels].
        radius: of the robot [pixels].
    """
    if _is_box_clear(blocked, ay, ax, by, bx, radius - TOUCH):
        return True
    row, _, _ = _blocked_row(blocked, ay, ax, by, bx, radius)
    return row == CLEAR


@lean_inner_kernel
def is_clear_but(
    blocked: NDArray[np.uint64],
    ay: float,
    ax: float,
    by: float,
    bx: float,
    radius: float,
    blocker: NDArray[np.int64],
) -> bool:
    """Return as ``is_clear``; write a blocking pixel into ``blocker``, int64 (2,): row, col."""
    row, first, last = _blocked_row(blocked, ay, ax, by, bx, radius)
    if row < 0:
        return row == CLEAR
    # The pixel nearest to the middle also blocks most neighbouring segments.
    middle = (first + last) >> 1
    for away in range(last - first + 1):
        for col in (middle - away, middle + away):
            if first <= col <= last and is_marked(blocked, row, col):
                blocker[0], blocker[1] = row, col
                return False
    return False


@inlined
def is_near(y: float, x: float, ay: float, ax: float, by: float, bx: float, radius: float) -> bool:
    """Return whether a point is certainly nearer than ``radius`` to the segment a to b."""
    dy, dx = by - ay, bx - ax
    length2 = max(dy * dy + dx * dx, 1e-18)
    along = min(max(((y - ay) * dy + (x - ax) * dx) / length2, 0.0), 1.0)
    off_y, off_x = ay + along * dy - y, ax + along * dx - x
    return off_y * off_y + off_x * off_x < (radius - 2 * TOUCH) * (radius - 2 * TOUCH)


# Edges are checked in pieces of at most this length [pixels].
PIECE = 4.0


@lean_inner_kernel
def near_px(
    blocked: NDArray[np.uint64],
    points: NDArray[np.float64],
    first: int,
    last: int,
    robot: float,
    clear: float,
) -> float:
    """Return the length of edges without clearance [pixels], with the precision of a piece.

    A piece with more than half of the clearance counts half.

    Args:
        blocked: uint64 (rows, words), see ``bits``.
        points: float64 (n, 2): y, x [pixels].
        first, last: points where the first edge begins, and the last one ends.
        robot, clear: radius of the robot, and with its clearance [pixels].
    """
    half = 0.5 * (robot + clear)
    length = 0.0
    for number in range(first, last):
        ay, ax = points[number, 0], points[number, 1]
        by, bx = points[number + 1, 0], points[number + 1, 1]
        if is_clear(blocked, ay, ax, by, bx, clear):
            continue
        edge = np.sqrt((by - ay) * (by - ay) + (bx - ax) * (bx - ax))
        parts = max(int(np.ceil(edge / PIECE)), 1)
        dy, dx = (by - ay) / parts, (bx - ax) / parts
        near = 0
        for part in range(parts):
            y, x = ay + part * dy, ax + part * dx
            if not is_clear(blocked, y, x, y + dy, x + dx, clear):
                near += 1
                near += not is_clear(blocked, y, x, y + dy, x + dx, half)
        length += 0.5 * near * edge / parts
    return length
