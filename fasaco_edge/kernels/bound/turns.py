"""A lower bound on the cost of a covering walk, in steps and quarter-turns.

Sources: Held and Karp 1970 for prices that rise where a relaxed walk is inconsistent;
Fekete and Krupke, "Practical methods for computing large covering tours and cycle covers with
turn cost", 2019, for the relaxation: a walk is a set of passages, one for each visit of a cell.

A passage enters its cell by one side and leaves it by another one, or by the same. It costs a step,
half of it for each side, and its quarter-turns: none straight on, one at a corner, two in a U-turn.
The first and the last visit have only one side, and cost half a step. Give each step a price that
the cell left pays and the cell entered receives. Prices cancel along a walk, so its cost is
unchanged. If no passage has a negative reduced cost, a walk costs at least the sum of:

* the cheapest first visit of the start;
* the cheapest passage of each cell to cover;
* the cheapest last visit of a given end. Without a given end a last visit replaces the passage of
  the cell where that saves most, because a best walk ends at the first visit of a cell to cover.

The prices after every iteration are exactly feasible (``kernels.bound.feasible``) and give a valid
bound; the best one counts.

All amounts are whole half microseconds: halves of steps, and sums that do not depend on order.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.bound.feasible import NO_SIDE, make_feasible
from fasaco_edge.kernels.bound.lines import Lines, StepPrices
from fasaco_edge.kernels.bound.passages import (
    cheapest,
    follow,
    sides_of,
    use_passage,
    use_side,
    which_side,
)
from fasaco_edge.kernels.jit import as_value, inlined, lean_kernel


@lean_kernel
def ascend(
    lines: Lines, prices: StepPrices, step: int, turn: int, pace: int, falls: int, times: int
) -> int:
    """Improve the prices; return the best bound found [half us], with its prices in ``best``.

    A subgradient method with exactly feasible iterates: each price follows the imbalance of its
    step, leavings minus entries, averaged over the last iterations.

    Args:
        lines: the cells, two or more.
        prices: initial ones, feasible or not; changed in place.
        step, turn: a step and a quarter-turn [half us], the step an even number.
        pace: initial step size of the prices [half us].
        falls: over all iterations the pace falls by a factor of about e ** falls.
        times: number of iterations.
    """
    best = 0
    for _ in range(times):
        make_feasible(lines, prices, step, turn)
        bound = _relaxed(lines, prices, step, turn)
        if bound > best:
            best = bound
            _copy(prices.price, prices.best)
        follow(lines, prices, pace)
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
    """Return the bound of feasible prices; count in ``use`` how its passages use each side."""
    use = prices.use
    for axis in range(2):
        for index in range(lines.sides.size):
            use[axis, index] = 0
    total, saving, last = 0, -NO_SIDE, as_value(-1)
    for cell in range(lines.sides.size):
        if lines.wanted[cell]:
            sides = sides_of(lines, prices, cell)
            least = cheapest(sides, step, turn)
            total += least
            use_passage(lines, use, cell, sides, least, step, turn, as_value(1))
            if least - step // 2 - min(sides) > saving:
                saving, last = least - step // 2 - min(sides), cell
    if lines.end >= 0:
        last = lines.end
    elif last >= 0:
        sides = sides_of(lines, prices, last)
        least = cheapest(sides, step, turn)
        total -= least
        use_passage(lines, use, last, sides, least, step, turn, as_value(-1))
    for end in (lines.start, last):
        sides = sides_of(lines, prices, end)
        total += step // 2 + min(sides)
        use_side(lines, use, end, which_side(sides, min(sides)), as_value(1))
    return total
