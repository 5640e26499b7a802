"""Where a walk changed, and what lies around."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import lean_kernel
from fasaco_edge.kernels.walk_array import Ground, axis_of


@lean_kernel
def changed_cells(
    ground: Ground,
    before: NDArray[np.int32],
    walk: NDArray[np.int32],
    times: NDArray[np.int32],
    cells: NDArray[np.int32],
) -> int:
    """List the cells at steps that one walk takes more often than the other.

    Args:
        ground: where both walks lie; cells without a step are left out.
        before, walk: int32 (m,), (n,).
        times: int32 (cells of the ground, 2), all 0: working memory.
        cells: out, int32 (2 * (m + n),): a cell may be listed more than once.

    Returns:
        How many are listed.
    """
    for index in range(walk.size - 1):
        one, other = walk[index], walk[index + 1]
        times[min(one, other), axis_of(one, other)] += 1
    for index in range(before.size - 1):
        one, other = before[index], before[index + 1]
        times[min(one, other), axis_of(one, other)] -= 1
    listed = 0
    for steps in (walk, before):
        for index in range(steps.size - 1):
            one, other = steps[index], steps[index + 1]
            if times[min(one, other), axis_of(one, other)] == 0:
                continue
            for cell in (one, other):
                if ground.steps[cell]:
                    cells[listed] = cell
                    listed += 1
    return listed


@lean_kernel
def neighbourhood(
    ground: Ground,
    cells: NDArray[np.int32],
    radius: int,
    labels: NDArray[np.int32],
    label: int,
    found: NDArray[np.int32],
) -> int:
    """Label some cells, and those around them.

    Args:
        ground: where they lie.
        cells: int32 (n,).
        radius: steps from them to the rim.
        labels: int32 (cells of the ground,), changed in place.
        label: one that no cell has yet.
        found: out, int32 (room,), the labelled cells, nearest first; no more are labelled
            than there is room for.

    Returns:
        How many were labelled.
    """
    size = 0
    for cell in cells:
        if labels[cell] != label and size < found.size:
            labels[cell] = label
            found[size] = cell
            size += 1
    first = 0
    for _ in range(radius):
        last = size
        for index in range(first, last):
            cell = found[index]
            for direction in range(4):
                beside = cell + ground.offsets[direction]
                is_open = ground.steps[cell] >> direction & 1 and labels[beside] != label
                if is_open and size < found.size:
                    labels[beside] = label
                    found[size] = beside
                    size += 1
        first = last
    return size
