"""Lower bounds of a problem: steps and seconds of any walk that solves it.

The proofs are in ``kernels.bound``: ``covering`` counts steps alone, ``turns`` also prices turns.
The bound with turns is itself a search: with more work it approaches the optimum of its relaxation.
Work is counted, so the same calls give the same bounds.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels import EAST, NORTH, SOUTH, WEST
from fasaco_edge.kernels.bound.covering import covering_bound
from fasaco_edge.kernels.bound.lines import ALONG_COLS, ALONG_ROWS, StepPrices, lines_of
from fasaco_edge.kernels.bound.turns import ascend
from fasaco_edge.kernels.lattice.reach import reachable_from
from fasaco_edge.planners.cost import MICROSECONDS
from fasaco_edge.planners.problem import CoverageProblem

# Units of work: cells times iterations; a million takes about 50 ms. GLANCE is for repairs and
# first walks, THOROUGH for searches.
GLANCE, THOROUGH = 80_000, 400_000
FEWEST, MOST = 8, 300

# Largest lattice [cells] whose bound includes turns: prices take about 100 bytes per cell.
MOST_CELLS = 250_000

# Exponent of the decay of the step size of prices; the first step size is a quarter-turn's cost.
FALLS = 4


def lower_bound_steps(problem: CoverageProblem) -> int:
    """Return a lower bound on the steps of any walk that solves ``problem``, ignoring turns."""
    required = problem.to_cover.astype(np.uint8)
    return covering_bound(problem.lattice.steps, required, problem.flat_start, problem.flat_end)


class LowerBound:
    """Lower bounds on all walks that solve a problem.

    Attributes:
        steps: lower bound on the number of steps.
        cost_us: lower bound on the cost [us].
    """

    def __init__(self, problem: CoverageProblem) -> None:
        self._cost = problem.cost
        self.steps = lower_bound_steps(problem)
        self.cost_us = self.steps * self._cost.step_us
        # A walk without steps has no turns.
        is_small = problem.lattice.states.size <= MOST_CELLS
        self._turns = is_small and self.steps > 0 and self._cost.quarter_turn_us > 0
        if not self._turns:
            return
        lattice = problem.lattice
        reached = reachable_from(lattice.steps, *lattice.local(problem.start))
        required = problem.to_cover.astype(np.uint8)
        start, end = problem.flat_start, problem.flat_end
        self._lines = lines_of(lattice.steps, required, reached, start, end)
        self._flat = np.flatnonzero(reached).astype(np.int32)
        size = 2, self._lines.sides.size
        self._prices = StepPrices(*(np.zeros(size, np.int64) for _ in StepPrices._fields))

    @property
    def cost_s(self) -> float:
        """Lower bound on the cost [s]."""
        return self.cost_us / MICROSECONDS

    def tighten(self, work: int) -> None:
        """Improve ``cost_us`` with an amount of work, in cells times iterations."""
        if not self._turns or not work:
            return
        step, turn = 2 * self._cost.step_us, 2 * self._cost.quarter_turn_us
        times = min(max(work // self._lines.sides.size, FEWEST), MOST)
        doubled = ascend(self._lines, self._prices, step, turn, FALLS, times)
        # A cost is a whole number of microseconds, and a multiple of the common divisor of both
        # prices.
        unit = math.gcd(self._cost.step_us, self._cost.quarter_turn_us)
        self.cost_us = max(self.cost_us, -(-doubled // (2 * unit)) * unit)

    def side_prices(self) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.bool_]]:
        """Return the prices of the best bound on the cost, if turns cost.

        Returns:
            The reachable cells, int32 (m,) flat; their prices for sides by direction,
            int64 (m, 4) [half us], 0 for no step; whether the passage of each cell is paid,
            bool (m,).
        """
        lines, best = self._lines, self._prices.best
        prices = np.zeros((lines.sides.size, 4), np.int64)
        has = [(lines.sides >> direction & 1).astype(bool) for direction in range(4)]
        number, rank = np.arange(lines.sides.size), lines.rank
        prices[has[EAST], EAST] = best[ALONG_ROWS, number[has[EAST]]]
        prices[has[NORTH], NORTH] = best[ALONG_COLS, rank[has[NORTH]]]
        prices[has[WEST], WEST] = -best[ALONG_ROWS, number[has[WEST]] - 1]
        prices[has[SOUTH], SOUTH] = -best[ALONG_COLS, rank[has[SOUTH]] - 1]
        return self._flat, prices, lines.wanted > 0


def lower_bound_of(problem: CoverageProblem, work: int = THOROUGH) -> LowerBound:
    """Return the bounds of a problem after this much work."""
    bound = LowerBound(problem)
    bound.tighten(work)
    return bound
