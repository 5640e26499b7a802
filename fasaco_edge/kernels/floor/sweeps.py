"""Counts of sweeps: number of passes of the tool over each pixel, along straight segments.

A pixel is swept by each capsule of the tool's radius that contains its centre, see ``capsule``.
Pixels outside of the raster do not count.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.floor.capsule import right_of, right_side
from fasaco_edge.kernels.jit import inlined, lean_inner_kernel, lean_kernel

# A pixel's centre on the rim counts as covered.
RIM = 1e-7
# The side of a block is 2 ** BLOCK pixels.
BLOCK = 3
# For pixels that the tool can never reach, the count of sweeps starts at this number, not at 0.
NEVER = 10_000

# Columns of a prepared capsule: its lower and its upper end, and its right side, see ``right_of``.
Y0, X0, Y1, X1, SIDE_Y, SIDE_X, SLOPE = COLUMNS = range(7)


class Sweeps(NamedTuple):
    """Number of sweeps of each pixel by capsules of the tool's radius.

    Attributes:
        counts: int16 (rows, cols): number of capsules; from ``NEVER`` on for pixels out of the
            tool's reach.
        left: int32 (rows >> BLOCK, cols >> BLOCK), rounded up: unswept pixels of each block.
    """

    counts: NDArray[np.int16]
    left: NDArray[np.int32]


class Scratch(NamedTuple):
    """Working memory to compare capsules.

    Attributes:
        capsules: float64 (n, len(COLUMNS)), prepared capsules.
        before, after: int64 (n, 2), stretches of one row.
    """

    capsules: NDArray[np.float64]
    before: NDArray[np.int64]
    after: NDArray[np.int64]


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
    """Fill in capsule ``number``."""
    if ay > by:
        ay, ax, by, bx = by, bx, ay, ax
    capsule = capsules[number]
    capsule[Y0], capsule[X0], capsule[Y1], capsule[X1] = ay, ax, by, bx
    capsule[SIDE_Y], capsule[SIDE_X], capsule[SLOPE] = right_side(ay, ax, by, bx, radius)


@inlined
def _add_stretch(
    capsule: NDArray[np.float64],
    i: int,
    radius: float,
    cols: int,
    stretches: NDArray[np.int64],
    count: int,
) -> int:
    """Insert a capsule's pixels of row i into ``count`` sorted stretches; return their new number.

    Pixels beyond the row's ``cols`` are left out: the robot may come near to the raster's rim.
    """
    ay, ax, by, bx = capsule[Y0], capsule[X0], capsule[Y1], capsule[X1]
    side_y, side_x, slope = capsule[SIDE_Y], capsule[SIDE_X], capsule[SLOPE]
    square = radius * radius
    right = right_of(i, ay, ax, by, bx, side_y, side_x, slope, square)
    left = -right_of(i, ay, -ax, by, -bx, -side_y, side_x, -slope, square)
    if not left <= right:
        return count
    begin, end = max(int(np.ceil(left - RIM)), 0), min(int(np.floor(right + RIM)), cols - 1)
    if begin > end:
        return count
    place = count
    while place > 0 and stretches[place - 1, 0] > begin:
        stretches[place, 0], stretches[place, 1] = stretches[place - 1, 0], stretches[place - 1, 1]
        place -= 1
    stretches[place, 0], stretches[place, 1] = begin, end
    return count + 1


@inlined
def _add(
    row: NDArray[np.int16], blocks: NDArray[np.int32], begin: int, end: int, more: int
) -> None:
    """Add ``more`` to the counts of a row's pixels, the last one included; update ``left``."""
    for j in range(begin, end + 1):
        before = row[j]
        row[j] = before + more
        if before == 0:
            blocks[j >> BLOCK] -= 1
        elif before + more == 0:
            blocks[j >> BLOCK] += 1


@inlined
def _next_outside(
    stretches: NDArray[np.int64], count: int, at: int, col: int, last: int
) -> tuple[int, int, int]:
    """Return the next columns from ``col`` to ``last`` that lie in no stretch: first, last, and the
    stretch to continue with. If first > last there are none."""
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
    """Return the number of pixels swept only by the capsules of ``before``."""
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


@inlined
def rows_of(scratch: Scratch, count: int, radius: float, rows: int) -> tuple[int, int]:
    """Return the first and the last of ``rows`` rows that the capsules may meet."""
    capsules = scratch.capsules
    low, high = capsules[0, Y0], capsules[0, Y1]
    for number in range(1, count):
        low, high = min(low, capsules[number, Y0]), max(high, capsules[number, Y1])
    first, last = int(np.ceil(low - radius - RIM)), int(np.floor(high + radius + RIM))
    return max(first, 0), min(last, rows - 1)


