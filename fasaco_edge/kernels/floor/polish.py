"""Polish: greedy changes of the driven line, to lower driving time plus a price of unswept floor.

Four moves are tried at each point of the line in turn: remove the next one or two points, move the
next point, shift the edge after it as a whole, and reroute the edge before it over unswept floor
nearby. A move is made if it gains. A point is skipped if nothing near it has changed since its last
trial.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.floor.detour import detour
from fasaco_edge.kernels.floor.line import (
    HOPS,
    LEAST_GAIN_S,
    NO_MOVE,
    NONE,
    TIME,
    TRIED,
    Floor,
    Line,
    MoveMemory,
    Price,
    gain_above,
    has_room,
    note_change,
    replace_points,
)
from fasaco_edge.kernels.jit import as_value, inlined, lean_inner_kernel, lean_kernel

# A pass that gains less is the last [s].
LEAST_PASS_S = 0.2
# Lengths by which points are moved and edges shifted, in turn [pixels].
SHIFTS = (1.0, -1.0, 2.0, -2.0, 4.0, -4.0, 7.0, -7.0)
HALF_ROOT = 0.7071067811865476
# Points move along both axes, both diagonals, and their two edges.
DIRECTIONS = ((1.0, 0.0), (0.0, 1.0), (HALF_ROOT, HALF_ROOT), (HALF_ROOT, -HALF_ROOT))
# Numbers of the attempts at a point: 0 and 1 leave out the next point, or the next two; from MOVES
# on the next point moves; MEETING moves it to a crossing of lines; all above shift the edge beyond.
MOVES = 2
MEETING = MOVES + (len(DIRECTIONS) + 2) * len(SHIFTS)
ATTEMPTS = MEETING + 1 + 2 * len(SHIFTS)
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


@lean_inner_kernel
def _move(line: Line, memory: MoveMemory, begin: int, attempt: int) -> tuple[int, int]:
    """Move the point after ``begin`` by a shift in one of six directions."""
    points, new = line.points, memory.new
    middle = line.next[begin]
    end = line.next[middle]
    direction = attempt // len(SHIFTS)
    if direction < len(DIRECTIONS):
        dy, dx = DIRECTIONS[direction]
    else:
        other = begin if direction == len(DIRECTIONS) else end
        if other == NONE:
            return NO_MOVE, end
        dy, dx = points[other, 0] - points[middle, 0], points[other, 1] - points[middle, 1]
        length = np.sqrt(dy * dy + dx * dx)
        dy, dx = dy / length, dx / length
    shift = SHIFTS[attempt % len(SHIFTS)]
    new[0, 0] = points[middle, 0] + shift * dy
    new[0, 1] = points[middle, 1] + shift * dx
    return 1, end


@lean_inner_kernel
def _move_to_meeting(line: Line, memory: MoveMemory, begin: int) -> tuple[int, int]:
    """Move the point after ``begin`` to the crossing of the edges before and after its own two."""
    points, following, preceding, new = line.points, line.next, line.previous, memory.new
    middle = following[begin]
    end = following[middle]
    if end == NONE or preceding[begin] == NONE or following[end] == NONE:
        return NO_MOVE, end
    first, last = points[preceding[begin]], points[following[end]]
    ay, ax = points[begin, 0], points[begin, 1]
    if not meeting(first[0], first[1], ay, ax, points[end], last, memory.place):
        return NO_MOVE, end
    dy = memory.place[0] - points[middle, 0]
    dx = memory.place[1] - points[middle, 1]
    if dy * dy + dx * dx > FARTHEST_MEETING * FARTHEST_MEETING:
        return NO_MOVE, end
    new[0, 0], new[0, 1] = memory.place[0], memory.place[1]
    return 1, end


@lean_inner_kernel
def slide(
    place: NDArray[np.float64],
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    memory: MoveMemory,
    ay: float,
    ax: float,
    by: float,
    bx: float,
) -> bool:
    """Slide ``place``, an end of the shifted edge from (ay, ax) to (by, bx), along that edge to the
    line through a and b, the neighbouring edge; return whether it moved."""
    if not meeting(ay, ax, by, bx, a, b, memory.place):
        return False
    dy, dx = memory.place[0] - place[0], memory.place[1] - place[1]
    if not 1e-4 < dy * dy + dx * dx < FARTHEST_SLIDE * FARTHEST_SLIDE:
        return False
    place[0], place[1] = memory.place[0], memory.place[1]
    return True


@lean_inner_kernel
def _shift(line: Line, memory: MoveMemory, begin: int, attempt: int) -> tuple[int, int]:
    """Shift the edge after ``begin``'s next point; then also slide its ends."""
    points, following, new = line.points, line.next, memory.new
    a = following[begin]
    b = following[a]
    if b == NONE:
        return NO_MOVE, b
    end = following[b]
    shift = SHIFTS[attempt % len(SHIFTS)]
    dy, dx = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    length = np.sqrt(dy * dy + dx * dx)
    dy, dx = -shift * dx / length, shift * dy / length
    ay, ax = points[a, 0] + dy, points[a, 1] + dx
    by, bx = points[b, 0] + dy, points[b, 1] + dx
    new[0, 0], new[0, 1], new[1, 0], new[1, 1] = ay, ax, by, bx
    if attempt >= len(SHIFTS):
        moved = slide(new[0], points[begin], points[a], memory, ay, ax, by, bx)
        if end != NONE:
            moved |= slide(new[1], points[b], points[end], memory, ay, ax, by, bx)
        if not moved:
            return NO_MOVE, end
    return 2, end


@lean_inner_kernel
def _propose(line: Line, memory: MoveMemory, begin: int, attempt: int) -> tuple[int, int]:
    """Write the points of an attempt at a point into ``memory.new``.

    Returns:
        Number of points to insert, or NO_MOVE; and the point after them.
    """
    if attempt < MOVES:
        end = line.next[line.next[begin]]
        if attempt == 0:
            return 0, end
        return (NO_MOVE, end) if end == NONE else (0, line.next[end])
    if attempt < MEETING:
        return _move(line, memory, begin, attempt - MOVES)
    if attempt == MEETING:
        return _move_to_meeting(line, memory, begin)
    return _shift(line, memory, begin, attempt - MEETING - 1)


@inlined
def _after_gain(attempt: int) -> int:
    """Return the attempt to make after one that gained."""
    if attempt < MOVES:
        return 0
    first = MOVES if attempt < MEETING else MEETING + 1
    # A point or an edge is moved once in each direction.
    return attempt + len(SHIFTS) - (attempt - first) % len(SHIFTS) if attempt != MEETING else first


@lean_kernel
def polish(
    line: Line, floor: Floor, price: Price, memory: MoveMemory, farthest: float, most_tried: int
) -> float:
    """Polish a line until no move gains, or a number of moves were tried.

    Args:
        line: its sweeps are counted in ``floor.sweeps``.
        floor, price, memory: see ``kernels.floor.line``.
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
            gain, attempt = 0.0, as_value(0)
            while attempt < ATTEMPTS and line.next[begin] != NONE:
                count, end = _propose(line, memory, begin, attempt)
                more = -np.inf
                if count != NO_MOVE:
                    more = gain_above(line, floor, price, memory, begin, end, count, LEAST_GAIN_S)
                attempt = _after_gain(attempt) if more > 0.0 else attempt + 1
                if more > 0.0:
                    replace_points(line, floor, memory, begin, end, count)
                    gain += more
            if line.next[begin] == NONE:
                pass_s += gain
                break
            # Detours are added last: the other moves cannot remove a needless detour.
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
