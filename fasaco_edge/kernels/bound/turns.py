"""A lower bound on the cost of a covering walk, in steps and quarter-turns.

Sources: Held and Karp 1970 for prices that rise where a relaxed walk is inconsistent;
Fekete and Krupke, "Practical methods for computing large covering tours and cycle covers with
turn cost", 2019, for the relaxation: a walk is a set of passages, one for each visit of a cell.

A passage enters its cell by one side and leaves it by another or the same side. It costs a step,
half of it for each side, and its quarter-turns: none straight on, one at a corner, two in a U-turn.
The first and the last visit have only one side, and cost half a step. Give each step a price that
the cell before it pays and the cell after it receives. Prices cancel along a walk, so its cost is
unchanged. If no passage has a negative reduced cost, a walk costs at least the sum of:

* the cheapest first visit of the start;
* the cheapest passage of each cell to cover;
* the cheapest last visit of a given end. Without a given end a last visit replaces the passage of
  the cell where that saves most, because a best walk ends at the first visit of a cell to cover.

After every iteration the prices are projected onto feasible ones, which give a valid bound; the
best bound counts. Along a line of cells the price of a step may fall by at most one step's cost
between consecutive steps; otherwise going straight would have a negative cost. Pooling adjacent
violators (isotonic regression) is the projection onto that limit. Corners and U-turns are feasible
if the price at each side is within a bound; the row's and the column's bound add up to a corner's
cost.

All amounts are whole half microseconds: halves of steps, and sums that do not depend on order.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.bound.lines import ALONG_COLS, ALONG_ROWS, Lines, StepPrices
from fasaco_edge.kernels.jit import as_value, inlined, lean_inner_kernel, lean_kernel

# Magnitude of the price of a missing side [half us].
NO_SIDE = 1 << 60


@lean_inner_kernel
def make_feasible(lines: Lines, prices: StepPrices, step: int, turn: int) -> None:
    """Change the prices as little as possible so that no passage has a negative reduced cost."""
    for axis in range(2):
        _level(lines.links[axis], prices.price[axis], step, prices.use)
    _fit_boxes(lines, prices, step, turn)
    for axis in range(2):
        _clamp(lines.links[axis], prices.price[axis], prices.box[axis], step, prices.use[0])


@lean_inner_kernel
def _level(
    links: NDArray[np.uint8], price: NDArray[np.int64], step: int, spare: NDArray[np.int64]
) -> None:
    """Limit the fall of prices to ``step`` between consecutive steps of a line."""
    mean, weight = spare[0], spare[1]
    first = 0
    for index in range(links.size):
        if links[index]:
            continue
        blocks = 0
        for inner in range(first, index):
            mean[blocks], weight[blocks] = price[inner] + step * (inner - first), 1
            blocks += 1
            while blocks > 1 and mean[blocks - 2] > mean[blocks - 1]:
                one, other = weight[blocks - 2], weight[blocks - 1]
                total = mean[blocks - 2] * one + mean[blocks - 1] * other
                mean[blocks - 2] = total // (one + other)
                weight[blocks - 2] = one + other
                blocks -= 1
        inner = first
        for block in range(blocks):
            for _ in range(weight[block]):
                price[inner] = mean[block] - step * (inner - first)
                inner += 1
        first = index + 1


@lean_inner_kernel
def _fit_boxes(lines: Lines, prices: StepPrices, step: int, turn: int) -> None:
    """Divide the cost of a corner between a cell's two axes, as each of them needs."""
    rows, cols = prices.price[ALONG_ROWS], prices.price[ALONG_COLS]
    corner, least, most = step + turn, step // 2, step // 2 + turn
    for cell in range(lines.sides.size):
        mask, rank = lines.sides[cell], lines.rank[cell]
        along, across = most, most
        if mask & 5 and mask & 10:
            need, other = -NO_SIDE, -NO_SIDE
            if mask & 1:
                need = -rows[cell]
            if mask & 4:
                need = max(need, rows[cell - 1])
            if mask & 2:
                other = -cols[rank]
            if mask & 8:
                other = max(other, cols[rank - 1])
            along = min(max(need + (corner - need - other) // 2, least), most)
            across = corner - along
        prices.box[ALONG_ROWS, cell], prices.box[ALONG_COLS, rank] = along, across


@lean_inner_kernel
def _clamp(
    links: NDArray[np.uint8],
    price: NDArray[np.int64],
    box: NDArray[np.int64],
    step: int,
    highest: NDArray[np.int64],
) -> None:
    """Clamp the prices at sides to the bounds, and their fall to ``step``.

    This alone makes any prices feasible; levelled prices change less. ``highest``, int64 (m,), is
    working memory.
    """
    limit = NO_SIDE
    for index in range(links.size - 1, -1, -1):
        limit = min(box[index + 1], limit + step) if links[index] else NO_SIDE
        highest[index] = limit
    before = -NO_SIDE
    for index in range(links.size):
        if links[index]:
            before = min(max(price[index], -box[index], before - step), highest[index])
            price[index] = before
        else:
            before = -NO_SIDE


# Weights [1 / 256] of the running mean of directions and of the newest direction. Trials on grids
# of 170 to 9,000 cells: KEPT 230 gains more slowly at first, 160 is no better in the end.
KEPT, ADDED = 200, 56
UNIT = 256


@lean_kernel
def ascend(lines: Lines, prices: StepPrices, step: int, turn: int, falls: int, times: int) -> int:
    """Improve the prices; return the best bound found [half us], with its prices in ``best``.

    A subgradient method with exactly feasible iterates: each price follows the imbalance of its
    step, departures minus arrivals, averaged over the last iterations.

    Args:
        lines: the cells, two or more.
        prices: initial prices, feasible or not; changed in place.
        step, turn: a step and a quarter-turn [half us], the step an even number.
        falls: over all iterations the step size of the prices, a quarter-turn at first, falls by a
            factor of about e ** falls.
        times: number of iterations.
    """
    best, pace = 0, turn
    for _ in range(times):
        make_feasible(lines, prices, step, turn)
        bound = _relaxed(lines, prices, step, turn)
        if bound > best:
            best = bound
            _copy(prices.price, prices.best)
        _follow(lines, prices, pace)
        pace -= pace * falls // times
    return best


@inlined
def _copy(source: NDArray[np.int64], target: NDArray[np.int64]) -> None:
    """Copy prices; an assignment would test whether the two arrays overlap, and allocate."""
    for axis in range(2):
        for index in range(source.shape[1]):
            target[axis, index] = source[axis, index]


@lean_inner_kernel
def _relaxed(lines: Lines, prices: StepPrices, step: int, turn: int) -> int:
    """Return the bound of feasible prices; count in ``use`` how its passages use each side."""
    use = prices.use
    for axis in range(2):
        for index in range(lines.sides.size):
            use[axis, index] = 0
    total, saving, last = 0, -NO_SIDE, as_value(-1)
    for cell in range(lines.sides.size):
        if lines.wanted[cell]:
            sides = _sides_of(lines, prices, cell)
            least = _cheapest(sides, step, turn)
            total += least
            _use_passage(lines, use, cell, sides, least, step, turn, as_value(1))
            if least - step // 2 - min(sides) > saving:
                saving, last = least - step // 2 - min(sides), cell
    if lines.end >= 0:
        last = lines.end
    elif last >= 0:
        sides = _sides_of(lines, prices, last)
        least = _cheapest(sides, step, turn)
        total -= least
        _use_passage(lines, use, last, sides, least, step, turn, as_value(-1))
    for end in (lines.start, last):
        sides = _sides_of(lines, prices, end)
        total += step // 2 + min(sides)
        _use_side(lines, use, end, _which_side(sides, min(sides)), as_value(1))
    return total


@lean_inner_kernel
def _follow(lines: Lines, prices: StepPrices, pace: int) -> None:
    """Move prices along the mean of the last directions, ``use`` being the newest one."""
    for axis in range(2):
        for index in range(lines.sides.size):
            trend = KEPT * prices.trend[axis, index] + ADDED * UNIT * prices.use[axis, index]
            prices.trend[axis, index] = trend >> 8
            prices.price[axis, index] += pace * (trend >> 8) >> 8


@inlined
def _sides_of(lines: Lines, prices: StepPrices, cell: int) -> tuple[int, int, int, int]:
    """Return the prices at a cell's sides, by direction."""
    rows, cols = prices.price[ALONG_ROWS], prices.price[ALONG_COLS]
    mask, rank = lines.sides[cell], lines.rank[cell]
    east = rows[cell] if mask & 1 else NO_SIDE
    north = cols[rank] if mask & 2 else NO_SIDE
    west = -rows[cell - 1] if mask & 4 else NO_SIDE
    south = -cols[rank - 1] if mask & 8 else NO_SIDE
    return east, north, west, south


@inlined
def _cheapest(sides: tuple[int, int, int, int], step: int, turn: int) -> int:
    """Return the cost of the cheapest passage."""
    east, north, west, south = sides
    straight = step + min(east + west, north + south)
    corner = step + turn + min(east, west) + min(north, south)
    return min(straight, corner, step + 2 * turn + 2 * min(sides))


@inlined
def _use_passage(
    lines: Lines,
    use: NDArray[np.int64],
    cell: int,
    sides: tuple[int, int, int, int],
    cost: int,
    step: int,
    turn: int,
    times: int,
) -> None:
    """Count the use of sides by a cell's passage of this cost."""
    east, north, west, south = sides
    if cost == step + east + west:
        one, other = 0, 2
    elif cost == step + north + south:
        one, other = 1, 3
    elif cost == step + turn + min(east, west) + min(north, south):
        one, other = 0 if east <= west else 2, 1 if north <= south else 3
    else:
        one = _which_side(sides, min(sides))
        other = one
    _use_side(lines, use, cell, one, times)
    _use_side(lines, use, cell, other, times)


@inlined
def _which_side(sides: tuple[int, int, int, int], cost: int) -> int:
    """Return the direction of the first side with this price."""
    east, north, west, _ = sides
    if east == cost:
        return 0
    if north == cost:
        return 1
    return 2 if west == cost else 3


@inlined
def _use_side(lines: Lines, use: NDArray[np.int64], cell: int, side: int, times: int) -> None:
    """Count the use of a side: a cell pays the price of its east and north sides."""
    if side == 0:
        use[ALONG_ROWS, cell] += times
    elif side == 1:
        use[ALONG_COLS, lines.rank[cell]] += times
    elif side == 2:
        use[ALONG_ROWS, cell - 1] -= times
    else:
        use[ALONG_COLS, lines.rank[cell] - 1] -= times