@inlined
def stretches_of(
    scratch: Scratch, i: int, cols: int, taken: int, given: int, radius: float
) -> tuple[int, int]:
    """Fill in row i's stretches of the old and of the new capsules; return the number of each."""
    capsules, before, after = scratch.capsules, scratch.before, scratch.after
    olds = news = 0
    for number in range(taken + given):
        if capsules[number, Y0] - radius <= i <= capsules[number, Y1] + radius:
            if number < taken:
                olds = _add_stretch(capsules[number], i, radius, cols, before, olds)
            else:
                news = _add_stretch(capsules[number], i, radius, cols, after, news)
    return olds, news


@inlined
def _over(stretches: NDArray[np.int64], count: int, col: int, end: int) -> tuple[int, int]:
    """Return how many stretches contain a column, and the next column, at most ``end``, where that
    number changes."""
    times = 0
    for number in range(count):
        begin, behind = stretches[number, 0], stretches[number, 1] + 1
        if col < begin:
            end = min(end, begin)
        elif col < behind:
            times += 1
            end = min(end, behind)
    return times, end


@lean_inner_kernel
def swept_more(
    counts: NDArray[np.int16],
    scratch: Scratch,
    taken: int,
    given: int,
    radius: float,
    most_lost: float,
) -> int:
    """Return the increase in swept pixels if some capsules replace others.

    Nothing is changed: only pixels under one set and not under the other are read.

    Args:
        counts: int16 (rows, cols), counts of sweeps that still include the capsules to remove.
        scratch: its first ``taken`` capsules are removed, and the next ``given`` added.
        taken, given: numbers of capsules to remove and to add.
        radius: of the tool [pixels].
        most_lost: the search stops once more pixels than this are lost.
    """
    before, after = scratch.before, scratch.after
    rows, cols = counts.shape
    first, last = rows_of(scratch, taken + given, radius, rows)
    more = lost = 0
    for i in range(first, last + 1):
        olds, news = stretches_of(scratch, i, cols, taken, given, radius)
        row = counts[i]
        done = -1
        for number in range(olds):
            begin, at = max(before[number, 0], done + 1), 0
            while begin <= before[number, 1]:
                begin, end, at = _next_outside(after, news, at, begin, before[number, 1])
                lost += _lost(row, before, olds, begin, end)
                begin = end + 1
            done = max(done, before[number, 1])
        if lost > most_lost:
            return -lost
        done = -1
        for number in range(news):
            begin, at = max(after[number, 0], done + 1), 0
            while begin <= after[number, 1]:
                begin, end, at = _next_outside(before, olds, at, begin, after[number, 1])
                for j in range(begin, end + 1):
                    more += row[j] == 0
                begin = end + 1
            done = max(done, after[number, 1])
    return more - lost


@lean_inner_kernel
def exchange(sweeps: Sweeps, scratch: Scratch, taken: int, given: int, radius: float) -> None:
    """Remove the first ``taken`` capsules from the counts and add the next ``given``."""
    before, after = scratch.before, scratch.after
    counts = sweeps.counts
    rows, cols = counts.shape
    first, last = rows_of(scratch, taken + given, radius, rows)
    for i in range(first, last + 1):
        olds, news = stretches_of(scratch, i, cols, taken, given, radius)
        row, blocks = counts[i], sweeps.left[i >> BLOCK]
        col = cols
        if olds:
            col = min(col, before[0, 0])
        if news:
            col = min(col, after[0, 0])
        while col < cols:
            less, end = _over(before, olds, col, cols)
            times, end = _over(after, news, col, end)
            if times != less:
                _add(row, blocks, col, end - 1, times - less)
            col = end


@lean_inner_kernel
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
    """Add a capsule to the counts (``times`` 1), or remove it (-1)."""
    prepare(scratch.capsules, 0, ay, ax, by, bx, radius)
    taken = 1 if times < 0 else 0
    exchange(sweeps, scratch, taken, 1 - taken, radius)


@lean_kernel
def sweep_edges(
    sweeps: Sweeps, edges: NDArray[np.float64], radius: float, times: int, scratch: Scratch
) -> None:
    """Add edges to the counts (``times`` 1), or remove them (-1); float64 (n, 4): y, x, y, x."""
    for number in range(len(edges)):
        edge = edges[number]
        sweep(sweeps, edge[0], edge[1], edge[2], edge[3], radius, times, scratch)
