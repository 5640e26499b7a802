"""Windows of a walk solved again, if turns cost.

Moves of local search change a walk where it touches itself. With expensive turns, better lanes need
changes of many cells together: ``kernels.windows`` solves a window of some 100 cells again, guided
by the prices of the lower bound; the walk outside the window stays.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.local_search.walk_array import FRAME, ROOM_BIT
from fasaco_edge.kernels.windows.memory import (
    KINDS,
    MOST_CHOICES,
    MOST_IDS,
    MOST_PAIRS,
    NO_END,
    PAIRINGS,
    Choices,
    Parts,
    Program,
    States,
    WalkPrices,
    WindowCells,
)
from fasaco_edge.kernels.windows.passages import BEGIN, NONE, SLOTS, Passages, passages_of, walk_of
from fasaco_edge.kernels.windows.program import advance_window, begin_window, end_window
from fasaco_edge.kernels.windows.search import ANY_PRICE, BEST, COST, SOLVED, Seams, solve_windows
from fasaco_edge.kernels.windows.window import WalkWindow, WindowSizes
from fasaco_edge.planners.bound import LowerBound
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.problem import CoverageProblem, FramedGround

# Limits on the cells of a window, and on the states kept: memory of 2 MB.
WINDOW_CELLS, MOST_BEAM = 256, 300
# Cost of a quarter-turn from which turns are expensive [steps]. Then windows are large; for cheaper
# turns small windows are as good, and faster.
DEAR_STEPS = 10
# Cost of a quarter-turn from which the whole ground is solved [steps]; at 1.25 this gains nothing.
WHOLE_STEPS = 2
# Lattices with more cells take too much memory: about 75 bytes per cell.
MOST_LATTICE = 250_000
# Price of a second ring when solving a whole ground [quarter-turns]: so high that any other
# continuation is preferred.
RING_TURNS = 1000
# Windows that join rings: number per piece, number of pieces, beam.
JOINS_AT_ONCE, JOIN_PIECES, JOIN_BEAM = 8, 40, 20
NO_SIDE = 1 << 60
# Expansions counted for a window without a possible gain, which expands no state; no limit.
EXPANSIONS_OF_WINDOW, NO_LIMIT = 64, 1 << 60
NO_SEAMS = Seams(np.empty((0, 2), np.int32), np.empty(0, np.int32))


def suits(problem: CoverageProblem) -> bool:
    """Return whether windows can be solved: turns cost, and the lattice is not too large."""
    size = problem.lattice.states.size
    return problem.cost.quarter_turn_us > 0 and size <= MOST_LATTICE and problem.cells > 1


def is_dear(cost: CoverageCost) -> bool:
    """Return whether turns are so expensive that they dominate the cost."""
    return cost.quarter_turn_us >= DEAR_STEPS * cost.step_us


def pays_whole(cost: CoverageCost) -> bool:
    """Return whether turns are expensive enough to solve the whole ground as one window."""
    return cost.quarter_turn_us >= WHOLE_STEPS * cost.step_us


class WindowSearch:
    """Windows of a problem's walk, solved one after the other.

    Args:
        problem: a problem with a price on turns.
        framed: its ground.
        bound: lower bound whose prices guide the search.
    """

    def __init__(self, problem: CoverageProblem, framed: FramedGround, bound: LowerBound) -> None:
        self._problem, self._framed, self._size = problem, framed, framed.ground.bound
        self._terms, reached = _terms(problem, framed, bound)
        # Unreachable cells are removed: windows contain only cells that the walk can visit.
        steps = np.zeros_like(framed.ground.steps)
        steps[reached] = framed.ground.steps[reached]
        self._ground = framed.ground._replace(steps=steps)
        dear = is_dear(problem.cost)
        self._aim = WindowSizes(
            cells=reached,
            rows=framed.rows + 2 * FRAME,
            cols=framed.width,
            frame=FRAME,
            least_side=3,
            most_side=8 if dear else 6,
            least_area=30,
            most_area=150 if dear else 40,
            beam=MOST_BEAM if dear else 60,
        )
        self._program = _program(self._size, self._aim.beam, WINDOW_CELLS)
        self._passages, self._best = self._no_passages(), self._no_passages()
        self._tally = np.zeros(4, np.int64)
        # Number of steps of the best walk, and the cost at which it was counted.
        self._counted_us, self._steps = -1, 0
        # The walk that the state belongs to.
        self._walk: NDArray[np.int32] | None = None

    def _no_passages(self) -> Passages:
        return Passages(np.empty((self._size, SLOTS), np.int8), np.zeros(2, np.int64))

    def load(self, walk: NDArray[np.int32]) -> bool:
        """Start from a walk, framed cells int32 (n,); return False if that is impossible.

        If it is the walk loaded or returned last, the state is resumed.
        """
        if walk is self._walk:
            return True
        self._walk = None
        given = walk
        lanes = np.empty((self._size, 2), np.uint8)
        walk = thinned(walk)
        if walk.size < 2 or not passages_of(self._ground, walk, lanes, self._passages):
            return False
        _copy(self._passages, self._best)
        self._tally[COST] = self._tally[BEST] = 2 * self._problem.cost_us(walk, self._framed)
        self._counted_us = -1
        self._walk = given
        return True

    def solve(self, expansions: int, random: NDArray[np.uint64]) -> None:
        """Solve windows until they have expanded this many states."""
        windows = max(expansions // EXPANSIONS_OF_WINDOW, 1)
        self._solve(self._aim, NO_SEAMS, windows, expansions, random)

    def _solve(
        self,
        aim: WindowSizes,
        seams: Seams,
        windows: int,
        expansions: int,
        random: NDArray[np.uint64],
    ) -> int:
        return solve_windows(
            *(self._ground, self._passages, self._best, self._terms, self._program, aim, seams),
            *(self._tally, windows, expansions, random),
        )

    def solve_whole(self, beam: int, mirrored: int, random: NDArray[np.uint64]) -> Iterator[None]:
        """Solve the whole ground as one window, with this beam; pause after each line.

        Then join the rings of the solution; keep the result if it is better. ``mirrored`` is the
        first corner, as in ``kernels.windows.window``.
        """
        framed, ground, passages, terms = (self._framed, self._ground, self._passages, self._terms)
        window = WalkWindow(FRAME, FRAME, framed.rows, framed.cols, framed.width, mirrored)
        program = _program(self._size, beam, self._aim.cells.size)
        price = RING_TURNS * terms.turn
        begin_window(ground, passages, terms, window, program, 0, ANY_PRICE, price, random)
        while advance_window(ground, passages, terms, window, program, beam):
            # Each line counts as work.
            self._tally[SOLVED] += 1
            yield
        self._tally[COST] += end_window(ground, passages, terms, window, program)
        self._tally[SOLVED] += 1
        aim = self._aim._replace(beam=JOIN_BEAM)
        seams = Seams(np.empty((self._size, 2), np.int32), np.empty_like(aim.cells))
        for _ in range(JOIN_PIECES):
            left = self._solve(aim, seams, JOINS_AT_ONCE, NO_LIMIT, random)
            yield
            if left == 1:
                break
        if left == 1 and self._tally[COST] < self._tally[BEST]:
            self._tally[BEST] = self._tally[COST]
            _copy(passages, self._best)
        else:
            self._tally[COST] = self._tally[BEST]
            _copy(self._best, passages)

    @property
    def best_us(self) -> int:
        """Cost of the best walk [us]."""
        return int(self._tally[BEST]) // 2

    @property
    def best_steps(self) -> int:
        """Number of steps of the best walk."""
        if self._counted_us != self.best_us:
            self._counted_us = self.best_us
            self._steps = int(np.count_nonzero(self._best.partner[:, :BEGIN] != NONE)) // 2
        return self._steps

    @property
    def solved(self) -> int:
        """Number of windows solved so far; each line of the whole ground counts as one."""
        return int(self._tally[SOLVED])

    def walk(self) -> NDArray[np.int32]:
        """Return the best walk, framed cells int32 (n,)."""
        # No step is taken more than twice.
        out = np.empty(4 * self._aim.cells.size + 2, np.int32)
        self._walk = out[: walk_of(self._ground, self._best, out)].copy()
        return self._walk


def _copy(source: Passages, target: Passages) -> None:
    target.partner[:], target.ends[:] = source


def thinned(walk: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return a walk over the same cells that takes no step three times, int32 (m,).

    If a step is taken three times, two of them have the same direction. Both are left out, and the
    part of the walk between them is reversed, so that the walk stays connected.
    """
    while walk.size > 1:
        low, high = np.minimum(walk[:-1], walk[1:]), np.maximum(walk[:-1], walk[1:])
        steps = low.astype(np.int64) * 2 + (high - low > 1)
        often, times = np.unique(steps, return_counts=True)
        if times.max() <= 2:
            break
        taken = np.flatnonzero(steps == often[times.argmax()])[:3]
        one, other = next((i, j) for i in taken for j in taken if i < j and walk[i] == walk[j])
        walk = np.concatenate((walk[:one], walk[one + 1 : other + 1][::-1], walk[other + 2 :]))
    return walk


