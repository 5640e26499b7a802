"""Polish: greedy descent of the driven line on seconds to drive plus a price of unswept floor.

Five moves are tried at each point of the line in turn: leave the next one or two points out, move
the next point, shift the edge behind it as a whole, and lead the edge before it round over what is
left nearby. A move is made if it gains. Where nothing has changed since a point was looked at, it
is not looked at again.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.floor.capsule import BLOCK, Sweeps
from fasaco_edge.kernels.floor.line import (
    HOPS,
    MOST_NEW,
    NONE,
    TIME,
    TRIED,
    USED,
    Floor,
    Line,
    Memory,
    Price,
    copy_point,
    gain_of,
    note_change,
    replace_points,
)
from fasaco_edge.kernels.jit import inlined, lean_kernel

# A pass that gains less is the last [s].
LEAST_PASS_S = 0.2
# So far a point is moved and an edge is shifted, in turn [pixels].
SHIFTS = (1.0, -1.0, 2.0, -2.0, 4.0, -4.0, 7.0, -7.0)
HALF_ROOT = 0.7071067811865476
# Points move along both axes, both diagonals, and their two edges.
DIRECTIONS = ((1.0, 0.0), (0.0, 1.0), (HALF_ROOT, HALF_ROOT), (HALF_ROOT, -HALF_ROOT))
# Where lines meet, a point moves at most so far, and the end of an edge slides at most so far.
FARTHEST_MEETING, FARTHEST_SLIDE = 16.0, 12.0
# A detour leaves its edge so far before, and joins it so far behind [pixels].
SPREAD = 6.0
# What is left of a block is no reason for a detour if it is less [pixels], or if it is worth less
# with all around it [s].
LEAST_LEFT, LEAST_WORTH_S = 3, 0.3


@inlined
def _meeting(
    py: float,
    px: float,
    qy: float,
    qx: float,
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    place: NDArray[np.float64],
) -> bool:
    """Find where the line through p and q meets the one through a and b; False if near parallel."""
    uy, ux, vy, vx = qy - py, qx - px, b[0] - a[0], b[1] - a[1]
    across = uy * vx - ux * vy
    size = np.sqrt((uy * uy + ux * ux) * (vy * vy + vx * vx))
    if size < 1e-9 or abs(across) < 0.2 * size:
        return False
    along = ((a[0] - py) * vx - (a[1] - px) * vy) / across
    place[0], place[1] = py + along * uy, px + along * ux
    return True


@lean_kernel
def _leave_out(line: Line, floor: Floor, price: Price, memory: Memory, begin: int) -> float:
    """Leave out the next point, or the next two, while that gains; return what it gained [s]."""
    gained = 0.0
    while line.next[begin] != NONE:
        end, gain = line.next[begin], 0.0
        for _ in range(2):
            end = line.next[end]
            gain = gain_of(line, floor, price, memory, begin, end, 0)
            if gain > 0.0 or end == NONE:
                break
        if gain == 0.0:
            break
        replace_points(line, floor, memory, begin, end, 0)
        gained += gain
    return gained


@lean_kernel
def _move(line: Line, floor: Floor, price: Price, memory: Memory, begin: int) -> float:
    """Move the point behind ``begin``; return what it gained [s]."""
    points, following, preceding, new = line.points, line.next, line.previous, memory.new
    middle = following[begin]
    end = following[middle]
    gained = 0.0
    for direction in range(6):
        if direction < 4:
            dy, dx = DIRECTIONS[direction]
        else:
            other = begin if direction == 4 else end
            if other == NONE:
                continue
            dy, dx = points[other, 0] - points[middle, 0], points[other, 1] - points[middle, 1]
            length = np.sqrt(dy * dy + dx * dx)
            dy, dx = dy / length, dx / length
        for shift in SHIFTS:
            new[0, 0] = points[middle, 0] + shift * dy
            new[0, 1] = points[middle, 1] + shift * dx
            gain = gain_of(line, floor, price, memory, begin, end, 1)
            if gain > 0.0:
                replace_points(line, floor, memory, begin, end, 1)
                gained += gain
                break
    if end == NONE or preceding[begin] == NONE or following[end] == NONE:
        return gained
    first, last = points[preceding[begin]], points[following[end]]
    ay, ax = points[begin, 0], points[begin, 1]
    if _meeting(first[0], first[1], ay, ax, points[end], last, memory.place):
        dy = memory.place[0] - points[middle, 0]
        dx = memory.place[1] - points[middle, 1]
        if dy * dy + dx * dx <= FARTHEST_MEETING * FARTHEST_MEETING:
            new[0, 0], new[0, 1] = memory.place[0], memory.place[1]
            gain = gain_of(line, floor, price, memory, begin, end, 1)
            if gain > 0.0:
                replace_points(line, floor, memory, begin, end, 1)
                gained += gain
    return gained


@lean_kernel
def _slide(
    place: NDArray[np.float64],
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    memory: Memory,
    ay: float,
    ax: float,
    by: float,
    bx: float,
) -> bool:
    """Slide an end of a shifted edge, which lies on the line a to b, onto its neighbour's line."""
    if not _meeting(ay, ax, by, bx, a, b, memory.place):
        return False
    dy, dx = memory.place[0] - place[0], memory.place[1] - place[1]
    if not 1e-4 < dy * dy + dx * dx < FARTHEST_SLIDE * FARTHEST_SLIDE:
        return False
    place[0], place[1] = memory.place[0], memory.place[1]
    return True


