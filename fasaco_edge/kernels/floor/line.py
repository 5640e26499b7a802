"""The driven line as a list of points: gain of a change, and its execution.

A change replaces the points between two other points. Its gain is exact: seconds of the chains
before and after, with the turns at either end, and the difference in swept pixels. Each block of
pixels stores the time of the line's last change there.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.floor.capsule import is_clear, near_px
from fasaco_edge.kernels.floor.seconds import chain_s
from fasaco_edge.kernels.floor.sweeps import (
    BLOCK,
    Scratch,
    Sweeps,
    exchange,
    prepare,
    sweep,
    swept_more,
)
from fasaco_edge.kernels.floor.turning import Turning
from fasaco_edge.kernels.jit import as_value, inlined, lean_inner_kernel

# Least gain of a move [s]: rounding of sums must not cause cycles.
LEAST_GAIN_S = 1e-3
# No edge is shorter than this [pixels].
LEAST_EDGE = 0.3
# Limit on the points that a move inserts.
MOST_NEW = 4
# Limit on the points of a chain: the replaced points, and two on either side.
MOST_CHAIN = MOST_NEW + 4
# Limit on the capsules compared: edges of the chains before and after.
MOST_CAPSULES = 2 * (MOST_CHAIN - 1)
NONE = -1
# In place of a number of new points: the attempt is no move.
NO_MOVE = -1


class Line(NamedTuple):
    """The driven line as a list of points, with times of changes and of trials.

    Attributes:
        points: float64 (capacity, 2): y, x [pixels]; the line begins with the first.
        next, previous: int32 (capacity,): the number of the next point, and of the one before;
            NONE at the ends.
        seen: int64 (capacity,): when all moves at a point were last tried.
        changed: int64, by block: when the line was last changed there.
        state: int64 (4,): points used, the time, moves tried, and the head of the free list of
            point numbers, linked by ``next``; or NONE.
        is_end_fixed: whether the line's last point is fixed.
    """

    points: NDArray[np.float64]
    next: NDArray[np.int32]
    previous: NDArray[np.int32]
    seen: NDArray[np.int64]
    changed: NDArray[np.int64]
    state: NDArray[np.int64]
    is_end_fixed: bool


USED, TIME, TRIED, FREE = range(4)


class Floor(NamedTuple):
    """The floor below the line.

    Attributes:
        blocked: uint64 (rows, words), see ``bits``: pixels the robot must not touch.
        places: uint64 (rows, words): reachable places of the robot.
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


class MoveMemory(NamedTuple):
    """Memory for a move: points before and after, float64 (MOST_CHAIN, 2); the points to insert,
    the points of the best move so far, and a place, float64 (MOST_NEW, 2)."""

    before: NDArray[np.float64]
    after: NDArray[np.float64]
    new: NDArray[np.float64]
    best: NDArray[np.float64]
    place: NDArray[np.float64]
    capsules: Scratch


@inlined
def copy_point(source: NDArray[np.float64], at: int, target: NDArray[np.float64], to: int) -> None:
    """Copy a point; numba would allocate for an assignment of rows."""
    target[to, 0], target[to, 1] = source[at, 0], source[at, 1]


