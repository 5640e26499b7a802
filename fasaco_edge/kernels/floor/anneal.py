"""Annealing of the driven line: random moves, some of which may lose a little at first.

At each point of the line in turn one move is drawn: remove the next one or two points, move the
next point, shift the edge after that point, cut the corner at it, or reroute the edge before it
over unswept floor nearby. The length of a move is drawn from several octaves. A move that loses
less than a temperature times a random number is accepted, too (Metropolis); the temperature falls
to 0.

Source: S. Kirkpatrick, C. D. Gelatt, M. P. Vecchi, Optimization by Simulated Annealing, 1983.
No libm function is called, so results are equal on all machines.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.floor.detour import middle_left, nearest_place
from fasaco_edge.kernels.floor.line import (
    NO_MOVE,
    NONE,
    TRIED,
    Floor,
    Line,
    MoveMemory,
    Price,
    gain_above,
    has_room,
    replace_points,
)
from fasaco_edge.kernels.floor.polish import slide
from fasaco_edge.kernels.floor.sweeps import BLOCK
from fasaco_edge.kernels.jit import inlined, lean_inner_kernel, lean_kernel
from fasaco_edge.kernels.random import draw, draw_share

# Initial temperature, as a share of the time to drive a tool's width.
HOTTEST = 0.16
# Largest length of a move, in radii of the tool, and the number of its octaves.
FARTHEST, OCTAVES = 2.5, 5
# Number of moves of each kind in sixteen; the rest are detours over unswept floor.
LEFT_OUT, MOVED, SHIFTED, CUT = 2, 4, 3, 3
# Largest share of an edge that a cut removes.
MOST_CUT = 0.95
# Unit exponential variates, rounded: the logarithm's last bits differ between machines.
EXPONENTIAL = np.round(-np.log((np.arange(4096) + 0.5) / 4096) * 65536) / 65536


@inlined
def _length(random: NDArray[np.uint64], farthest: float) -> float:
    """Return the signed length of a move: each octave below ``farthest`` is equally likely."""
    bits = draw(random)
    size = farthest * (0.5 + 0.5 * draw_share(random))
    for _ in range((bits >> 20) % OCTAVES):
        size *= 0.5
    return size if bits >> 40 & 1 else -size


@lean_inner_kernel
def _move(
    line: Line, memory: MoveMemory, random: NDArray[np.uint64], begin: int, far: float
) -> int:
    """Move the point after ``begin``: along either edge, or in any direction."""
    points, new = line.points, memory.new
    middle = line.next[begin]
    end = line.next[middle]
    size = _length(random, far)
    way = draw(random) >> 30 & 3
    if way < 2:
        dy, dx = 2.0 * draw_share(random) - 1.0, 2.0 * draw_share(random) - 1.0
    else:
        other = begin if way == 2 or end == NONE else end
        dy, dx = points[other, 0] - points[middle, 0], points[other, 1] - points[middle, 1]
        length = np.sqrt(dy * dy + dx * dx)
        dy, dx = dy / length, dx / length
    new[0, 0], new[0, 1] = points[middle, 0] + size * dy, points[middle, 1] + size * dx
    return 1


@lean_inner_kernel
def _shift(
    line: Line, memory: MoveMemory, random: NDArray[np.uint64], begin: int, far: float
) -> int:
    """Shift the edge after ``begin``'s next point; its ends may slide along the edges beside it."""
    points, new = line.points, memory.new
    a = line.next[begin]
    b = line.next[a]
    end = line.next[b]
    dy, dx = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    size = _length(random, far) / np.sqrt(dy * dy + dx * dx)
    ay, ax = points[a, 0] - size * dx, points[a, 1] + size * dy
    by, bx = points[b, 0] - size * dx, points[b, 1] + size * dy
    new[0, 0], new[0, 1], new[1, 0], new[1, 1] = ay, ax, by, bx
    if draw(random) >> 30 & 1:
        slide(new[0], points[begin], points[a], memory, ay, ax, by, bx)
        if end != NONE:
            slide(new[1], points[b], points[end], memory, ay, ax, by, bx)
    return 2


@lean_inner_kernel
def _shift_lanes(
    line: Line, memory: MoveMemory, random: NDArray[np.uint64], begin: int, far: float
) -> tuple[int, int]:
    """Shift three edges after ``begin``'s next point together, as two lanes side by side."""
    points, new = line.points, memory.new
    a = line.next[begin]
    b = line.next[a]
    dy, dx = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    size = _length(random, far) / np.sqrt(dy * dy + dx * dx)
    end = a
    for number in range(4):
        if end == NONE:
            return NO_MOVE, end
        new[number, 0], new[number, 1] = points[end, 0] - size * dx, points[end, 1] + size * dy
        end = line.next[end]
    return 4, end


@lean_inner_kernel
def _cut(line: Line, memory: MoveMemory, random: NDArray[np.uint64], begin: int, far: float) -> int:
    """Cut the corner after ``begin``."""
    points, new = line.points, memory.new
    middle = line.next[begin]
    for number in range(2):
        other = begin if number == 0 else line.next[middle]
        dy, dx = points[other, 0] - points[middle, 0], points[other, 1] - points[middle, 1]
        share = min(far * draw_share(random) / np.sqrt(dy * dy + dx * dx), 1.0) * MOST_CUT
        new[number, 0] = points[middle, 0] + share * dy
        new[number, 1] = points[middle, 1] + share * dx
    return 2


