"""Simulated annealing of all robots' closed walks together: shorter in all, and equally long."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.fleet.planning.tours import Tour
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.fleet.annealing import anneal
from fasaco_edge.kernels.fleet.walks import STEP, Walks, add_tour, driven, walks_of
from fasaco_edge.planners.cost import CoverageCost


class Schedule(NamedTuple):
    """How walks are annealed, from several first tours; the best of these again, for longer.

    Attributes:
        hot, cold: temperatures from the first proposal to the last, in energy of a sixteenth.
        per_cell, most: proposals per cell, and a limit on them; they double after so many
            generations of attempts as DOUBLED says.
        attempts: number of first tours of a generation.
        again_hot, again: temperature from which the best of them is annealed again, and how many
            times as many proposals; 0 for not.
    """

    hot: int
    cold: int
    per_cell: int
    most: int
    attempts: int
    again_hot: int
    again: int


STEPS = Schedule(
    hot=12 * 16, cold=3 * 16, per_cell=50, most=150_000, attempts=4, again_hot=120, again=8
)
# Where turns have a price, a longer or hotter annealing spoils them, which local search does not
# make good again.
TURNS = Schedule(
    hot=4 * 16, cold=2 * 16, per_cell=500, most=1_500_000, attempts=1, again_hot=0, again=0
)
DOUBLED = 3
# Cells in the attempts of the first generation, which are fewer on a larger ground; least attempts.
AT_FIRST, FEWEST = 12_000, 2
# Weight of an uneven share at first, and from a while before the end on.
UNEVEN, FULL, FULL_FROM = 32, 256, 0.77
# Pieces of one annealing, after each of which the walks are compared; most proposals of a piece.
PIECES, MOST_PROPOSALS = 8, 100_000
# Limit of the kernels on what a quarter-turn in each cell may cost in all.
MOST_COST = 2**29


class FleetWalks:
    """The closed walks of robots on one ground, which annealing improves.

    Args:
        lattice: the cells where robots fit.
        reached: bool (rows, cols), the ground: connected cells.
        starts: flat cells.
        cost: prices of steps and turns.

    Attributes:
        schedule: how they are annealed.
        score: greatest cost of a walk and cost of all, in units of the kernels.
    """

    def __init__(
        self,
        lattice: CoverageLattice,
        reached: NDArray[np.bool_],
        starts: Sequence[int],
        cost: CoverageCost,
    ) -> None:
        cols = lattice.steps.shape[1]
        self._steps, self._cells = lattice.steps.ravel(), np.flatnonzero(reached)
        self._offsets = np.array([1, cols, -1, -cols], np.int64)
        self._starts = np.array(starts, np.int64)
        # The kernels square costs of whole walks.
        dear = MOST_COST // self._cells.size
        self._turn = min(cost.quarter_turn_us * STEP // cost.step_us, dear)
        self._best = np.zeros((len(starts), lattice.steps.size), np.uint8)
        self.score = 0, 0
        self.schedule = TURNS if self._turn else STEPS

    def attempts(self, generation: int) -> range:
        """Return the numbers of the attempts of a generation: few at first on a large ground."""
        most = self.schedule.attempts
        few = min(most, max(FEWEST, AT_FIRST // self._cells.size))
        first = generation * most
        return range(first, first + (most if generation else few))

    def load(self, tours: Sequence[Tour]) -> None:
        """Go on from these tours; together they pass all cells."""
        self._best[:] = 0
        for links, tour in zip(self._best, tours, strict=True):
            if tour.size > 1:
                add_tour(self._steps, self._offsets, links, tour)
        self.score = self._score_of(self._walks().costs)

    def improve(self, proposals: int, hot: int, random: NDArray[np.uint64]) -> Iterator[None]:
        """Anneal from the best walks on, in pieces.

        Args:
            proposals: how many.
            hot: temperature at first, in energy of a sixteenth.
            random: stream, uint64 (1,); advanced.
        """
        walks, pieces = self._walks(), max(PIECES, -(-proposals // MOST_PROPOSALS))
        for piece in range(pieces):
            cooling = self.schedule.cold - hot
            first, last = (hot + cooling * (piece + more) // pieces for more in (0, 1))
            progress = min(1.0, piece / (FULL_FROM * pieces))
            weight = int(UNEVEN * (FULL / UNEVEN) ** progress)
            anneal(walks, self._turn, first, last, weight, proposals // pieces, random)
            score = self._score_of(walks.costs)
            if score < self.score:
                self.score, self._best = score, walks.links.copy()
            yield

    def tours(self) -> list[Tour]:
        """Return the best walks as tours."""
        most = int(self._walks().costs.sum()) // STEP + 2
        tours = []
        for links, start in zip(self._best, self._starts.tolist(), strict=True):
            walk = driven(links.copy(), self._offsets, start, most)
            tours.append(walk[:-1] if len(walk) > 1 else walk)
        return tours

    def _walks(self) -> Walks:
        return walks_of(
            self._steps, self._offsets, self._cells, self._starts, self._best.copy(), self._turn
        )

    @staticmethod
    def _score_of(costs: NDArray[np.int64]) -> tuple[int, int]:
        return int(costs.max()), int(costs.sum())
