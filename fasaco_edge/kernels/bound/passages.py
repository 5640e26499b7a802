"""The passages of one cell: cost of its sides, cheapest passage, use of sides."""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.bound.feasible import NO_SIDE
from fasaco_edge.kernels.bound.lines import ALONG_COLS, ALONG_ROWS, Lines, StepPrices
from fasaco_edge.kernels.jit import inlined, lean_kernel

# Weights, of 256, of the running mean of directions and of a new one. Trials on grids of 170 to
# 9,000 cells: 230 is slower at first, 160 no better in the end.
KEPT, ADDED = 200, 56
UNIT = 256


@lean_kernel
def follow(lines: Lines, prices: StepPrices, pace: int) -> None:
    """Move prices along the mean of the last directions, ``use`` being the newest one."""
    for axis in range(2):
        for index in range(lines.sides.size):
            trend = KEPT * prices.trend[axis, index] + ADDED * UNIT * prices.use[axis, index]
            prices.trend[axis, index] = trend >> 8
            prices.price[axis, index] += pace * (trend >> 8) >> 8


@inlined
def sides_of(lines: Lines, prices: StepPrices, cell: int) -> tuple[int, int, int, int]:
    """Return the prices at a cell's sides, by direction."""
    rows, cols = prices.price[ALONG_ROWS], prices.price[ALONG_COLS]
    mask, rank = lines.sides[cell], lines.rank[cell]
    east = rows[cell] if mask & 1 else NO_SIDE
    north = cols[rank] if mask & 2 else NO_SIDE
    west = -rows[cell - 1] if mask & 4 else NO_SIDE
    south = -cols[rank - 1] if mask & 8 else NO_SIDE
    return east, north, west, south


@inlined
def cheapest(sides: tuple[int, int, int, int], step: int, turn: int) -> int:
    """Return the cost of the cheapest passage."""
    east, north, west, south = sides
    straight = step + min(east + west, north + south)
    corner = step + turn + min(east, west) + min(north, south)
    return min(straight, corner, step + 2 * turn + 2 * min(sides))


@inlined
def use_passage(
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
        one = which_side(sides, min(sides))
        other = one
    use_side(lines, use, cell, one, times)
    use_side(lines, use, cell, other, times)


@inlined
def which_side(sides: tuple[int, int, int, int], cost: int) -> int:
    """Return the direction of the first side with this price."""
    east, north, west, _ = sides
    if east == cost:
        return 0
    if north == cost:
        return 1
    return 2 if west == cost else 3


@inlined
def use_side(lines: Lines, use: NDArray[np.int64], cell: int, side: int, times: int) -> None:
    """Count the use of a side: a cell pays the price of its east and north sides."""
    if side == 0:
        use[ALONG_ROWS, cell] += times
    elif side == 1:
        use[ALONG_COLS, lines.rank[cell]] += times
    elif side == 2:
        use[ALONG_ROWS, cell - 1] -= times
    else:
        use[ALONG_COLS, lines.rank[cell] - 1] -= times
