"""Capsules: what a disc covers while its centre drives straight from one point to another.

All lengths are in pixels, and pixel (i, j) is the unit square around the point (y = i, x = j). A
capsule is convex, so it meets each row of pixels in one stretch, found from the two discs at its
ends and the two straight sides between them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined, lean_kernel

# A robot exactly as wide as a door fits: so much nearer counts as not touched.
TOUCH = 1e-3
# A pixel's centre on the rim counts as covered.
RIM = 1e-7
# The side of a block of pixels is 2 ** BLOCK of them.
BLOCK = 3
# Counts of sweeps of pixels that the tool can never reach begin here.
NEVER = 10_000
# So many capsules are compared at most, those taken away and those put in their place.
MOST_CAPSULES = 24

# Columns of a prepared capsule: its lower and its upper end, then of its right side, for one that
# is not level: columns a row, and from the line to it; whether it is.
Y0, X0, Y1, X1, SLOPE, SIDE_Y, SIDE_X, IS_SLANTED = range(8)


class Sweeps(NamedTuple):
    """How often each pixel is swept, by capsules of the tool's radius.

    Attributes:
        counts: int16 (rows, cols): by how many capsules; from ``NEVER`` on where the tool cannot
            come to.
        left: int32 (rows >> BLOCK, cols >> BLOCK), rounded up: pixels of a block with count 0.
    """

    counts: NDArray[np.int16]
    left: NDArray[np.int32]


class Scratch(NamedTuple):
    """Memory to compare capsules in.

    Attributes:
        capsules: float64 (MOST_CAPSULES, 8), prepared ones.
        before, after: int64 (MOST_CAPSULES, 2), stretches of one row.
    """

    capsules: NDArray[np.float64]
    before: NDArray[np.int64]
    after: NDArray[np.int64]


@inlined
def _right_of(
    y: float, ay: float, ax: float, by: float, bx: float, radius: float, length: float
) -> float:
    """Return the largest x of a capsule at height y, which has to lie within it."""
    x = -np.inf
    square = radius * radius
    if (y - ay) * (y - ay) <= square:
        x = ax + np.sqrt(square - (y - ay) * (y - ay))
    if (y - by) * (y - by) <= square:
        x = max(x, bx + np.sqrt(square - (y - by) * (y - by)))
    dy, dx = by - ay, bx - ax
    if abs(dy) > 1e-12:
        side_y, side_x = -dx / length * radius, dy / length * radius
        if side_x < 0.0:
            side_y, side_x = -side_y, -side_x
        along = (y - ay - side_y) / dy
        if 0.0 <= along <= 1.0:
            x = max(x, ax + side_x + along * dx)
    return x


@lean_kernel
def is_clear(
    blocked: NDArray[np.int32], ay: float, ax: float, by: float, bx: float, radius: float
) -> bool:
    """Tell whether no blocked pixel comes nearer than ``radius`` to the way from a to b.

    A pixel is a square: the row's stretch that its squares may not reach into is widest where the
    row is nearest to the height of the capsule's outermost point.

    Args:
        blocked: int32 (rows, cols + 1): how many of a row's first pixels are blocked. What lies
            outside is blocked, too.
        ay, ax, by, bx: the way [pixels].
        radius: of the robot [pixels].
    """
    rows, cols = blocked.shape[0], blocked.shape[1] - 1
    radius -= TOUCH
    length = np.sqrt((by - ay) * (by - ay) + (bx - ax) * (bx - ax))
    low, high = min(ay, by) - radius, max(ay, by) + radius
    first, last = int(np.floor(low + 0.5)), int(np.ceil(high - 0.5))
    if first < 0 or last >= rows:
        return False
    right_y = ay if ax > bx else by
    left_y = ay if ax < bx else by
    for i in range(first, last + 1):
        y0, y1 = max(i - 0.5, low), min(i + 0.5, high)
        if y0 > y1:
            continue
        if ax == bx:
            # All between the two ends are outermost.
            y = min(max(y0, min(ay, by)), max(ay, by))
            right = _right_of(min(max(y, y0), y1), ay, ax, by, bx, radius, length)
            left = 2.0 * ax - right
        else:
            y = min(max(right_y, y0), y1)
            right = _right_of(y, ay, ax, by, bx, radius, length)
            y = min(max(left_y, y0), y1)
            left = -_right_of(y, ay, -ax, by, -bx, radius, length)
        from_col, to_col = int(np.floor(left + 0.5)), int(np.ceil(right - 0.5))
        if from_col < 0 or to_col >= cols:
            return False
        if blocked[i, to_col + 1] != blocked[i, from_col]:
            return False
    return True


@inlined
def prepare(
    capsules: NDArray[np.float64],
    number: int,
    ay: float,
    ax: float,
    by: float,
    bx: float,
    radius: float,
) -> None:
    """Fill in the capsule of a number."""
    if ay > by:
        ay, ax, by, bx = by, bx, ay, ax
    capsule = capsules[number]
    capsule[Y0], capsule[X0], capsule[Y1], capsule[X1] = ay, ax, by, bx
    capsule[IS_SLANTED] = 0.0
    dy, dx = by - ay, bx - ax
    if dy > 1e-9:
        length = np.sqrt(dy * dy + dx * dx)
        capsule[SLOPE] = dx / dy
        capsule[SIDE_Y], capsule[SIDE_X] = -dx / length * radius, dy / length * radius
        capsule[IS_SLANTED] = 1.0


@inlined
def _add_stretch(
    capsule: NDArray[np.float64],
    i: int,
    radius: float,
    stretches: NDArray[np.int64],
    count: int,
) -> int:
    """Sort a capsule's pixels of row i in among ``count`` stretches; return how many there are."""
    ay, ax, by, bx = capsule[Y0], capsule[X0], capsule[Y1], capsule[X1]
    right, left = -np.inf, np.inf
    square = radius * radius
    if (i - ay) * (i - ay) <= square:
        half = np.sqrt(square - (i - ay) * (i - ay))
        right, left = ax + half, ax - half
    if (i - by) * (i - by) <= square:
        half = np.sqrt(square - (i - by) * (i - by))
        right, left = max(right, bx + half), min(left, bx - half)
    if capsule[IS_SLANTED] > 0.0:
        y = i - capsule[SIDE_Y]
        if ay <= y <= by:
            right = max(right, ax + capsule[SIDE_X] + (y - ay) * capsule[SLOPE])
        y = i + capsule[SIDE_Y]
        if ay <= y <= by:
            left = min(left, ax - capsule[SIDE_X] + (y - ay) * capsule[SLOPE])
    if not left <= right:
        return count
    begin, end = int(np.ceil(left - RIM)), int(np.floor(right + RIM))
    if begin > end:
        return count
    place = count
    while place > 0 and stretches[place - 1, 0] > begin:
        stretches[place, 0], stretches[place, 1] = stretches[place - 1, 0], stretches[place - 1, 1]
        place -= 1
    stretches[place, 0], stretches[place, 1] = begin, end
    return count + 1


