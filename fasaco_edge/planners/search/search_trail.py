"""Search trail: the pheromone that the ants of a search or a repair read and change.

It begins as the mission's living trail, and is uniform where the mission has none. For a search in
a region, the region's part of the trail is copied, and pasted back at the end.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.kernels.ants.fold import (
    FARTHEST,
    MOST_CELLS,
    MOST_ITEMS,
    MOST_TUNNELS,
    NOTHING,
    AntRules,
    DiscColony,
)
from fasaco_edge.kernels.local_search.regions import RegionBox
from fasaco_edge.kernels.local_search.walk_array import FRAME
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.living_trail import NO_TRAIL, TrailSnapshot, legal, mean_into
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.planner import ColonySnapshot
from fasaco_edge.planners.problem import CoverageProblem

# Number of ants that rebuild a disc (the cheapest result counts); range of the disc's radius.
ANTS, RADIUS = 16, (3, 6)
# A move has up to four quarter-turns: two before it, and two after a tunnel, which stands for a
# part of the walk outside of the disc (``kernels.ants.fold``).
MOST_QUARTERS = 4


class SearchTrail:
    """The trail over a problem's lattice, and the constants of the ants."""

    def __init__(self, problem: CoverageProblem, config: ColonyConfig) -> None:
        self.rules = _rules(problem, config)
        self._problem, self._before = problem, problem.trail or NO_TRAIL
        # The part that ants have walked on, and its window.
        self._window: Window | None = None
        self._tau = NO_TRAIL.tau

    def copy(self, box: RegionBox, out: NDArray[np.float64]) -> None:
        """Copy a region's part into ``out``, float64 (n, 4): a row per cell, the frame included."""
        _inner(box, out)[:] = self._on(self._window_of(box))

    def paste(self, box: RegionBox, trail: NDArray[np.float64]) -> None:
        """Copy a region's part back."""
        window = self._window_of(box)
        whole = Window.around(self._window, window) or window
        if whole != self._window:
            self._tau, self._window = self._on(whole), whole
        self._tau[window.slices_in(whole)] = _inner(box, trail)

    def changed(self) -> TrailSnapshot | None:
        """Return the part that ants have walked on, at the end; None if no ant has walked."""
        return None if self._window is None else TrailSnapshot(self._window, self._tau)

    def snapshot(self, ants: int, steps: int) -> ColonySnapshot:
        """Return the observer's view: the trail, the number of ants, the steps of the best walk."""
        lattice = self._problem.lattice
        tau = self._on(lattice.window) * legal(lattice.steps)
        window, cell_m, mean = lattice.window, lattice.cell_m, mean_into(tau)
        return ColonySnapshot(window, cell_m, mean, 0, 0, ants, steps, tau)

    def _on(self, window: Window) -> NDArray[np.float32]:
        """Return the trail on a window, float32 (rows, cols, 4); tau0 where there was none."""
        before = self._before.on(window)
        tau = np.where(before > 0, before, np.float32(self.rules.tau0))
        common = self._window and window.intersection(self._window)
        if self._window and common:
            tau[common.slices_in(window)] = self._tau[common.slices_in(self._window)]
        return tau

    def _window_of(self, box: RegionBox) -> Window:
        whole = self._problem.lattice.window
        row, col = whole.row0 + box.row - FRAME, whole.col0 + box.col - FRAME
        return Window(row, col, row + box.rows, col + box.cols)


def _inner(box: RegionBox, trail: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the trail of a region without its frame, a view (rows, cols, 4)."""
    rows, cols = box.rows + 2 * FRAME, box.cols + 2 * FRAME
    return trail[: rows * cols].reshape(rows, cols, 4)[FRAME:-FRAME, FRAME:-FRAME]


def _rules(problem: CoverageProblem, config: ColonyConfig) -> AntRules:
    return AntRules(
        q0=config.q0,
        alpha=config.alpha,
        tau0=config.tau0,
        powers=powers_of_turns(problem.cost, config.beta),
        ants=ANTS,
        radius=RADIUS,
        velocities=np.array(config.velocities, np.int64),
        amount=1.0,
    )


def powers_of_turns(cost: CoverageCost, beta: float) -> NDArray[np.float64]:
    """Return eta ** beta of equation (5), Carr and Wang 2022, by the quarter-turns of a move.

    The result is float64 (5,). Eta is the duration of a step divided by the duration of the move
    with its turns.
    """
    move_s = cost.step_s + np.arange(MOST_QUARTERS + 1) * cost.quarter_turn_s
    eta = cost.step_s / move_s
    return np.asarray(eta**beta)


def colony_for(size: int, rules: AntRules) -> DiscColony:
    """Return memory for the ants on a ground of this many framed cells."""

    def cells(*shape: int) -> NDArray[np.int32]:
        return np.zeros(shape, np.int32)

    return DiscColony(
        trail=np.full((size, 4), rules.tau0),
        is_open=np.zeros(size, np.uint8),
        labels=cells(size),
        area=cells(MOST_CELLS),
        tunnels=cells(MOST_TUNNELS, 2),
        first_end=np.full(size, NOTHING, np.int32),
        next_end=cells(2 * MOST_TUNNELS),
        is_taken=np.zeros(MOST_TUNNELS + 1, np.uint8),
        old=cells(MOST_ITEMS),
        new=cells(MOST_ITEMS),
        best=cells(MOST_ITEMS),
        seen=cells(size),
        came_from=np.zeros(size, np.int8),
        queue=cells(FARTHEST + 4),
        counts=np.zeros(3, np.int64),
        saved_us=np.zeros(rules.velocities.size, np.int64),
        rules=rules,
    )
