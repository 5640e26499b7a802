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

*Exactly feasible prices.* Along a line of cells the price of a step may fall by one step's cost
from one to the next, or passing straight on were too cheap: pooling adjacent violators (isotonic
regression) projects onto that. Corners and ways back are satisfied if what a side is paid stays
within a box, one for the two sides along the row and one along the column, that add up to the
cost of a corner. So the prices after every iteration give a valid bound; the best one counts.

All amounts are whole half microseconds: halves of steps, and sums that do not depend on order.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels import EAST, NORTH
from fasaco_edge.kernels.jit import inlined, kernel, lean_kernel

NO_SIDE = 1 << 60

# Of 256: what is kept of the running mean of directions, and what a new one adds. Trials on
# grids of 170 to 9,000 cells: 230 is slower at first, 160 no better at last.
KEPT, ADDED = 200, 56
UNIT = 256

ALONG_ROWS, ALONG_COLS = 0, 1


class Lines(NamedTuple):
    """Cells numbered along rows and along columns: lines of cells are runs of numbers.

    Attributes:
        sides: uint8 (m,), step masks, in the order of the rows.
        rank: int32 (m,), number of each of them in the order of the columns.
        links: uint8 (2, m), 1 where a step leads to the next cell: along rows, along columns.
        wanted: uint8 (m,), 1 for cells with a passage to pay: those to cover, but for the
            start and a given end.
        start, end: numbers of cells; end -1 for anywhere.
    """

    sides: NDArray[np.uint8]
    rank: NDArray[np.int32]
    links: NDArray[np.uint8]
    wanted: NDArray[np.uint8]
    start: int
    end: int


class StepPrices(NamedTuple):
    """Prices of the steps to the next cell: the cell pays them, the next one is paid.

    All arrays are int64 (2, m): along rows, along columns, in their order.

    Attributes:
        price: in force [half us].
        best: those of the best bound so far.
        trend: running mean of the directions of ascent [1 / 256].
        use: how much oftener cells pay a price than are paid it, in the cheapest passages;
            before that is known, working memory.
        box: what a side may be paid at most [half us].
    """

    price: NDArray[np.int64]
    best: NDArray[np.int64]
    trend: NDArray[np.int64]
    use: NDArray[np.int64]
    box: NDArray[np.int64]


@kernel
def lines_of(
    steps: NDArray[np.uint8],
    required: NDArray[np.uint8],
    reached: NDArray[np.uint8],
    start: int,
    end: int,
) -> Lines:
    """Number the cells that can be reached.

    Args:
        steps: step masks, uint8 (rows, cols); symmetric.
        required, reached: uint8 (rows, cols), 1 for cells to visit, and that can be reached.
        start, end: flat cells that can be reached; end -1 for anywhere.
    """
    rows, cols = steps.shape
    number = np.full((rows, cols), -1, np.int32)
    count = 0
    for row in range(rows):
        for col in range(cols):
            if reached[row, col]:
                number[row, col] = count
                count += 1
    sides, wanted = np.empty(count, np.uint8), np.empty(count, np.uint8)
    rank, links = np.empty(count, np.int32), np.empty((2, count), np.uint8)
    counted = 0
    for col in range(cols):
        for row in range(rows):
            cell = number[row, col]
            if cell >= 0:
                mask = steps[row, col]
                sides[cell], wanted[cell] = mask, required[row, col]
                rank[cell] = counted
                links[ALONG_ROWS, cell] = mask >> EAST & 1
                links[ALONG_COLS, counted] = mask >> NORTH & 1
                counted += 1
    first = number[start // cols, start % cols]
    last = number[end // cols, end % cols] if end >= 0 else -1
    wanted[first] = 0
    if end >= 0:
        wanted[last] = 0
    return Lines(sides, rank, links, wanted, int(first), int(last))


@kernel
def first_prices(lines: Lines, turn: int) -> StepPrices:
    """Return prices that rise evenly along each line, by half a turn's cost at either side of 0.

    So each cell of a long strip pays its part of the turn at the end.

    Args:
        lines: the cells.
        turn: a quarter-turn [half us].
    """
    size = lines.sides.size
    price = np.zeros((2, size), np.int64)
    for axis in range(2):
        first = 0
        for index in range(size):
            if not lines.links[axis, index]:
                length = index + 1 - first
                for inner in range(first, index):
                    price[axis, inner] = turn * (2 * (inner + 1 - first) - length) // (2 * length)
                first = index + 1
    return StepPrices(
        price,
        price.copy(),
        np.zeros((2, size), np.int64),
        np.zeros((2, size), np.int64),
        np.zeros((2, size), np.int64),
    )


@lean_kernel
def ascend(
    lines: Lines, prices: StepPrices, step: int, turn: int, pace: int, falls: int, times: int
) -> int:
    """Improve the prices; return the best bound met [half us], ``best`` having its prices.

    A subgradient method with exactly feasible iterates: each price follows how much oftener
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
        _make_feasible(lines, prices, step, turn)
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


@lean_kernel
def _make_feasible(lines: Lines, prices: StepPrices, step: int, turn: int) -> None:
    """Change the prices as little as it takes that no passage costs less than nothing."""
    for axis in range(2):
        _level(lines.links[axis], prices.price[axis], step, prices.use)
    _fit_boxes(lines, prices, step, turn)
    for axis in range(2):
        _clamp(lines.links[axis], prices.price[axis], prices.box[axis], step, prices.use[0])


@lean_kernel
def _level(
    links: NDArray[np.uint8], price: NDArray[np.int64], step: int, spare: NDArray[np.int64]
) -> None:
    """Let prices fall by no more than ``step`` from each one to the next of its line."""
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


@lean_kernel
def _fit_boxes(lines: Lines, prices: StepPrices, step: int, turn: int) -> None:
    """Share the cost of a corner among a cell's two axes, each as it needs."""
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


@lean_kernel
def _clamp(
    links: NDArray[np.uint8],
    price: NDArray[np.int64],
    box: NDArray[np.int64],
    step: int,
    highest: NDArray[np.int64],
) -> None:
    """Keep what sides are paid within the boxes, and prices from falling faster than ``step``.

    This alone makes any prices feasible; those that are level move less for it. ``highest``,
    int64 (m,), is working memory.
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
