"""Exchange of edges of the driven line: gain of a new order of its parts, and its execution.

A stretch of the line is reversed (2-opt), or moved elsewhere (or-opt): two or three edges are
replaced, all others stay, some driven backward. The gain is exact, as in ``line``.

Sources: G. A. Croes, A method for solving traveling-salesman problems, 1958 (2-opt); I. Or,
Traveling salesman-type combinatorial problems, 1976 (or-opt).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.floor.line import (
    LEAST_GAIN_S,
    NONE,
    Floor,
    Line,
    Memory,
    Price,
    copy_point,
    is_way,
    left_around,
    prepare_edges,
)
from fasaco_edge.kernels.floor.nearness import near_px
from fasaco_edge.kernels.floor.seconds import edge_s, turn_s
from fasaco_edge.kernels.floor.sweeps import exchange, swept_more
from fasaco_edge.kernels.jit import inlined, lean_inner_kernel


class Exchange(NamedTuple):
    """Edges of a line that others replace.

    Attributes:
        olds, news: int64 (3, 4), point numbers: the one before an edge, its two ends, and the one
            behind, NONE beyond the line's ends. An edge without a second end is none.
        size: int64 (1,): how many there are of each.
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
def _prepare(floor: Floor, memory: Memory, olds: int, news: int) -> tuple[int, int]:
    """Prepare the capsules of the edges copied; return how many there are before and after."""
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
def _gain(line: Line, floor: Floor, price: Price, memory: Memory, edges: Exchange) -> float:
    """Return the gain of an exchange [s]; 0.0 for none, for a blocked edge, or if clearance alone
    would gain."""
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
def _sweep(line: Line, floor: Floor, memory: Memory, edges: Exchange) -> None:
    """Count the edges of an exchange out and in."""
    olds = _copy_edges(line.points, edges.olds, edges.size[0], memory.before)
    news = _copy_edges(line.points, edges.news, edges.size[0], memory.after)
    taken, given = _prepare(floor, memory, olds, news)
    exchange(floor.sweeps, memory.capsules, taken, given, floor.tool)


@lean_inner_kernel
def _turn_round(line: Line, first: int, last: int) -> None:
    """Exchange next and previous of all points from one to another."""
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
    memory: Memory,
    edges: Exchange,
    b: int,
    c: int,
    e: int,
    is_turned: bool,
) -> float:
    """Move the stretch from ``b`` to ``c`` behind ``e``, or reverse it, if that gains.

    A stretch that moves has two points or more; it is neither next to ``e`` nor to the point behind
    ``e``.

    Args:
        line, floor, price, memory: as for ``gain_above``.
        edges: working memory.
        b, c: first and last point of the stretch; there is one before it.
        e: the point to move it behind; NONE to reverse it where it is.
        is_turned: whether it is driven backward.

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
