"""Reordering of the driven line: its parts are driven in another order.

Annealing changes the shape of the line and keeps its order. Here a new edge joins two points
nearby, and a stretch of the line is reversed (2-opt) or moved elsewhere (or-opt): ways between
lanes get shorter and cross less. Two or three edges are replaced, all others stay, some in the
opposite direction. The gain is exact, as in ``line``. Only moves that gain are made: accepting
losses, as annealing does, gained nothing more.

Sources: G. A. Croes, A method for solving traveling-salesman problems, 1958 (2-opt); I. Or,
Traveling salesman-type combinatorial problems, 1976 (or-opt).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.floor.capsule import near_px
from fasaco_edge.kernels.floor.line import (
    LEAST_GAIN_S,
    NONE,
    Floor,
    Line,
    MoveMemory,
    Price,
    copy_point,
    is_way,
    left_around,
    prepare_edges,
)
from fasaco_edge.kernels.floor.seconds import edge_s, turn_s
from fasaco_edge.kernels.floor.sweeps import exchange, swept_more
from fasaco_edge.kernels.jit import inlined, kernel, lean_inner_kernel
from fasaco_edge.kernels.random import draw


class Exchange(NamedTuple):
    """Edges of a line, and the edges that replace them.

    Attributes:
        olds, news: int64 (3, 4), four points for each edge: the point before it, its two ends, and
            the point after it; NONE beyond the line's ends. There is no edge if its second end is
            NONE.
        size: int64 (1,): number of edges in each.
    """

    olds: NDArray[np.int64]
    news: NDArray[np.int64]
    size: NDArray[np.int64]


@inlined
def _set(quads: NDArray[np.int64], number: int, before: int, a: int, b: int, behind: int) -> None:
    quads[number, 0], quads[number, 1], quads[number, 2], quads[number, 3] = before, a, b, behind


@inlined
def _behind(line: Line, number: int) -> int:
    return NONE if number == NONE else line.next[number]


@lean_inner_kernel
def _seconds(
    points: NDArray[np.float64], quads: NDArray[np.int64], count: int, price: Price
) -> float:
    """Return the seconds of edges, with the turns at their ends."""
    seconds = 0.0
    for number in range(count):
        quad = quads[number]
        before, a, b, behind = quad[0], quad[1], quad[2], quad[3]
        if b == NONE:
            continue
        seconds += edge_s(points, a, b, price.drive_s)
        if before != NONE:
            seconds += turn_s(points, before, a, b, price.turning)
        if behind != NONE:
            seconds += turn_s(points, a, b, behind, price.turning)
    return seconds


@lean_inner_kernel
def _copy_edges(
    points: NDArray[np.float64], quads: NDArray[np.int64], count: int, ends: NDArray[np.float64]
) -> int:
    """Copy the ends of edges, one edge after the other; return how many points there are."""
    copied = 0
    for number in range(count):
        if quads[number, 2] != NONE:
            copy_point(points, quads[number, 1], ends, copied)
            copy_point(points, quads[number, 2], ends, copied + 1)
            copied += 2
    return copied


@lean_inner_kernel
def _prepare(floor: Floor, memory: MoveMemory, olds: int, news: int) -> tuple[int, int]:
    """Prepare the capsules of the copied edges; return the numbers of old and of new capsules."""
    scratch, taken, given = memory.capsules, 0, 0
    for at in range(0, olds, 2):
        taken += prepare_edges(scratch, taken, memory.before, at, at + 1, floor.tool)
    for at in range(0, news, 2):
        given += prepare_edges(scratch, taken + given, memory.after, at, at + 1, floor.tool)
    return taken, given


@lean_inner_kernel
def _near_px(floor: Floor, ends: NDArray[np.float64], count: int) -> float:
    length = 0.0
    for at in range(0, count, 2):
        length += near_px(floor.blocked, ends, at, at + 1, floor.robot, floor.clear)
    return length


@lean_inner_kernel
def _gain(line: Line, floor: Floor, price: Price, memory: MoveMemory, edges: Exchange) -> float:
    """Return the gain of an exchange [s]; 0.0 if nothing is gained, if an edge is blocked, or if
    there is a gain only because the new edges keep farther from walls."""
    points, old, new, count = line.points, memory.before, memory.after, edges.size[0]
    longer_s = _seconds(points, edges.news, count, price)
    longer_s -= _seconds(points, edges.olds, count, price)
    news = _copy_edges(points, edges.news, count, new)
    most_more = 0
    for at in range(0, news, 2):
        most_more += left_around(floor.sweeps.left, new, at, at + 1, floor.tool)
    if price.left_s * most_more - longer_s < LEAST_GAIN_S:
        return 0.0
    for at in range(0, news, 2):
        if not is_way(floor, new, at, at + 1):
            return 0.0
    olds = _copy_edges(points, edges.olds, count, old)
    if floor.clear > floor.robot:
        longer_s += price.near_s * (_near_px(floor, new, news) - _near_px(floor, old, olds))
    taken, given = _prepare(floor, memory, olds, news)
    most_lost = most_more - (longer_s + LEAST_GAIN_S) / price.left_s
    more = swept_more(floor.sweeps.counts, memory.capsules, taken, given, floor.tool, most_lost)
    gain = price.left_s * more - longer_s
    return gain if gain >= LEAST_GAIN_S else 0.0


@lean_inner_kernel
def _sweep(line: Line, floor: Floor, memory: MoveMemory, edges: Exchange) -> None:
    """Remove the old edges of an exchange from the counts, and add the new ones."""
    olds = _copy_edges(line.points, edges.olds, edges.size[0], memory.before)
    news = _copy_edges(line.points, edges.news, edges.size[0], memory.after)
    taken, given = _prepare(floor, memory, olds, news)
    exchange(floor.sweeps, memory.capsules, taken, given, floor.tool)


@lean_inner_kernel
def _turn_round(line: Line, first: int, last: int) -> None:
    """Swap the next and the previous point of each point from ``first`` to ``last``."""
    following, preceding = line.next, line.previous
    number = first
    while True:
        behind = following[number]
        following[number], preceding[number] = preceding[number], behind
        if number == last:
            break
        number = behind


@inlined
def _link(line: Line, a: int, b: int) -> None:
    line.next[a] = b
    if b != NONE:
        line.previous[b] = a


@lean_inner_kernel
def exchange_stretch(
    line: Line,
    floor: Floor,
    price: Price,
    memory: MoveMemory,
    edges: Exchange,
    b: int,
    c: int,
    e: int,
    is_turned: bool,
) -> float:
    """Move the stretch from ``b`` to ``c`` after ``e``, or reverse it, if that gains.

    A stretch that moves has two points or more; it is next to neither ``e`` nor the point after
    ``e``.

    Args:
        line, floor, price, memory: as for ``gain_above``.
        edges: working memory.
        b, c: first and last point of the stretch; another point precedes ``b``.
        e: the point to move it after; NONE to reverse it in its place.
        is_turned: whether the stretch is then driven from its last point to its first.

    Returns:
        The gain [s]; 0.0 if the line is as before.
    """
    following, preceding = line.next, line.previous
    a, d, g = preceding[b], following[c], NONE
    if e == NONE:
        if b == c or (d == NONE and line.is_end_fixed):
            return 0.0
        edges.size[0] = 2
        _set(edges.olds, 0, preceding[a], a, b, following[b])
        _set(edges.olds, 1, preceding[c], c, d, _behind(line, d))
        _set(edges.news, 0, preceding[a], a, c, preceding[c])
        _set(edges.news, 1, following[b], b, d, _behind(line, d))
    else:
        g = following[e]
        if line.is_end_fixed and min(d, g) == NONE:
            return 0.0
        edges.size[0] = 3
        _set(edges.olds, 0, preceding[a], a, b, following[b])
        _set(edges.olds, 1, preceding[c], c, d, _behind(line, d))
        _set(edges.olds, 2, preceding[e], e, g, _behind(line, g))
        _set(edges.news, 0, preceding[a], a, d, _behind(line, d))
        if is_turned:
            _set(edges.news, 1, preceding[e], e, c, preceding[c])
            _set(edges.news, 2, following[b], b, g, _behind(line, g))
        else:
            _set(edges.news, 1, preceding[e], e, b, following[b])
            _set(edges.news, 2, preceding[c], c, g, _behind(line, g))
    gain = _gain(line, floor, price, memory, edges)
    if gain == 0.0:
        return 0.0
    _sweep(line, floor, memory, edges)
    if is_turned:
        _turn_round(line, b, c)
        b, c = c, b
    if e == NONE:
        _link(line, a, b)
        _link(line, c, d)
    else:
        _link(line, a, d)
        _link(line, e, b)
        _link(line, c, g)
    return gain


# Largest distance between the ends of a new edge, in radii of the tool.
FARTHEST = 5.0
# Most points of a stretch that is moved.
LONGEST = 16


class LineOrder(NamedTuple):
    """Order and places of a line's points.

    Attributes:
        at: int64 (capacity,): position of each point along the line.
        first: int64 (rows, cols): a point in each square of side ``FARTHEST``, or NONE.
        other: int64 (capacity,): another point in the same square, or NONE.
    """

    at: NDArray[np.int64]
    first: NDArray[np.int64]
    other: NDArray[np.int64]


@lean_inner_kernel
def _number(line: Line, at: NDArray[np.int64]) -> int:
    """Fill in the positions of a line's points; return how many there are."""
    number, count = 0, 0
    while number != NONE:
        at[number] = count
        count += 1
        number = line.next[number]
    return count


