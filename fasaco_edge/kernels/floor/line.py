"""The driven line as a list of points: a change, if its gain is enough.

A change replaces the points between two others. Its gain is exact: seconds of the chains before
and after, with the turns at either end, and the difference in swept pixels.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.floor.capsule import is_clear
from fasaco_edge.kernels.floor.seconds import chain_s
from fasaco_edge.kernels.floor.sweeps import (
    BLOCK,
    Scratch,
    Sweeps,
    exchange,
    prepare,
    swept_more,
)
from fasaco_edge.kernels.floor.turning import Turning
from fasaco_edge.kernels.jit import inlined, lean_kernel

# No edge is shorter than this [pixels].
LEAST_EDGE = 0.3
# Limits on the points that a move removes and inserts.
MOST_NEW = 2
# Limit on the points of a chain: those replaced, and two on either side.
MOST_CHAIN = MOST_NEW + 4
# Limit on the capsules compared: edges of the chains before and after.
MOST_CAPSULES = 2 * (MOST_CHAIN - 1)
# Whether edges keep the robot's clearance is checked in pieces of at most this length [pixels].
PIECE = 4.0
NONE = -1


class Line(NamedTuple):
    """The driven line as a list of points.

    Attributes:
        points: float64 (capacity, 2): y, x [pixels]; the line begins with the first.
        next, previous: int32 (capacity,): the number of the next point, and of the one before;
            NONE at the ends.
        state: int64 (3,): points used, moves tried, and the head of the free list of point numbers,
            linked by ``next``; or NONE.
        is_end_fixed: whether the line's last point is fixed.
    """

    points: NDArray[np.float64]
    next: NDArray[np.int32]
    previous: NDArray[np.int32]
    state: NDArray[np.int64]
    is_end_fixed: bool


USED, TRIED, FREE = range(3)


class Floor(NamedTuple):
    """The floor below the line.

    Attributes:
        blocked: uint64 (rows, words), see ``bits``: pixels the robot must not touch.
        places: the same: reachable places of the robot.
        sweeps: sweeps by the line.
        robot, tool: their radii [pixels].
        clear: radius of the robot with its clearance [pixels].
    """

    blocked: NDArray[np.uint64]
    places: NDArray[np.uint64]
    sweeps: Sweeps
    robot: float
    tool: float
    clear: float


class Price(NamedTuple):
    """The objective: seconds for a pixel driven, for turns, for an unswept pixel, and additional
    seconds for a pixel driven without clearance."""

    drive_s: float
    turning: Turning
    left_s: float
    near_s: float


class Memory(NamedTuple):
    """Memory for a move: points before and after, float64 (MOST_CHAIN, 2), and the points to
    insert, float64 (MOST_NEW, 2)."""

    before: NDArray[np.float64]
    after: NDArray[np.float64]
    new: NDArray[np.float64]
    capsules: Scratch


@inlined
def copy_point(source: NDArray[np.float64], at: int, target: NDArray[np.float64], to: int) -> None:
    """Copy a point; numba would allocate for an assignment of rows."""
    target[to, 0], target[to, 1] = source[at, 0], source[at, 1]


@lean_kernel
def _left_around(
    left: NDArray[np.int32], points: NDArray[np.float64], first: int, last: int, tool: float
) -> int:
    """Return an upper bound on the unswept pixels under the edges from ``first`` to ``last``."""
    rows, cols = left.shape
    found = 0
    for number in range(first, last):
        ay, ax = points[number, 0], points[number, 1]
        by, bx = points[number + 1, 0], points[number + 1, 1]
        for i in range(
            max(int(min(ay, by) - tool) >> BLOCK, 0),
            min((int(max(ay, by) + tool) >> BLOCK) + 1, rows),
        ):
            for j in range(
                max(int(min(ax, bx) - tool) >> BLOCK, 0),
                min((int(max(ax, bx) + tool) >> BLOCK) + 1, cols),
            ):
                found += left[i, j]
    return found


@lean_kernel
def _chains(
    line: Line, memory: Memory, begin: int, end: int, count: int
) -> tuple[int, int, int, int, int]:
    """Copy the points replaced, before and after, with up to two on either side, to the memory.

    Returns:
        Number of the first point whose edge changes, as the one before it defines a turn; numbers
        of points before and after; numbers of the last point whose edge changes, before and after.
    """
    points, following, preceding = line.points, line.next, line.previous
    old, new = memory.before, memory.after
    lead = 0
    if preceding[begin] != NONE:
        copy_point(points, preceding[begin], old, 0)
        copy_point(old, 0, new, 0)
        lead = 1
    olds, news = lead, lead + 1
    number = begin
    while number != end:
        copy_point(points, number, old, olds)
        olds += 1
        number = following[number]
    copy_point(points, begin, new, lead)
    for place in range(count):
        copy_point(memory.new, place, new, news)
        news += 1
    tail = 0
    while number != NONE and tail < 2:
        copy_point(points, number, old, olds)
        copy_point(points, number, new, news)
        olds += 1
        news += 1
        tail += 1
        number = following[number]
    behind = max(tail - 1, 0)
    return lead, olds, news, olds - 1 - behind, news - 1 - behind


@lean_kernel
def _is_way(floor: Floor, points: NDArray[np.float64], first: int, last: int) -> bool:
    """Return whether the edges between two points of a chain are clear, and none is too short."""
    for number in range(first, last):
        ay, ax = points[number, 0], points[number, 1]
        by, bx = points[number + 1, 0], points[number + 1, 1]
        if abs(by - ay) + abs(bx - ax) < LEAST_EDGE:
            return False
        if not is_clear(floor.blocked, ay, ax, by, bx, floor.robot):
            return False
    return True


@lean_kernel
def _near_px(floor: Floor, points: NDArray[np.float64], first: int, last: int) -> float:
    """Return the length of a chain's edges without clearance [pixels], to a piece.

    A piece with more than half of the clearance counts half.
    """
    half = 0.5 * (floor.robot + floor.clear)
    length = 0.0
    for number in range(first, last):
        ay, ax = points[number, 0], points[number, 1]
        by, bx = points[number + 1, 0], points[number + 1, 1]
        if is_clear(floor.blocked, ay, ax, by, bx, floor.clear):
            continue
        edge = np.sqrt((by - ay) * (by - ay) + (bx - ax) * (bx - ax))
        parts = max(int(np.ceil(edge / PIECE)), 1)
        dy, dx = (by - ay) / parts, (bx - ax) / parts
        near = 0
        for part in range(parts):
            y, x = ay + part * dy, ax + part * dx
            if not is_clear(floor.blocked, y, x, y + dy, x + dx, floor.clear):
                near += 1
                near += not is_clear(floor.blocked, y, x, y + dy, x + dx, half)
        length += 0.5 * near * edge / parts
    return length


@lean_kernel
def _prepare_edges(
    scratch: Scratch, at: int, points: NDArray[np.float64], first: int, last: int, tool: float
) -> int:
    """Prepare the capsules of a chain's edges, from number ``at`` on; return how many."""
    for number in range(first, last):
        ay, ax = points[number, 0], points[number, 1]
        by, bx = points[number + 1, 0], points[number + 1, 1]
        prepare(scratch.capsules, at + number - first, ay, ax, by, bx, tool)
    return max(last - first, 0)


