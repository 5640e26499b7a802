"""Detours: an edge rerouted over unswept floor beside it."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.floor.bits import is_marked
from fasaco_edge.kernels.floor.line import (
    LEAST_GAIN_S,
    NONE,
    TRIED,
    Floor,
    Line,
    MoveMemory,
    Price,
    copy_point,
    gain_above,
    has_room,
    replace_points,
)
from fasaco_edge.kernels.floor.sweeps import BLOCK, Sweeps
from fasaco_edge.kernels.jit import as_value, inlined, kernel, lean_inner_kernel, lean_kernel

# A detour leaves its edge this far before the spot, and joins it this far after [pixels].
SPREAD = 6.0
# Least unswept floor of a block for a detour [pixels].
LEAST_LEFT = 3


@lean_inner_kernel
def middle_left(sweeps: Sweeps, i: int, j: int, place: NDArray[np.float64]) -> bool:
    """Find the middle of a block's unswept floor; False if there is none."""
    rows, cols = sweeps.counts.shape
    count = total_y = total_x = 0
    for y in range(i << BLOCK, min((i + 1) << BLOCK, rows)):
        for x in range(j << BLOCK, min((j + 1) << BLOCK, cols)):
            if sweeps.counts[y, x] == 0:
                count += 1
                total_y += y
                total_x += x
    if count == 0:
        return False
    place[0], place[1] = total_y / count, total_x / count
    return True


@lean_inner_kernel
def nearest_place(places: NDArray[np.uint64], place: NDArray[np.float64], reach: int) -> bool:
    """Move a point to the nearest place within reach; False if there is none."""
    rows, cols = places.shape[0], places.shape[1] << 6
    i, j = int(place[0] + 0.5), int(place[1] + 0.5)
    best = (reach + 1) * (reach + 1)
    found = False
    for y in range(max(i - reach, 0), min(i + reach + 1, rows)):
        for x in range(max(j - reach, 0), min(j + reach + 1, cols)):
            square = (y - i) * (y - i) + (x - j) * (x - j)
            if square < best and is_marked(places, y, x):
                best = square
                place[0], place[1] = y, x
                found = True
    return found


@lean_inner_kernel
def _round_over(
    line: Line, floor: Floor, price: Price, memory: MoveMemory, begin: int, best: float
) -> tuple[float, int]:
    """Try five detours over ``memory.place`` from the edge after ``begin``.

    Returns:
        The best gain, at least ``best`` [s], and the number of points of that detour, which are in
        ``memory.best``; 0 if none is better.
    """
    points, new = line.points, memory.new
    end = line.next[begin]
    qy, qx = memory.place[0], memory.place[1]
    ay, ax, by, bx = points[begin, 0], points[begin, 1], points[end, 0], points[end, 1]
    dy, dx = by - ay, bx - ax
    length = np.sqrt(dy * dy + dx * dx)
    uy, ux = dy / length, dx / length
    along = min(max((qy - ay) * uy + (qx - ax) * ux, 0.0), length)
    counted = 0
    for way in range(5):
        if way == 0:  # by a corner
            new[0, 0], new[0, 1] = qy, qx
            count = 1
        elif way == 1:  # there and back from the nearest point
            if along < 1.0 or length - along < 1.0:
                continue
            new[0, 0], new[0, 1] = ay + along * uy, ax + along * ux
            new[1, 0], new[1, 1] = qy, qx
            copy_point(new, 0, new, 2)
            count = 3
        elif way == 2:  # by a bulge
            if along - SPREAD < 1.0 or along + SPREAD > length - 1.0:
                continue
            new[0, 0], new[0, 1] = ay + (along - SPREAD) * uy, ax + (along - SPREAD) * ux
            new[1, 0], new[1, 1] = qy, qx
            new[2, 0], new[2, 1] = ay + (along + SPREAD) * uy, ax + (along + SPREAD) * ux
            count = 3
        elif way == 3:  # there and back from its beginning
            new[0, 0], new[0, 1] = qy, qx
            new[1, 0], new[1, 1] = ay, ax
            count = 2
        else:  # and from its end
            new[0, 0], new[0, 1] = by, bx
            new[1, 0], new[1, 1] = qy, qx
            count = 2
        gain = gain_above(line, floor, price, memory, begin, end, count, LEAST_GAIN_S)
        if gain > best:
            best, counted = gain, count
            for number in range(count):
                copy_point(new, number, memory.best, number)
    return best, counted


