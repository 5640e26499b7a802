"""A lower bound on what a covering walk costs, steps and quarter-turns.

Sources: Held and Karp 1970 for prices that rise where a relaxed walk does not fit together;
Fekete and Krupke, "Practical methods for computing large covering tours and cycle covers with
turn cost", 2019, for the relaxation: a walk is a set of passages, one for each visit of a cell.

A passage comes into its cell by one side and leaves by another one, or by the same. It costs a
step, half of it for each side, and its quarter-turns: none straight on, one around a corner, two
back.
The first and the last visit have one side only, and cost half a step. Every step leaves one cell
and enters the next one, so a price on each step that one cell pays and the other one is paid
leaves the cost of a walk as it is. With prices that let no passage cost less than nothing a walk
costs no less than: the cheapest first visit of the start; and the cheapest passage of each cell
to cover; and the last visit. That is the cheapest one of a given end, else it takes the place of
a passage of the cell where that saves most: a best walk ends in a cell to cover, at its first
visit.

The prices after every iteration are exactly feasible (``kernels.bound.feasible``) and give a valid
bound; the best one counts.

All amounts are whole half microseconds: halves of steps, and sums that do not depend on order.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.bound.feasible import NO_SIDE, make_feasible
from fasaco_edge.kernels.bound.lines import ALONG_COLS, ALONG_ROWS, Lines, StepPrices
from fasaco_edge.kernels.jit import inlined, lean_kernel

# Of 256: what is kept of the running mean of directions, and what a new one adds. Trials on
# grids of 170 to 9,000 cells: 230 is slower at first, 160 no better at last.
KEPT, ADDED = 200, 56
UNIT = 256


@lean_kernel
def ascend(
    lines: Lines, prices: StepPrices, step: int, turn: int, pace: int, falls: int, times: int
) -> int:
    """Improve the prices; return the best bound met [half us], ``best`` having its prices.

    A subgradient method with exactly feasible iterates: each price follows how much more often
    its step is left than entered, in the mean of the last iterations.

    Args:
        lines: the cells, two or more.
        prices: to begin with, feasible or not; changed in place.
        step, turn: a step and a quarter-turn [half us], the step an even number.
        pace: how far a price moves at first [half us].
        falls: the pace falls by a factor of about e to this power.
        times: how many iterations.
    """
    best = 0
    for _ in range(times):
        make_feasible(lines, prices, step, turn)
        bound = _relaxed(lines, prices, step, turn)
        if bound > best:
            best = bound
            _copy(prices.price, prices.best)
        for axis in range(2):
            for index in range(lines.sides.size):
                trend = KEPT * prices.trend[axis, index] + ADDED * UNIT * prices.use[axis, index]
                prices.trend[axis, index] = trend >> 8
                prices.price[axis, index] += pace * (trend >> 8) >> 8
        pace -= pace * falls // times
    return best


@inlined
def _copy(source: NDArray[np.int64], target: NDArray[np.int64]) -> None:
    """Copy prices; an assignment would ask whether the two arrays overlap, and allocate."""
    for axis in range(2):
        for index in range(source.shape[1]):
            target[axis, index] = source[axis, index]


@lean_kernel
def _relaxed(lines: Lines, prices: StepPrices, step: int, turn: int) -> int:
    """Return the bound of feasible prices, and write into ``use`` what its passages use."""
    rows, cols = prices.price[ALONG_ROWS], prices.price[ALONG_COLS]
    use = prices.use
    for axis in range(2):
        for index in range(lines.sides.size):
            use[axis, index] = 0
    total, saving, last = 0, -NO_SIDE, -1
    for cell in range(lines.sides.size):
        if lines.wanted[cell]:
            sides = _sides(lines, rows, cols, cell)
            least = _cheapest(sides, step, turn)
            total += least
            _use_passage(lines, use, cell, sides, least, step, turn, 1)
            if least - step // 2 - min(sides) > saving:
                saving, last = least - step // 2 - min(sides), cell
    if lines.end >= 0:
        last = lines.end
    elif last >= 0:
        sides = _sides(lines, rows, cols, last)
        least = _cheapest(sides, step, turn)
        total -= least
        _use_passage(lines, use, last, sides, least, step, turn, -1)
    for end in (lines.start, last):
        sides = _sides(lines, rows, cols, end)
        total += step // 2 + min(sides)
        _use(lines, use, end, _which(sides, min(sides)), 1)
    return total


@inlined
def _sides(
    lines: Lines, rows: NDArray[np.int64], cols: NDArray[np.int64], cell: int
) -> tuple[int, int, int, int]:
    """Return what a cell pays for its sides, by direction."""
    mask, rank = lines.sides[cell], lines.rank[cell]
    east = rows[cell] if mask & 1 else NO_SIDE
    north = cols[rank] if mask & 2 else NO_SIDE
    west = -rows[cell - 1] if mask & 4 else NO_SIDE
    south = -cols[rank - 1] if mask & 8 else NO_SIDE
    return east, north, west, south


@inlined
def _cheapest(sides: tuple[int, int, int, int], step: int, turn: int) -> int:
    """Return what the cheapest passage costs."""
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
    """Count the use of the sides of a cell's passage that costs so much."""
    east, north, west, south = sides
    if cost == step + east + west:
        one, other = 0, 2
    elif cost == step + north + south:
        one, other = 1, 3
    elif cost == step + turn + min(east, west) + min(north, south):
        one, other = 0 if east <= west else 2, 1 if north <= south else 3
    else:
        one = _which(sides, min(sides))
        other = one
    _use(lines, use, cell, one, times)
    _use(lines, use, cell, other, times)


@inlined
def _which(sides: tuple[int, int, int, int], cost: int) -> int:
    """Return the direction of the first side that costs so much."""
    east, north, west, _ = sides
    if east == cost:
        return 0
    if north == cost:
        return 1
    return 2 if west == cost else 3


@inlined
def _use(lines: Lines, use: NDArray[np.int64], cell: int, side: int, times: int) -> None:
    """Count the use of a side: a cell pays the price of its east and north sides."""
    if side == 0:
        use[ALONG_ROWS, cell] += times
    elif side == 1:
        use[ALONG_COLS, lines.rank[cell]] += times
    elif side == 2:
        use[ALONG_ROWS, cell - 1] -= times
    else:
        use[ALONG_COLS, lines.rank[cell] - 1] -= times
