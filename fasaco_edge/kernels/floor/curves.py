"""Curves: the cheapest way along a line for a robot that cannot turn on the spot.

The line is sampled at places, which are the nodes of a graph. An edge leads to the next place along
a straight, or by a word (arcs and straights, see ``words``) to a place further ahead on another
straight. A word leaves out floor that the line would sweep; the price of that floor is added. As
places are in the line's order, the cheapest way to each is found one after the other.

Points are x (column), y (row) of a raster [pixels].
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.floor.bits import is_marked
from fasaco_edge.kernels.floor.words import PIECES, find_words
from fasaco_edge.kernels.jit import inlined, kernel, lean_inner_kernel, lean_kernel

# Distance of the points at which a word is checked for obstacles [pixels]; limit on their number.
CHECK_PX = 2.0
MOST_POINTS = 2048
# Words from one place to another that are checked, the quickest first.
TRIED = 8
# Least gain that counts as cheaper [s], so that rounding on another computer changes no curve.
LEAST_GAIN_S = 1e-6
NONE = BLOCKED = -1


class LinePlaces(NamedTuple):
    """Places on a line, in its order.

    Attributes:
        poses: float64 (n, 3): x, y, yaw along the line.
        way: float64 (n,): distance along the line [pixels].
        leg: int64 (n,): number of the straight; below 0 for a pose at which the robot starts.
        worth_s: float64 (n,): price of the floor that only the piece of the line from this place to
            the next one sweeps [s].
        window: float64 (n,): distance along the line that a word to a place may replace [pixels].
    """

    poses: NDArray[np.float64]
    way: NDArray[np.float64]
    leg: NDArray[np.int64]
    worth_s: NDArray[np.float64]
    window: NDArray[np.float64]


class Base(NamedTuple):
    """The robot's base: what it can drive, and what driving costs.

    Attributes:
        radius: of arcs [pixels].
        reverses: whether the robot drives backward, too.
        straight_s, arc_s: for a pixel [s].
        back: factor of the cost of driving backward.
        stop_s: for a change between forward and backward [s].
        steered: largest bend between two straights that is steered [rad].
        spot_s: for a turn on the spot [s].
        near_s: for a pixel without clearance [s].
        width: of the tool [pixels].
    """

    radius: float
    reverses: bool
    straight_s: float
    arc_s: float
    back: float
    stop_s: float
    steered: float
    spot_s: float
    near_s: float
    width: float


class Ways(NamedTuple):
    """The cheapest way to each state.

    A state is a place and a direction of driving; its index is 2 * place, plus 1 if backward.

    Attributes:
        cost_s: float64 (2 n,) [s]; infinite where none is known.
        previous: int64 (2 n,): the state before the word; ``NONE`` at the start.
        sides: int8 (2 n, 5), lengths: float64 (2 n, 5): the word from there [radii].
    """

    cost_s: NDArray[np.float64]
    previous: NDArray[np.int64]
    sides: NDArray[np.int8]
    lengths: NDArray[np.float64]


class WordMemory(NamedTuple):
    """Words from one state to another, and points on one of them."""

    sides: NDArray[np.int8]
    lengths: NDArray[np.float64]
    costs: NDArray[np.float64]
    points: NDArray[np.float64]


@inlined
def _is_place(places: NDArray[np.uint64], x: float, y: float) -> bool:
    row, col = int(np.rint(y)), int(np.rint(x))
    rows, words = places.shape
    return 0 <= row < rows and 0 <= col < 64 * words and is_marked(places, row, col)


@inlined
def _word_s(
    sides: NDArray[np.int8], lengths: NDArray[np.float64], first: float, last: float, base: Base
) -> float:
    """Return the cost of a word [s]; ``first``, ``last``: the directions of driving before and
    after it, 1 or -1, as each change of direction costs."""
    seconds, sign = 0.0, first
    for piece in range(PIECES):
        length = lengths[piece]
        if length == 0.0:
            continue
        pace = base.arc_s if sides[piece] != 0 else base.straight_s
        seconds += abs(length) * base.radius * pace * (base.back if length < 0.0 else 1.0)
        if length * sign < 0.0:
            seconds += base.stop_s
            sign = -sign
    if sign != last:
        seconds += base.stop_s
    return seconds


@lean_inner_kernel
def _trace(
    pose: NDArray[np.float64],
    turned: float,
    sides: NDArray[np.int8],
    lengths: NDArray[np.float64],
    radius: float,
    places: NDArray[np.uint64],
    clear: NDArray[np.uint64],
    points: NDArray[np.float64],
) -> tuple[int, int]:
    """Store points on a word; return their number, and how many lack clearance.

    The number is ``BLOCKED`` if the robot does not fit at one of them, or if there are too many.
    """
    x, y, yaw = pose[0], pose[1], pose[2] + turned
    count = near = 0
    for piece in range(PIECES):
        length = lengths[piece]
        if length == 0.0:
            continue
        parts = math.ceil(abs(length) * radius / CHECK_PX)
        side, step = float(sides[piece]), length / parts
        half = 0.5 * side * step
        chord = step * radius if side == 0.0 else 2.0 * radius * math.sin(half) / side
        for _ in range(parts):
            x += chord * math.cos(yaw + half)
            y += chord * math.sin(yaw + half)
            yaw += 2.0 * half
            if count == MOST_POINTS or not _is_place(places, x, y):
                return BLOCKED, 0
            near += not _is_place(clear, x, y)
            points[count, 0], points[count, 1] = x, y
            count += 1
    return count, near


@lean_inner_kernel
def _left_s(
    line: LinePlaces,
    first: int,
    last: int,
    width: float,
    points: NDArray[np.float64],
    count: int,
    most: float,
) -> float:
    """Return the price of floor that the line sweeps between two places and a word does not [s].

    ``points`` are on the word. Counting stops once the price is at least ``most``.
    """
    left = 0.0
    for number in range(first, last):
        worth = line.worth_s[number]
        if worth == 0.0:
            continue
        x = 0.5 * (line.poses[number, 0] + line.poses[number + 1, 0])
        y = 0.5 * (line.poses[number, 1] + line.poses[number + 1, 1])
        # A word of no length stays at the first place.
        dx, dy = line.poses[first, 0] - x, line.poses[first, 1] - y
        nearest = dx * dx + dy * dy
        for point in range(1, count, 2):
            dx, dy = points[point, 0] - x, points[point, 1] - y
            nearest = min(nearest, dx * dx + dy * dy)
        left += worth * min(math.sqrt(nearest) / width, 1.0)
        if left >= most:
            break
    return left


@inlined
def _step(
    line: LinePlaces, base: Base, clear: NDArray[np.uint64], number: int, back: int, ways: Ways
) -> None:
    """Drive straight on, or turn at the beginning of a straight, on the spot if it is sharp."""
    state, before = 2 * number + back, 2 * number - 2 + back
    dx = line.poses[number, 0] - line.poses[number - 1, 0]
    dy = line.poses[number, 1] - line.poses[number - 1, 1]
    way = math.sqrt(dx * dx + dy * dy)
    if line.leg[number] == line.leg[number - 1]:
        x, y = line.poses[number - 1, 0] + 0.5 * dx, line.poses[number - 1, 1] + 0.5 * dy
        pace = base.straight_s * (base.back if back else 1.0)
        pace += 0.0 if _is_place(clear, x, y) else base.near_s
        cost = ways.cost_s[before] + way * pace
    else:
        bend = line.poses[number, 2] - line.poses[number - 1, 2]
        is_steered = abs((bend + math.pi) % (2.0 * math.pi) - math.pi) <= base.steered
        cost = ways.cost_s[before] + (0.0 if is_steered else base.spot_s)
        way = 0.0
    if cost < ways.cost_s[state] - LEAST_GAIN_S:
        ways.cost_s[state], ways.previous[state] = cost, before
        for piece in range(PIECES):
            ways.sides[state, piece], ways.lengths[state, piece] = 0, 0.0
        ways.lengths[state, 0] = (-way if back else way) / base.radius


@lean_inner_kernel
def _link(
    line: LinePlaces,
    base: Base,
    places: NDArray[np.uint64],
    clear: NDArray[np.uint64],
    before: int,
    state: int,
    ways: Ways,
    memory: WordMemory,
) -> None:
    """Drive a word from one state to another, if it is cheaper than the known way."""
    begun = ways.cost_s[before]
    first, last = before >> 1, state >> 1
    turned, turns_to = math.pi * (before & 1), math.pi * (state & 1)
    yaw = line.poses[first, 2] + turned
    dx = (line.poses[last, 0] - line.poses[first, 0]) / base.radius
    dy = (line.poses[last, 1] - line.poses[first, 1]) / base.radius
    cos, sin = math.cos(yaw), math.sin(yaw)
    goal = line.poses[last, 2] + turns_to - yaw
    count = find_words(
        cos * dx + sin * dy, cos * dy - sin * dx, goal, base.reverses, memory.sides, memory.lengths
    )
    away, toward = 1.0 - 2.0 * (before & 1), 1.0 - 2.0 * (state & 1)
    for word in range(count):
        memory.costs[word] = _word_s(memory.sides[word], memory.lengths[word], away, toward, base)
    for _ in range(TRIED):
        word = 0
        for other in range(1, count):
            if memory.costs[other] < memory.costs[word] - LEAST_GAIN_S:
                word = other
        cost = begun + memory.costs[word]
        if count == 0 or not cost < ways.cost_s[state] - LEAST_GAIN_S:
            return
        memory.costs[word] = math.inf
        sides, lengths = memory.sides[word], memory.lengths[word]
        points, near = _trace(
            line.poses[first], turned, sides, lengths, base.radius, places, clear, memory.points
        )
        if points == BLOCKED:
            continue
        cost += near * CHECK_PX * base.near_s
        cost += _left_s(
            line, first, last, base.width, memory.points, points, ways.cost_s[state] - cost
        )
        if cost < ways.cost_s[state] - LEAST_GAIN_S:
            ways.cost_s[state], ways.previous[state] = cost, before
            for piece in range(PIECES):
                ways.sides[state, piece] = sides[piece]
                ways.lengths[state, piece] = lengths[piece]


@lean_kernel
def find_ways(
    line: LinePlaces,
    base: Base,
    places: NDArray[np.uint64],
    clear: NDArray[np.uint64],
    ways: Ways,
    memory: WordMemory,
) -> None:
    """Find the cheapest way to each place.

    Args:
        line: the places.
        base: the robot.
        places, clear: uint64 (rows, words), see ``bits``: pixels whose centre the robot can occupy
            and reach; pixels where it also has its clearance.
        ways: to fill: the costs of the states where the robot may start are 0.
        memory: to work with.
    """
    for number in range(1, len(line.way)):
        for back in range(2 if base.reverses else 1):
            if line.leg[number] < 0:
                continue
            _step(line, base, clear, number, back, ways)
            for other in range(number - 1, -1, -1):
                if line.way[number] - line.way[other] > line.window[number]:
                    break
                if line.leg[other] == line.leg[number]:
                    continue
                for turned in range(2 if base.reverses else 1):
                    before = 2 * other + turned
                    if ways.cost_s[before] < ways.cost_s[2 * number + back]:
                        _link(line, base, places, clear, before, 2 * number + back, ways, memory)


@kernel
def count_swept(
    points: NDArray[np.float64],
    way: NDArray[np.float64],
    reachable: NDArray[np.bool_],
    half: float,
    apart: float,
) -> NDArray[np.int64]:
    """Return how much floor is lost without each point of a line [half pixels], int64 (n,).

    A pixel that the line sweeps once counts two halves, for the point in the middle of that sweep.
    A pixel that it sweeps again later counts one half for the first point and one for the last.

    Args:
        points: float64 (n, 2): x, y.
        way: float64 (n,): distance along the line [pixels].
        reachable: bool (rows, cols): pixels that count.
        half: half of the tool's width [pixels].
        apart: sweeps of a pixel further apart along the line than this count as two [pixels].
    """
    rows, cols = reachable.shape
    first = np.full((rows, cols), NONE, np.int32)
    last = np.full((rows, cols), NONE, np.int32)
    for number in range(len(points)):
        x, y = points[number]
        for row in range(max(math.ceil(y - half), 0), min(math.floor(y + half) + 1, rows)):
            across = math.sqrt(max(half * half - (row - y) * (row - y), 0.0))
            for col in range(max(math.ceil(x - across), 0), min(math.floor(x + across) + 1, cols)):
                if first[row, col] == NONE:
                    first[row, col] = number
                last[row, col] = number
    counts = np.zeros(len(points), np.int64)
    for row in range(rows):
        for col in range(cols):
            one, other = first[row, col], last[row, col]
            if one == NONE or not reachable[row, col]:
                continue
            if way[other] - way[one] <= apart:
                counts[(one + other) // 2] += 2
            else:
                counts[one] += 1
                counts[other] += 1
    return counts