@lean_inner_kernel
def detour(
    line: Line,
    floor: Floor,
    price: Price,
    memory: MoveMemory,
    begin: int,
    farthest: float,
    least: int,
) -> float:
    """Reroute the edge after ``begin`` over unswept floor nearby; return the gain [s].

    The block and its neighbours together must have ``least`` unswept pixels.
    """
    points, left = line.points, floor.sweeps.left
    end = line.next[begin]
    rows, cols = left.shape
    ay, ax, by, bx = points[begin, 0], points[begin, 1], points[end, 0], points[end, 1]
    best, count = 0.0, as_value(0)
    for i in range(
        max(int(min(ay, by) - farthest) >> BLOCK, 0),
        min((int(max(ay, by) + farthest) >> BLOCK) + 1, rows),
    ):
        for j in range(
            max(int(min(ax, bx) - farthest) >> BLOCK, 0),
            min((int(max(ax, bx) + farthest) >> BLOCK) + 1, cols),
        ):
            if left[i, j] < LEAST_LEFT:
                continue
            around = 0
            for y in range(max(i - 1, 0), min(i + 2, rows)):
                for x in range(max(j - 1, 0), min(j + 2, cols)):
                    around += left[y, x]
            if around < least or not middle_left(floor.sweeps, i, j, memory.place):
                continue
            if not nearest_place(floor.places, memory.place, int(floor.tool) + 2):
                continue
            best, better = _round_over(line, floor, price, memory, begin, best)
            count = better if better else count
    if not count:
        return 0.0
    for number in range(count):
        copy_point(memory.best, number, memory.new, number)
    replace_points(line, floor, memory, begin, end, count)
    return best


@kernel
def find_patches(sweeps: Sweeps, least: int) -> NDArray[np.bool_]:
    """Return the blocks with patches of at least ``least`` pixels, bool (rows, cols).

    Pixels of a patch are connected by their edges.
    """
    counts = sweeps.counts
    rows, cols = counts.shape
    found = np.zeros(sweeps.left.shape, np.bool_)
    is_new = np.empty((rows, cols), np.bool_)
    swept_never = 0
    for i in range(rows):
        for j in range(cols):
            is_new[i, j] = counts[i, j] == 0
            swept_never += is_new[i, j]
    waiting = np.empty(swept_never, np.int64)
    for start in range(rows * cols):
        if not is_new[start // cols, start % cols]:
            continue
        is_new[start // cols, start % cols] = False
        waiting[0] = start
        count, at = 1, 0
        while at < count:
            i, j = waiting[at] // cols, waiting[at] % cols
            at += 1
            for di, dj in ((0, 1), (0, -1), (1, 0), (-1, 0)):
                y, x = i + di, j + dj
                if 0 <= y < rows and 0 <= x < cols and is_new[y, x]:
                    is_new[y, x] = False
                    waiting[count] = y * cols + x
                    count += 1
        if count >= least:
            for number in range(count):
                i, j = waiting[number] // cols, waiting[number] % cols
                found[i >> BLOCK, j >> BLOCK] = True
    return found


@inlined
def _is_near(line: Line, begin: int, place: NDArray[np.float64], farthest: float) -> bool:
    """Return whether the edge after ``begin`` may come near a place."""
    a, b = line.points[begin], line.points[line.next[begin]]
    y, x = place[0], place[1]
    return bool(
        min(a[0], b[0]) - farthest <= y <= max(a[0], b[0]) + farthest
        and min(a[1], b[1]) - farthest <= x <= max(a[1], b[1]) + farthest
    )


@lean_kernel
def sweep_patches(
    line: Line,
    floor: Floor,
    price: Price,
    memory: MoveMemory,
    farthest: float,
    patches: NDArray[np.bool_],
    most_tried: int,
) -> None:
    """Reroute the line over patches, each from the edge where that is cheapest.

    Args:
        line, floor, memory, farthest: as for ``polish``.
        price: value of a pixel of a patch.
        patches: bool (rows, cols), of blocks, see ``find_patches``.
        most_tried: limit on the moves tried, earlier moves included.
    """
    place = memory.place
    for i in range(patches.shape[0]):
        for j in range(patches.shape[1]):
            if not patches[i, j] or not has_room(line) or line.state[TRIED] >= most_tried:
                continue
            if not middle_left(floor.sweeps, i, j, place):
                continue
            if not nearest_place(floor.places, place, int(floor.tool) + 2):
                continue
            best, count, at, begin = 0.0, as_value(0), as_value(0), as_value(0)
            while line.next[begin] != NONE:
                if _is_near(line, begin, place, farthest):
                    best, better = _round_over(line, floor, price, memory, begin, best)
                    if better:
                        count, at = better, begin
                begin = line.next[begin]
            if count:
                for number in range(count):
                    copy_point(memory.best, number, memory.new, number)
                replace_points(line, floor, memory, at, line.next[at], count)
