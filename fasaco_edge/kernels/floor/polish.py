"""Polish: greedy descent of the driven line on driving time plus a price of unswept floor.

Four moves are tried at each point of the line in turn: remove the next one or two points, move the
next point, shift the edge after it as a whole, and reroute the edge before it over unswept floor
nearby. A move is made if it gains. A point is skipped if nothing near it has changed since it was
last tried.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.floor.detour import detour
from fasaco_edge.kernels.floor.line import (
    HOPS,
    NONE,
    TIME,
    TRIED,
    Floor,
    Line,
    Memory,
    Price,
    gain_of,
    has_room,
    note_change,
    replace_points,
)
from fasaco_edge.kernels.jit import as_value, inlined, lean_kernel

# A pass that gains less is the last [s].
LEAST_PASS_S = 0.2
# Lengths by which points are moved and edges shifted, in turn [pixels].
SHIFTS = (1.0, -1.0, 2.0, -2.0, 4.0, -4.0, 7.0, -7.0)
HALF_ROOT = 0.7071067811865476
# Points move along both axes, both diagonals, and their two edges.
DIRECTIONS = ((1.0, 0.0), (0.0, 1.0), (HALF_ROOT, HALF_ROOT), (HALF_ROOT, -HALF_ROOT))
# Longest move of a point to a crossing of lines, and longest slide of an edge's end.
FARTHEST_MEETING, FARTHEST_SLIDE = 16.0, 12.0
# Least value of unswept floor around a block for a detour [s].
LEAST_WORTH_S = 0.3


@inlined
def meeting(
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
    """Remove the next point, or the next two, while that gains; return the gain [s]."""
    gained = 0.0
    while line.next[begin] != NONE:
        end, gain = line.next[begin], 0.0
        for _ in range(2):
            end = line.next[end]
            gain = gain_of(line, floor, price, memory, begin, end, as_value(0))
            if gain > 0.0 or end == NONE:
                break
        if gain == 0.0:
            break
        replace_points(line, floor, memory, begin, end, as_value(0))
        gained += gain
    return gained


@lean_kernel
def _move(line: Line, floor: Floor, price: Price, memory: Memory, begin: int) -> float:
    """Move the point after ``begin``; return the gain [s]."""
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
            gain = gain_of(line, floor, price, memory, begin, end, as_value(1))
            if gain > 0.0:
                replace_points(line, floor, memory, begin, end, as_value(1))
                gained += gain
                break
    if end == NONE or preceding[begin] == NONE or following[end] == NONE:
        return gained
    first, last = points[preceding[begin]], points[following[end]]
    ay, ax = points[begin, 0], points[begin, 1]
    if meeting(first[0], first[1], ay, ax, points[end], last, memory.place):
        dy = memory.place[0] - points[middle, 0]
        dx = memory.place[1] - points[middle, 1]
        if dy * dy + dx * dx <= FARTHEST_MEETING * FARTHEST_MEETING:
            new[0, 0], new[0, 1] = memory.place[0], memory.place[1]
            gain = gain_of(line, floor, price, memory, begin, end, as_value(1))
            if gain > 0.0:
                replace_points(line, floor, memory, begin, end, as_value(1))
                gained += gain
    return gained


@lean_kernel
def slide(
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
    if not meeting(ay, ax, by, bx, a, b, memory.place):
        return False
    dy, dx = memory.place[0] - place[0], memory.place[1] - place[1]
    if not 1e-4 < dy * dy + dx * dx < FARTHEST_SLIDE * FARTHEST_SLIDE:
        return False
    place[0], place[1] = memory.place[0], memory.place[1]
    return True


@lean_kernel
def _shift(line: Line, floor: Floor, price: Price, memory: Memory, begin: int) -> float:
    """Shift the edge after ``begin``'s next point as a whole; return the gain [s]."""
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
                moved = slide(new[0], points[begin], points[a], memory, ay, ax, by, bx)
                if end != NONE:
                    moved |= slide(new[1], points[b], points[end], memory, ay, ax, by, bx)
                if not moved:
                    continue
            gain = gain_of(line, floor, price, memory, begin, end, as_value(2))
            if gain > 0.0:
                replace_points(line, floor, memory, begin, end, as_value(2))
                gained += gain
                break
    return gained


@lean_kernel
def polish(
    line: Line, floor: Floor, price: Price, memory: Memory, farthest: float, most_tried: int
) -> float:
    """Polish a line until no move gains, or a number of moves were tried.

    Args:
        line: counted into ``floor.sweeps``.
        floor, price, memory: see above.
        farthest: unswept floor further from an edge is ignored [pixels].
        most_tried: limit on the moves tried.

    Returns:
        The total gain [s].
    """
    gained = 0.0
    least = int(LEAST_WORTH_S / price.left_s) + 1
    passes = 0
    while True:
        pass_s = 0.0
        begin = as_value(0)
        while line.next[begin] != NONE and has_room(line):
            if line.state[TRIED] >= most_tried:
                return gained + pass_s
            if line.seen[begin] > 0 and (
                note_change(line, begin, floor.tool + 1.0, HOPS, as_value(0)) <= line.seen[begin]
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
            # Detours follow once the other moves have converged, otherwise they would stay.
            if passes > 0:
                gain += detour(line, floor, price, memory, begin, farthest, least)
            elif gain == 0.0:
                line.seen[begin] = 0
            pass_s += gain
            begin = line.next[begin]
        gained += pass_s
        passes += 1
        if passes > 1 and pass_s < LEAST_PASS_S:
            return gained