@lean_kernel
def sweep(
    sweeps: Sweeps,
    ay: float,
    ax: float,
    by: float,
    bx: float,
    radius: float,
    times: int,
    scratch: Scratch,
) -> None:
    """Count a capsule in (``times`` 1) or out again (-1)."""
    counts, left = sweeps.counts, sweeps.left
    prepare(scratch.capsules, 0, ay, ax, by, bx, radius)
    stretch = scratch.before
    for i in range(
        int(np.ceil(min(ay, by) - radius - RIM)), int(np.floor(max(ay, by) + radius + RIM)) + 1
    ):
        if not _add_stretch(scratch.capsules[0], i, radius, stretch, 0):
            continue
        row, blocks = counts[i], left[i >> BLOCK]
        for j in range(stretch[0, 0], stretch[0, 1] + 1):
            before = row[j]
            row[j] = before + times
            if before == 0:
                blocks[j >> BLOCK] -= 1
            elif before + times == 0:
                blocks[j >> BLOCK] += 1


@inlined
def _next_outside(
    stretches: NDArray[np.int64], count: int, at: int, col: int, last: int
) -> tuple[int, int, int]:
    """Return the next columns from ``col`` to ``last`` in no stretch: first, last, the stretch
    to look on from. There are none where first > last."""
    while at < count and col <= last:
        if stretches[at, 1] < col:
            at += 1
        elif stretches[at, 0] <= col:
            col = stretches[at, 1] + 1
        else:
            return col, min(last, stretches[at, 0] - 1), at
    return col, last, at


@inlined
def _lost(
    row: NDArray[np.int16], before: NDArray[np.int64], count: int, begin: int, end: int
) -> int:
    """Return how many pixels are swept by the capsules of ``before`` alone."""
    lost = 0
    if count == 1:
        for j in range(begin, end + 1):
            lost += row[j] == 1
        return lost
    for j in range(begin, end + 1):
        if row[j] <= count:
            times = 0
            for number in range(count):
                times += before[number, 0] <= j <= before[number, 1]
            lost += row[j] == times
    return lost


@lean_kernel
def swept_more(
    counts: NDArray[np.int16], scratch: Scratch, taken: int, given: int, radius: float
) -> int:
    """Return how many pixels more are swept once some capsules have taken the place of others.

    Nothing is changed: only pixels under one of both, and not under the other, are looked at.

    Args:
        counts: int16 (rows, cols), of sweeps; the capsules to be taken away are counted in it.
        scratch: whose first ``taken`` capsules are taken away, and the next ``given`` put in.
        taken, given: how many.
        radius: of the tool [pixels].
    """
    capsules, before, after = scratch.capsules, scratch.before, scratch.after
    low, high = capsules[0, Y0], capsules[0, Y1]
    for number in range(1, taken + given):
        low, high = min(low, capsules[number, Y0]), max(high, capsules[number, Y1])
    more = 0
    for i in range(int(np.ceil(low - radius - RIM)), int(np.floor(high + radius + RIM)) + 1):
        olds = news = 0
        for number in range(taken + given):
            if capsules[number, Y0] - radius <= i <= capsules[number, Y1] + radius:
                if number < taken:
                    olds = _add_stretch(capsules[number], i, radius, before, olds)
                else:
                    news = _add_stretch(capsules[number], i, radius, after, news)
        row = counts[i]
        done = -1
        for number in range(olds):
            begin, at = max(before[number, 0], done + 1), 0
            while begin <= before[number, 1]:
                begin, end, at = _next_outside(after, news, at, begin, before[number, 1])
                more -= _lost(row, before, olds, begin, end)
                begin = end + 1
            done = max(done, before[number, 1])
        done = -1
        for number in range(news):
            begin, at = max(after[number, 0], done + 1), 0
            while begin <= after[number, 1]:
                begin, end, at = _next_outside(before, olds, at, begin, after[number, 1])
                for j in range(begin, end + 1):
                    more += row[j] == 0
                begin = end + 1
            done = max(done, after[number, 1])
    return more