@lean_inner_kernel
def _round_left(
    line: Line, floor: Floor, memory: MoveMemory, random: NDArray[np.uint64], begin: int, far: float
) -> int:
    """Reroute the edge after ``begin`` over the unswept floor of a block nearby."""
    points, left, new, place = line.points, floor.sweeps.left, memory.new, memory.place
    end = line.next[begin]
    ay, ax = points[begin, 0], points[begin, 1]
    dy, dx = points[end, 0] - ay, points[end, 1] - ax
    share = draw_share(random)
    y = ay + share * dy + far * (2.0 * draw_share(random) - 1.0)
    x = ax + share * dx + far * (2.0 * draw_share(random) - 1.0)
    i, j = int(y) >> BLOCK, int(x) >> BLOCK
    if not (0 <= i < left.shape[0] and 0 <= j < left.shape[1]) or left[i, j] < 2:
        return NO_MOVE
    if not middle_left(floor.sweeps, i, j, place):
        return NO_MOVE
    if not nearest_place(floor.places, place, int(floor.tool) + 2):
        return NO_MOVE
    length = np.sqrt(dy * dy + dx * dx)
    dy, dx = dy / length, dx / length
    along = (place[0] - ay) * dy + (place[1] - ax) * dx
    spread = 0.0
    if draw(random) >> 30 & 3:
        spread = 0.3 * floor.tool + 0.7 * far * draw_share(random)
    # A corner, or a bulge; the narrowest bulge goes there and back.
    if draw(random) >> 30 & 1 or along - spread < 1.0 or along + spread > length - 1.0:
        new[0, 0], new[0, 1] = place[0], place[1]
        return 1
    new[0, 0], new[0, 1] = ay + (along - spread) * dy, ax + (along - spread) * dx
    new[1, 0], new[1, 1] = place[0], place[1]
    new[2, 0], new[2, 1] = ay + (along + spread) * dy, ax + (along + spread) * dx
    return 3


@lean_inner_kernel
def _draw_move(
    line: Line, floor: Floor, memory: MoveMemory, random: NDArray[np.uint64], begin: int
) -> tuple[int, int]:
    """Draw a move at a point.

    Returns:
        Number of points of ``memory.new`` to insert, or NO_MOVE; and the point after them.
    """
    far = FARTHEST * floor.tool
    middle = line.next[begin]
    end = line.next[middle]
    kind = draw(random) >> 30 & 15
    count = NO_MOVE
    if kind < LEFT_OUT:
        count = 0
        if end != NONE and draw(random) >> 30 & 1:
            end = line.next[end]
    elif kind < LEFT_OUT + MOVED:
        count = _move(line, memory, random, begin, far)
    elif kind >= LEFT_OUT + MOVED + SHIFTED + CUT:
        count = _round_left(line, floor, memory, random, begin, far)
        end = middle
    elif end == NONE:
        count = NO_MOVE
    elif kind < LEFT_OUT + MOVED + SHIFTED:
        if draw(random) >> 30 & 1:
            count = _shift(line, memory, random, begin, far)
            end = line.next[end]
        else:
            count, end = _shift_lanes(line, memory, random, begin, far)
    else:
        count = _cut(line, memory, random, begin, far)
    return count, end


@lean_kernel
def anneal(
    line: Line,
    floor: Floor,
    price: Price,
    memory: MoveMemory,
    random: NDArray[np.uint64],
    margin: int,
    heat: tuple[float, float],
    most_tried: int,
) -> float:
    """Anneal a line until ``most_tried`` moves were tried.

    Args:
        line: two points or more; its sweeps are counted in ``floor.sweeps``.
        floor, price, memory: as for ``polish``.
        random: uint64 (1,), not 0.
        margin: 1 if the first and the last edge only define the turns after and before them, as
            for a piece of a longer line; else 0.
        heat: first and last temperature, as shares of the initial temperature ``HOTTEST``.
        most_tried: limit on the moves tried, earlier moves included.

    Returns:
        The total gain [s]; it may be negative.
    """
    following = line.next
    hottest_s = HOTTEST * 2.0 * floor.tool * price.drive_s
    tried_before = line.state[TRIED]
    gained = 0.0
    begin = margin
    while line.state[TRIED] < most_tried and has_room(line) and following[margin] != NONE:
        rest = (most_tried - line.state[TRIED]) / (most_tried - tried_before)
        share = heat[1] + (heat[0] - heat[1]) * rest
        most_s = hottest_s * share * share * EXPONENTIAL[draw(random) & 4095]
        tried = line.state[TRIED]
        count, end = _draw_move(line, floor, memory, random, begin)
        gain = -np.inf
        if margin and count != NO_MOVE and (end == NONE or following[end] == NONE):
            count = NO_MOVE
        if count != NO_MOVE:
            gain = gain_above(line, floor, price, memory, begin, end, count, -most_s)
        line.state[TRIED] = tried + 1
        if gain > -np.inf:
            replace_points(line, floor, memory, begin, end, count)
            gained += gain
        else:
            begin = following[begin]
        if following[begin] == NONE:
            begin = margin
    return gained