@lean_kernel
def _shift(line: Line, floor: Floor, price: Price, memory: Memory, begin: int) -> float:
    """Shift the edge behind ``begin``'s next point as a whole; return what it gained [s]."""
    points, following, new = line.points, line.next, memory.new
    gained = 0.0
    for slides in range(2):
        for shift in SHIFTS:
            a = following[begin]
            b = following[a]
            end = following[b]
            dy, dx = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
            length = np.sqrt(dy * dy + dx * dx)
            dy, dx = -shift * dx / length, shift * dy / length
            ay, ax = points[a, 0] + dy, points[a, 1] + dx
            by, bx = points[b, 0] + dy, points[b, 1] + dx
            new[0, 0], new[0, 1], new[1, 0], new[1, 1] = ay, ax, by, bx
            if slides:
                moved = _slide(new[0], points[begin], points[a], memory, ay, ax, by, bx)
                if end != NONE:
                    moved |= _slide(new[1], points[b], points[end], memory, ay, ax, by, bx)
                if not moved:
                    continue
            gain = gain_of(line, floor, price, memory, begin, end, 2)
            if gain > 0.0:
                replace_points(line, floor, memory, begin, end, 2)
                gained += gain
                break
    return gained


@lean_kernel
def _middle_left(sweeps: Sweeps, i: int, j: int, place: NDArray[np.float64]) -> bool:
    """Find the middle of what is left of a block; False where nothing is."""
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


@lean_kernel
def _nearest_place(places: NDArray[np.bool_], place: NDArray[np.float64], reach: int) -> bool:
    """Move a point to the nearest place within reach; False where there is none."""
    rows, cols = places.shape
    i, j = int(place[0] + 0.5), int(place[1] + 0.5)
    best = (reach + 1) * (reach + 1)
    found = False
    for y in range(max(i - reach, 0), min(i + reach + 1, rows)):
        for x in range(max(j - reach, 0), min(j + reach + 1, cols)):
            square = (y - i) * (y - i) + (x - j) * (x - j)
            if places[y, x] and square < best:
                best = square
                place[0], place[1] = y, x
                found = True
    return found


@lean_kernel
def _round_over(
    line: Line, floor: Floor, price: Price, memory: Memory, begin: int, best: float
) -> tuple[float, int]:
    """Try five ways round over ``memory.place`` from the edge behind ``begin``.

    Returns:
        What the best gains, no less than ``best`` [s], and how many points it has, in
        ``memory.best``; 0 points where none is better.
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
        gain = gain_of(line, floor, price, memory, begin, end, count)
        if gain > best:
            best, counted = gain, count
            for number in range(count):
                copy_point(new, number, memory.best, number)
    return best, counted


@lean_kernel
def _detour(
    line: Line,
    floor: Floor,
    price: Price,
    memory: Memory,
    begin: int,
    farthest: float,
    least: int,
) -> float:
    """Lead the edge behind ``begin`` round over what is left nearby; return the gain [s].

    ``least`` pixels have to be left of a block and of those around it.
    """
    points, left = line.points, floor.sweeps.left
    end = line.next[begin]
    rows, cols = left.shape
    ay, ax, by, bx = points[begin, 0], points[begin, 1], points[end, 0], points[end, 1]
    best, count = 0.0, 0
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
            if around < least or not _middle_left(floor.sweeps, i, j, memory.place):
                continue
            if not _nearest_place(floor.places, memory.place, int(floor.tool) + 2):
                continue
            best, better = _round_over(line, floor, price, memory, begin, best)
            count = better if better else count
    if not count:
        return 0.0
    for number in range(count):
        copy_point(memory.best, number, memory.new, number)
    replace_points(line, floor, memory, begin, end, count)
    return best


@lean_kernel
def polish(
    line: Line, floor: Floor, price: Price, memory: Memory, farthest: float, most_tried: int
) -> float:
    """Polish a line until nothing gains any more, or so many moves were tried.

    Args:
        line: counted into ``floor.sweeps``.
        floor, price, memory: see above.
        farthest: what is left further from an edge is not looked at [pixels].
        most_tried: moves.

    Returns:
        What it gained in all [s].
    """
    gained = 0.0
    least = int(LEAST_WORTH_S / price.left_s) + 1
    spare = len(line.points) - 2 * MOST_NEW
    passes = 0
    while True:
        pass_s = 0.0
        begin = 0
        while line.next[begin] != NONE and line.state[USED] < spare:
            if line.state[TRIED] >= most_tried:
                return gained + pass_s
            if line.seen[begin] > 0 and (
                note_change(line, begin, floor.tool + 1.0, HOPS, 0) <= line.seen[begin]
            ):
                begin = line.next[begin]
                continue
            line.state[TIME] += 1
            line.seen[begin] = line.state[TIME]
            gain = _leave_out(line, floor, price, memory, begin)
            if line.next[begin] == NONE:
                pass_s += gain
                break
            gain += _move(line, floor, price, memory, begin)
            if line.next[line.next[begin]] != NONE:
                gain += _shift(line, floor, price, memory, begin)
            # Detours come once all has found its place, or they would stay.
            if passes > 0:
                gain += _detour(line, floor, price, memory, begin, farthest, least)
            elif gain == 0.0:
                line.seen[begin] = 0
            pass_s += gain
            begin = line.next[begin]
        gained += pass_s
        passes += 1
        if passes > 1 and pass_s < LEAST_PASS_S:
            return gained


@lean_kernel
def sweep_patches(
    line: Line, floor: Floor, price: Price, memory: Memory, farthest: float, least: int
) -> None:
    """Lead the line over what is left in patches, at a price for these alone.

    Args:
        line, floor, memory, farthest: as for ``polish``.
        price: what a pixel of a patch is worth.
        least: so many pixels are a patch.
    """
    spare = len(line.points) - 2 * MOST_NEW
    begin = 0
    while line.next[begin] != NONE and line.state[USED] < spare:
        _detour(line, floor, price, memory, begin, farthest, least)
        begin = line.next[begin]
