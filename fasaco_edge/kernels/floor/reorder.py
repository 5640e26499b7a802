"""Reordering of the driven line: in what order it passes the floor.

Annealing changes the shape of the line and keeps this order. Here the line leaves an edge for a
point nearby, and a stretch is reversed or moved for it: ways between lanes get shorter and cross
less. Only moves that gain are made: a temperature gained nothing more.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.floor.exchange import Exchange, exchange_stretch
from fasaco_edge.kernels.floor.line import NONE, Floor, Line, Memory, Price
from fasaco_edge.kernels.jit import kernel, lean_inner_kernel
from fasaco_edge.kernels.random import draw

# Farthest point that a new edge leads to, in radii of the tool.
FARTHEST = 5.0
# Most points of a stretch that is moved.
LONGEST = 16


class Order(NamedTuple):
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
def _square(order: Order, line: Line, number: int, side: float) -> tuple[int, int]:
    rows, cols = order.first.shape
    i, j = int(line.points[number, 0] / side), int(line.points[number, 1] / side)
    return min(max(i, 0), rows - 1), min(max(j, 0), cols - 1)


@lean_inner_kernel
def _stretch(line: Line, order: Order, bits: int, c: int, e: int) -> tuple[int, int]:
    """Return the first and last point of a stretch that begins or ends at ``c``, to move behind
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
    # Not within the stretch, nor at its edges' ends.
    if order.at[before] - 1 <= order.at[e] <= order.at[last] + 1:
        return NONE, NONE
    return first, last


@lean_inner_kernel
def _draw_move(line: Line, order: Order, bits: int, a: int, c: int) -> tuple[int, int, int, bool]:
    """Draw a move by ``bits``.

    A stretch that begins or ends at ``c`` moves next to ``a``, three times in four; otherwise the
    two points, or those before them, are joined by a reversal.

    Returns:
        The last four arguments of ``exchange_stretch``; its first point is NONE for no move.
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
    memory: Memory,
    random: NDArray[np.uint64],
) -> float:
    """Try a move at each point of a line for half of the points nearby, chosen at random.

    The times of changes, by which ``polish`` skips points, are not kept.

    Args:
        line, floor, price, memory, random: as for ``anneal``.

    Returns:
        The total gain [s].
    """
    capacity, side = len(line.points), FARTHEST * floor.tool
    rows, cols = floor.sweeps.counts.shape
    edges = Exchange(np.empty((3, 4), np.int64), np.empty((3, 4), np.int64), np.zeros(1, np.int64))
    squares = np.full((int(rows / side) + 1, int(cols / side) + 1), NONE, np.int64)
    order = Order(np.zeros(capacity, np.int64), squares, np.full(capacity, NONE, np.int64))
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