@inlined
def has_room(line: Line) -> bool:
    """Return whether there are free numbers for the points of a move."""
    return bool(line.state[USED] <= len(line.points) - MOST_NEW)


@lean_kernel
def _relink(line: Line, memory: Memory, begin: int, end: int, count: int) -> None:
    """Replace the points between two others by ``memory.new[:count]``; use their numbers again."""
    following, preceding, state = line.next, line.previous, line.state
    gone = following[begin]
    while gone != end:
        behind = following[gone]
        following[gone], state[FREE] = state[FREE], gone
        gone = behind
    last = begin
    for number in range(count):
        place = state[FREE]
        if place == NONE:
            place = state[USED]
            state[USED] += 1
        else:
            state[FREE] = following[place]
        copy_point(memory.new, number, line.points, place)
        following[last], preceding[place] = place, last
        last = place
    following[last] = end
    if end != NONE:
        preceding[end] = last


@lean_kernel
def replace_points(
    line: Line,
    floor: Floor,
    price: Price,
    memory: Memory,
    begin: int,
    end: int,
    count: int,
    least_s: float,
) -> float:
    """Replace the points between two others by ``memory.new[:count]``, if that gains enough.

    Args:
        line, floor, price, memory: see above.
        begin: number of the point before.
        end: number of the point after; NONE if the line ends with the new points.
        count: number of new points.
        least_s: the least gain, which may be below 0 [s].

    Returns:
        The gain [s]; -inf if it is less, or if the new edges are blocked.
    """
    if end == NONE and line.is_end_fixed:
        return -np.inf
    lead, olds, news, last_old, last_new = _chains(line, memory, begin, end, count)
    old, new, tool = memory.before, memory.after, floor.tool
    longer_s = chain_s(new, lead, last_new, news, price.drive_s, price.turning)
    longer_s -= chain_s(old, lead, last_old, olds, price.drive_s, price.turning)
    if floor.clear > floor.robot:
        nearer = _near_px(floor, new, lead, last_new) - _near_px(floor, old, lead, last_old)
        longer_s += price.near_s * nearer
    least_more = (longer_s + least_s) / price.left_s
    most_more = _left_around(floor.sweeps.left, new, lead, last_new, tool)
    if most_more < least_more or not _is_way(floor, new, lead, last_new):
        return -np.inf
    scratch = memory.capsules
    taken = _prepare_edges(scratch, 0, old, lead, last_old, tool)
    given = _prepare_edges(scratch, taken, new, lead, last_new, tool)
    most_lost = most_more - least_more
    more = swept_more(floor.sweeps.counts, scratch, taken, given, tool, most_lost)
    gain = price.left_s * more - longer_s
    if gain < least_s:
        return -np.inf
    exchange(floor.sweeps, scratch, taken, given, tool)
    _relink(line, memory, begin, end, count)
    return gain
