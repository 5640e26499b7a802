"""Bands of rows that a ground is cut into, and their tighter bound (``kernels.bound.bands``)."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.bound.bands import Bands, begin_bands, end_bands, solve_bands
from fasaco_edge.kernels.bound.lines import Lines, StepPrices
from fasaco_edge.kernels.bound.ways import INCOMING, OUTGOING, PATTERNS, BandMemory

# Limit on the rows of a band: each extra row triples the number of states.
WIDEST = 5
# Initial step size of a price, as a share of a quarter-turn's cost; its factor per iteration.
PACE, FALLS = 0.5, 0.9
MOST_ITERATIONS = 40
# Memory limits on the states of one band: in all, and per cell.
MOST_STATES, STATES_A_CELL = 400_000, 300

# Masks of sides with rows and columns exchanged.
_EXCHANGED = np.array([(mask & 5) << 1 | (mask & 10) >> 1 for mask in range(16)], np.uint8)


class BandBound:
    """The tighter bound of a ground, by bands along rows or along columns.

    Args:
        lines: the cells, two or more.
        prices: initial prices: those of the best bound so far; not changed.
        row, col: of each cell, int (m,).
        step, turn: their costs [half us].
    """

    def __init__(
        self,
        lines: Lines,
        prices: StepPrices,
        row: NDArray[np.int64],
        col: NDArray[np.int64],
        step: int,
        turn: int,
    ) -> None:
        self._step, self._turn = step, turn
        order = np.argsort(lines.rank)
        along = lines, _copied(prices.best), bands_of(lines, row, col)
        turned = transposed(lines)
        across = turned, _copied(prices.best[::-1]), bands_of(turned, col[order], row[order])
        self._options = [(*each, band_memory(each[2], step + turn)) for each in (along, across)]
        self._bounds = [0, 0]
        # Number of finished iterations; whether one is under way.
        self._done = 0
        self._is_begun = False

    def improve(self, cells: int) -> int:
        """Solve the next bands, about ``cells`` cells; return the bound [half us], or 0.

        The last band of an iteration gives the bound. The first two iterations try both directions;
        the better one continues.
        """
        which = self._done if self._done < 2 else int(self._bounds[1] > self._bounds[0])
        lines, prices, bands, memory = self._options[which]
        if not self._is_begun:
            begin_bands(lines, prices, memory, self._step, self._turn)
        ground = lines, prices, bands, memory
        self._is_begun = solve_bands(*ground, self._step, self._turn, cells)
        if self._is_begun:
            return 0
        pace = round(PACE * FALLS ** max(self._done - 1, 0) * self._turn)
        bound = end_bands(*ground, self._step, self._turn, pace)
        if self._done < 2:
            self._bounds[which] = bound
        self._done += 1
        return bound

    @property
    def is_done(self) -> bool:
        """Return whether further iterations would gain next to nothing."""
        return self._done >= MOST_ITERATIONS


def transposed(lines: Lines) -> Lines:
    """Return the ground with rows and columns exchanged."""
    order = np.argsort(lines.rank).astype(np.int32)
    # East and north are exchanged, and so are west and south.
    sides = _EXCHANGED[lines.sides[order]]
    start = int(lines.rank[lines.start])
    end = int(lines.rank[lines.end]) if lines.end >= 0 else -1
    links = np.ascontiguousarray(lines.links[::-1])
    return Lines(sides, order, links, lines.wanted[order], start, end)


def _copied(price: NDArray[np.int64]) -> StepPrices:
    """Return a copy of prices."""
    price = np.array(price, order="C")
    return StepPrices(price, price.copy(), *(np.zeros_like(price) for _ in range(3)))


def bands_of(lines: Lines, row: NDArray[np.int64], col: NDArray[np.int64]) -> Bands:
    """Cut a ground along its rows into bands, with the fewest possible steps between bands.

    Args:
        lines: its cells.
        row, col: of each cell, int (m,).
    """
    height = int(row.max()) + 1
    # Number of steps from each row to the next one.
    down = np.bincount(row, weights=lines.sides >> 1 & 1, minlength=height).astype(np.int64)
    cuts = _cuts(down)
    band = np.searchsorted(cuts, row, side="right")
    top = np.concatenate(([0], cuts))
    place = (row - top[band]).astype(np.uint8)
    order = np.lexsort((row, col, band)).astype(np.int32)
    last = np.concatenate((cuts, [height]))[band] - 1
    inner = lines.sides & ~((row == last) * np.uint8(2)) & ~((place == 0) * np.uint8(8))
    # Where no step leads from a column of a band to the next column, another band begins.
    column = (band * (int(col.max()) + 2) + col)[order]
    leads_on = np.bincount(column, weights=lines.sides[order] & 1) > 0
    begins = np.diff(column, prepend=-1) > 0
    begins[1:] &= ~leads_on[column[:-1]]
    first = np.append(np.flatnonzero(begins), order.size).astype(np.int32)
    return Bands(order, place, inner.astype(np.uint8), first, int(place.max()) + 1)


def _cuts(down: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the first row of each band, except the first band."""
    height = down.size
    # Least number of steps cut above each row, and the first row of the band before.
    least, before = [0] * (height + 1), [0] * (height + 1)
    for row in range(1, height + 1):
        cut = int(down[row - 1]) if row < height else 0
        # Of equal cuts the one with the widest band.
        options = range(max(row - WIDEST, 0), row)
        before[row] = min(options, key=lambda top: least[top])
        least[row] = least[before[row]] + cut
    cuts = []
    row = before[height]
    while row:
        cuts.append(row)
        row = before[row]
    return np.array(cuts[::-1], np.int64)


def band_memory(bands: Bands, corner: int) -> BandMemory:
    """Return working memory; ``corner``: cost of a step and a quarter-turn [half us]."""
    count, most = bands.first.size - 1, int(np.diff(bands.first).max())
    states = min(MOST_STATES, STATES_A_CELL * most + 1)
    return BandMemory(
        sums=np.zeros(3, np.int64),
        limit=np.full(count, corner // 2 + 1, np.int64),
        found=np.zeros((count, 2), np.int64),
        is_met=np.zeros(count, np.uint8),
        entry=np.full(2 << 2 * bands.width + 2, -1, np.int32),
        value=np.zeros(states, np.int64),
        state=np.zeros(states, np.int32),
        parent=np.zeros(states, np.int32),
        pattern=np.zeros(states, np.int32),
        begins=np.zeros(most + 2, np.int32),
        codes=CODES,
        counts=COUNTS,
        cost=np.zeros((3, PATTERNS), np.int64),
        how=np.zeros(PATTERNS, np.int16),
        listed=np.zeros((2, INCOMING), np.int32),
        ways=np.zeros((2, INCOMING, OUTGOING), np.int16),
        priced=np.zeros((2, INCOMING, OUTGOING), np.int64),
    )


def _codes() -> tuple[NDArray[np.int16], NDArray[np.int32]]:
    """Return by mask of sides all ways to use each side 0, 1 or 2 times, and their number."""
    codes, counts = np.zeros((16, 81), np.int16), np.zeros(16, np.int32)
    for mask in range(16):
        digits = [range(3) if mask >> side & 1 else range(1) for side in range(3, -1, -1)]
        ways = [
            south << 6 | west << 4 | north << 2 | east
            for south, west, north, east in itertools.product(*digits)
        ]
        codes[mask, : len(ways)], counts[mask] = ways, len(ways)
    return codes, counts


CODES, COUNTS = _codes()