def _terms(
    problem: CoverageProblem, framed: FramedGround, bound: LowerBound
) -> tuple[WalkPrices, NDArray[np.int32]]:
    """Return the terms, and the reachable cells, framed, in row order."""
    flat, priced, is_wanted = bound.side_prices()
    cells = framed.framed(flat)
    # Half a step is priced at each of the two cells.
    row, col, room = problem.cost.row_us, problem.cost.col_us, problem.cost.room_us
    priced = priced + np.array([row, col, row, col], np.int64)
    masks = framed.ground.steps[cells]
    priced += room * (masks[:, np.newaxis] >> (ROOM_BIT + np.arange(4)) & 1)
    prices = np.zeros((framed.ground.bound, 4), np.int64)
    prices[cells] = priced
    step, turn = 2 * problem.cost.step_us, 2 * problem.cost.quarter_turn_us
    sides = np.where(masks[:, np.newaxis] >> np.arange(4) & 1, priced, NO_SIDE).min(axis=1)
    # These prices keep the costs of the first and the last visit from being negative.
    ends = is_wanted if problem.end is None else flat == problem.flat_end
    begin_price = -(step // 2 + int(sides[flat == problem.flat_start].min()))
    end_price = -(step // 2 + int(sides[ends].min()))
    is_free = problem.end is None
    return WalkPrices(step, turn, prices, begin_price, end_price, is_free, row, col, room), cells


def _program(size: int, beam: int, cells: int) -> Program:
    """Return memory for windows with this many cells of a ground of ``size`` framed cells."""
    states, slots = 4 * beam, 1 << (16 * beam - 1).bit_length()
    mates = np.full((2, states, MOST_IDS), NO_END, np.int16)
    scratch, base = (np.full(MOST_IDS, NO_END, np.int16) for _ in range(2))
    choice = Choices(
        listed=np.zeros(KINDS, np.int32),
        keys=np.zeros((KINDS, MOST_CHOICES), np.int64),
        named=np.zeros(KINDS, np.int32),
        ends=np.zeros((KINDS, MOST_CHOICES, 2 * MOST_PAIRS), np.int16),
        new_ends=np.zeros((KINDS, MOST_CHOICES, MOST_PAIRS), np.uint8),
    )
    parts = Parts(
        label=np.zeros(size, np.int32),
        root=np.zeros(size, np.int32),
        number=np.zeros(size, np.int32),
        queue=np.zeros(cells, np.int32),
        splits=np.zeros(cells, np.uint8),
        left=np.zeros(cells, np.int32),
        needed=np.zeros(cells, np.int32),
        leads=np.zeros((MOST_IDS, 2), np.int16),
        sizes=np.zeros(2, np.int64),
    )
    of_states = States(
        mates=mates,
        words=mates.view(np.int64),
        cost=np.zeros((2, states), np.int64),
        closed=np.zeros((2, states), np.uint8),
        parent=np.zeros(states, np.int32),
        code=np.zeros(states, np.int64),
        hash=np.zeros(states, np.int64),
        table=np.zeros(slots, np.int64),
        order=np.zeros(states, np.int64),
        scratch=scratch,
        scratch_words=scratch.view(np.int64),
        base=base,
        base_words=base.view(np.int64),
        clock=np.zeros(2, np.int64),
    )
    of_window = WindowCells(
        listed=np.zeros(cells, np.int32),
        inside=np.zeros(size, np.uint8),
        ident=np.full((size, SLOTS), NO_END, np.int16),
        rim=np.zeros((MOST_IDS, 2), np.int32),
    )
    return Program(
        pairs=PAIRS,
        choice=choice,
        states=of_states,
        kept_parent=np.zeros((cells + 1, beam), np.int32),
        kept_code=np.zeros((cells + 1, beam), np.int64),
        cells=of_window,
        reduced=np.zeros((cells, 6, 6), np.int64),
        left=np.zeros(cells + 1, np.int64),
        taken=np.zeros(12, np.int16),
        sides=np.zeros(12, np.int64),
        at=np.zeros(11, np.int64),
        parts=parts,
    )


def _pairings() -> NDArray[np.int8]:
    """Return all pairings of 0, 2, 4, 6 and 8 slots, int8 (PAIRINGS, 8)."""
    rows: list[list[int]] = []

    def pair_up(left: list[int], paired: list[int]) -> None:
        if not left:
            rows.append(paired + [0] * (2 * MOST_PAIRS - len(paired)))
            return
        for other in left[1:]:
            rest = [slot for slot in left[1:] if slot != other]
            pair_up(rest, [*paired, left[0], other])

    for size in range(0, 2 * MOST_PAIRS + 1, 2):
        pair_up(list(range(size)), [])
    assert len(rows) == PAIRINGS
    return np.array(rows, np.int8)


PAIRS = _pairings()