@lean_inner_kernel
def _square(order: LineOrder, line: Line, number: int, side: float) -> tuple[int, int]:
    rows, cols = order.first.shape
    i, j = int(line.points[number, 0] / side), int(line.points[number, 1] / side)
    return min(max(i, 0), rows - 1), min(max(j, 0), cols - 1)


@lean_inner_kernel
def _stretch(line: Line, order: LineOrder, bits: int, c: int, e: int) -> tuple[int, int]:
    """Return the first and last point of a stretch that begins or ends at ``c``, to move after
    ``e``; NONE if there is none."""
    first = last = c
    for _ in range(1 + (bits >> 8) % (LONGEST - 1)):
        if bits & 1:
            if line.next[last] == NONE:
                break
            last = line.next[last]
        else:
            if line.previous[first] == NONE:
                break
            first = line.previous[first]
    before = line.previous[first]
    if first == last or before == NONE:
        return NONE, NONE
    # ``e`` must be neither in the stretch nor one of the two points next to it.
    if order.at[before] - 1 <= order.at[e] <= order.at[last] + 1:
        return NONE, NONE
    return first, last


@lean_inner_kernel
def _draw_move(
    line: Line, order: LineOrder, bits: int, a: int, c: int
) -> tuple[int, int, int, bool]:
    """Draw a move by ``bits``.

    A stretch that begins or ends at ``c`` moves next to ``a``, three times in four; otherwise the
    two points, or the points before them, are joined by a reversal.

    Returns:
        The last four arguments of ``exchange_stretch``; the first point is NONE for no move.
    """
    if bits & 3:
        e = a if bits & 4 else line.previous[a]
        if e == NONE:
            return NONE, NONE, NONE, False
        first, last = _stretch(line, order, bits >> 5, c, e)
        return first, last, e, bits >> 4 & 1 == 1
    if order.at[a] > order.at[c]:
        a, c = c, a
    if bits & 4:
        a, c = line.previous[a], line.previous[c]
    return (NONE if a == NONE else line.next[a]), c, NONE, True