@lean_inner_kernel
def left_around(
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


class Chains(NamedTuple):
    """The points in ``MoveMemory.before`` and ``after``: replaced points, up to two beside.

    Attributes:
        lead: number of the first point whose edge changes; the point before it defines a turn.
        olds, news: numbers of points in ``before`` and ``after``; 0 if there are too many.
        last_old, last_new: the last point whose edge changes.
    """

    lead: int
    olds: int
    news: int
    last_old: int
    last_new: int


@lean_inner_kernel
def _chains(line: Line, memory: MoveMemory, begin: int, end: int, count: int) -> Chains:
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
        if olds == MOST_CHAIN - 2:
            return Chains(0, 0, 0, 0, 0)
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
    return Chains(lead, olds, news, olds - 1 - behind, news - 1 - behind)


@lean_inner_kernel
def is_way(floor: Floor, points: NDArray[np.float64], first: int, last: int) -> bool:
    """Return whether the edges between two points of a chain are clear, and none is too short."""
    for number in range(first, last):
        ay, ax = points[number, 0], points[number, 1]
        by, bx = points[number + 1, 0], points[number + 1, 1]
        if abs(by - ay) + abs(bx - ax) < LEAST_EDGE:
            return False
        if not is_clear(floor.blocked, ay, ax, by, bx, floor.robot):
            return False
    return True


@lean_inner_kernel
def prepare_edges(
    scratch: Scratch, at: int, points: NDArray[np.float64], first: int, last: int, tool: float
) -> int:
    """Prepare the capsules of a chain's edges, from number ``at`` on; return how many."""
    for number in range(first, last):
        ay, ax = points[number, 0], points[number, 1]
        by, bx = points[number + 1, 0], points[number + 1, 1]
        prepare(scratch.capsules, at + number - first, ay, ax, by, bx, tool)
    return max(last - first, 0)


@lean_inner_kernel
def gain_above(
    line: Line,
    floor: Floor,
    price: Price,
    memory: MoveMemory,
    begin: int,
    end: int,
    count: int,
    least_s: float,
) -> float:
    """Return the gain if ``memory.new[:count]`` replace the points between two others [s].

    Return -inf for a gain below ``least_s``, which may be negative, and if a new edge is blocked.

    Args:
        line, floor, price, memory: see above.
        begin: number of the point before the replaced ones.
        end: number of the point after them; NONE if the line ends with the new points.
        count: number of new points.
        least_s: see above.
    """
    line.state[TRIED] += 1
    if end == NONE and line.is_end_fixed:
        return -np.inf
    lead, olds, news, last_old, last_new = _chains(line, memory, begin, end, count)
    if not olds:
        return -np.inf
    old, new, tool = memory.before, memory.after, floor.tool
    longer_s = chain_s(new, lead, last_new, news, price.drive_s, price.turning)
    longer_s -= chain_s(old, lead, last_old, olds, price.drive_s, price.turning)
    if floor.clear > floor.robot:
        nearer = near_px(floor.blocked, new, lead, last_new, floor.robot, floor.clear)
        nearer -= near_px(floor.blocked, old, lead, last_old, floor.robot, floor.clear)
        longer_s += price.near_s * nearer
    least_more = (longer_s + least_s) / price.left_s
    most_more = left_around(floor.sweeps.left, new, lead, last_new, tool)
    if most_more < least_more or not is_way(floor, new, lead, last_new):
        return -np.inf
    scratch = memory.capsules
    taken = prepare_edges(scratch, 0, old, lead, last_old, tool)
    given = prepare_edges(scratch, taken, new, lead, last_new, tool)
    most_lost = most_more - least_more
    more = swept_more(floor.sweeps.counts, scratch, taken, given, tool, most_lost)
    gain = price.left_s * more - longer_s
    return gain if gain >= least_s else -np.inf


@lean_inner_kernel
def note_change(line: Line, begin: int, tool: float, hops: int, now: int) -> int:
    """Return when the line was last changed around some points, beginning with the point before
    ``begin``; if ``now`` is above 0, also note a change there."""
    points = line.points
    number = line.previous[begin] if line.previous[begin] != NONE else begin
    low_y, low_x = points[number, 0], points[number, 1]
    high_y, high_x = low_y, low_x
    for _ in range(hops):
        if number == NONE:
            break
        y, x = points[number, 0], points[number, 1]
        low_y, high_y = min(low_y, y), max(high_y, y)
        low_x, high_x = min(low_x, x), max(high_x, x)
        number = line.next[number]
    newest = 0
    rows, cols = line.changed.shape
    for i in range(
        max(int(low_y - tool) >> BLOCK, 0), min((int(high_y + tool) >> BLOCK) + 1, rows)
    ):
        for j in range(
            max(int(low_x - tool) >> BLOCK, 0), min((int(high_x + tool) >> BLOCK) + 1, cols)
        ):
            if now > 0:
                line.changed[i, j] = now
            newest = max(newest, line.changed[i, j])
    return newest


# A change affects the moves at this many points before and after it.
HOPS = 6


@inlined
def has_room(line: Line) -> bool:
    """Return whether there are free numbers for the points of a move."""
    return bool(line.state[USED] <= len(line.points) - MOST_NEW)


@lean_inner_kernel
def _sweep_between(
    line: Line, floor: Floor, memory: MoveMemory, begin: int, end: int, times: int
) -> None:
    """Add the edges between two points to the counts (``times`` 1) or remove them (-1)."""
    points, following = line.points, line.next
    number = begin
    while number != end and following[number] != NONE:
        a, b = points[number], points[following[number]]
        sweep(floor.sweeps, a[0], a[1], b[0], b[1], floor.tool, times, memory.capsules)
        number = following[number]


@lean_inner_kernel
def replace_points(
    line: Line, floor: Floor, memory: MoveMemory, begin: int, end: int, count: int
) -> None:
    """Replace the points between two others by ``memory.new[:count]``."""
    points, following, preceding, tool = line.points, line.next, line.previous, floor.tool
    line.state[TIME] += 1
    note_change(line, begin, tool, HOPS, line.state[TIME])
    lead, olds, _, last_old, last_new = _chains(line, memory, begin, end, count)
    if olds:
        scratch = memory.capsules
        taken = prepare_edges(scratch, 0, memory.before, lead, last_old, tool)
        given = prepare_edges(scratch, taken, memory.after, lead, last_new, tool)
        exchange(floor.sweeps, scratch, taken, given, tool)
    else:
        _sweep_between(line, floor, memory, begin, end, as_value(-1))
    # New points take the numbers of the replaced points first, then free numbers. So a number that
    # a caller holds belongs to the same or to a new point.
    free, last = following[begin], begin
    for number in range(count):
        if free != end and free != NONE:  # noqa: PLR1714 - numba has no `in` for tuples
            place, free = free, following[free]
        elif line.state[FREE] != NONE and line.state[USED] >= len(points) - 2 * MOST_NEW:
            place = np.int32(line.state[FREE])
            line.state[FREE] = following[place]
        else:
            place = np.int32(line.state[USED])
            line.state[USED] += 1
        copy_point(memory.new, number, points, place)
        line.seen[place] = 0
        following[last], preceding[place] = place, last
        last = place
    while free != end and free != NONE:  # noqa: PLR1714
        gone, free = free, following[free]
        following[gone] = line.state[FREE]
        line.state[FREE] = gone
    following[last] = end
    if end != NONE:
        preceding[end] = last
    if not olds:
        _sweep_between(line, floor, memory, begin, end, as_value(1))
    line.state[TIME] += 1
    note_change(line, begin, tool, HOPS, line.state[TIME])
