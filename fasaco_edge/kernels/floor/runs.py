"""Runs: common stretches of two walks over cells, forward or backward."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined, kernel

AFTER, BEFORE, STEPS, BACKWARD = range(4)


@inlined
def _same(one: NDArray[np.int32], a: int, other: NDArray[np.int32], b: int) -> bool:
    return bool(one[a, 0] == other[b, 0] and one[a, 1] == other[b, 1])


@kernel
def common_runs(
    before: NDArray[np.int32], after: NDArray[np.int32], least: int
) -> NDArray[np.int64]:
    """Return the common stretches of two walks.

    No step of either walk is in two stretches.

    Args:
        before, after: int32 (n, 2) and (m, 2), cells (row, col), both one cell or more.
        least: the fewest steps of a stretch.

    Returns:
        int64 (k, 4), in the order of ``after``: begin in ``after``; begin in ``before``; number of
        steps; 1 if ``before`` runs the other way, else 0.
    """
    size, most = len(before), len(after)
    # The index spans ``before`` alone: ``after`` may be far away, and the index too large.
    row0, col0 = before[:, 0].min(), before[:, 1].min()
    rows, cols = before[:, 0].max() - row0 + 1, before[:, 1].max() - col0 + 1
    # The visits of each cell in ``before``, in order.
    first = np.full(rows * cols, -1, np.int32)
    following = np.empty(size, np.int32)
    for at in range(size - 1, -1, -1):
        cell = (before[at, 0] - row0) * cols + before[at, 1] - col0
        following[at] = first[cell]
        first[cell] = at
    is_taken = np.zeros(size, np.bool_)
    runs = np.empty((most // max(least, 1) + 1, 4), np.int64)
    count = begin = 0
    while begin < most - 1:
        longest, origin, backward = 0, 0, 0
        row, col = after[begin, 0] - row0, after[begin, 1] - col0
        is_within = 0 <= row < rows and 0 <= col < cols
        visit = first[row * cols + col] if is_within else -1
        while visit >= 0:
            steps = 0
            while (
                visit + steps < size - 1
                and begin + steps < most - 1
                and not is_taken[visit + steps]
                and _same(before, visit + steps + 1, after, begin + steps + 1)
            ):
                steps += 1
            if steps > longest:
                longest, origin, backward = steps, visit, 0
            steps = 0
            while (
                visit - steps > 0
                and begin + steps < most - 1
                and not is_taken[visit - steps - 1]
                and _same(before, visit - steps - 1, after, begin + steps + 1)
            ):
                steps += 1
            if steps > longest:
                longest, origin, backward = steps, visit, 1
            visit = following[visit]
        if longest < least:
            begin += 1
            continue
        low = origin - longest if backward else origin
        is_taken[low : low + longest] = True
        runs[count, AFTER], runs[count, BEFORE] = begin, origin
        runs[count, STEPS], runs[count, BACKWARD] = longest, backward
        count += 1
        begin += longest
    return runs[:count].copy()