@kernel
def reorder(
    line: Line,
    floor: Floor,
    price: Price,
    memory: MoveMemory,
    random: NDArray[np.uint64],
) -> float:
    """At each point of a line, try moves with a random half of the points nearby.

    The times of changes, by which ``polish`` skips points, are not updated.

    Args:
        line, floor, price, memory, random: as for ``anneal``.

    Returns:
        The total gain [s].
    """
    capacity, side = len(line.points), FARTHEST * floor.tool
    rows, cols = floor.sweeps.counts.shape
    edges = Exchange(np.empty((3, 4), np.int64), np.empty((3, 4), np.int64), np.zeros(1, np.int64))
    squares = np.full((int(rows / side) + 1, int(cols / side) + 1), NONE, np.int64)
    order = LineOrder(np.zeros(capacity, np.int64), squares, np.full(capacity, NONE, np.int64))
    along = np.empty(_number(line, order.at), np.int64)
    number = 0
    for place in range(len(along)):
        i, j = _square(order, line, number, side)
        order.other[number], order.first[i, j] = order.first[i, j], number
        along[place] = number
        number = line.next[number]
    gained = 0.0
    for place in range(len(along)):
        a = int(along[place])
        i, j = _square(order, line, a, side)
        for y in range(max(i - 1, 0), min(i + 2, order.first.shape[0])):
            for x in range(max(j - 1, 0), min(j + 2, order.first.shape[1])):
                c = order.first[y, x]
                while c != NONE:
                    bits = draw(random) >> 20
                    dy = line.points[c, 0] - line.points[a, 0]
                    dx = line.points[c, 1] - line.points[a, 1]
                    if c != a and bits & 1 and dy * dy + dx * dx <= side * side:
                        first, last, e, is_turned = _draw_move(line, order, bits >> 1, a, c)
                        gain = 0.0
                        if first != NONE:
                            gain = exchange_stretch(
                                *(line, floor, price, memory, edges, first, last, e, is_turned)
                            )
                        if gain > 0.0:
                            gained += gain
                            _number(line, order.at)
                    c = order.other[c]
    return gained
