"""Planner of the user's own: its input, checks of the walk that it returns, and its interface."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import IllegalWalk
from fasaco_edge.planners.own.loading import RAISED, UserCode, failure, too_long
from fasaco_edge.planners.own.time_limit import TookTooLongError, no_longer_than
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import Observer, StoppingCriterion
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.text import shown

if TYPE_CHECKING:
    from fasaco_edge.grid.lattice import Cell

# Offsets (row, col) to the neighbours: east, north, west, south.
MOVES = ((0, 1), (1, 0), (0, -1), (-1, 0))
# Limit on steps per cell: sound planners take a few; an endless walk would fill the memory.
MOST_STEPS_PER_CELL = 200


@dataclass(frozen=True, slots=True, eq=False)
class GridProblem:
    """Input of a planner; cells (row, col) are array indices, row 0 has the smallest y.

    Attributes:
        steps: bool (rows, cols, 4), read-only: whether the robot can go from a cell to its
            neighbour in the east (col + 1), north (row + 1), west, south.
        to_cover: bool (rows, cols), read-only: the cells to visit, all reachable.
        start: the start cell.
        end: the end cell; None for anywhere.
        cell_m: edge of a cell [m].
        step_s, quarter_turn_s: durations of a step and of a turn by 90 degrees [s].
        seed: seed for a randomised planner.
    """

    steps: NDArray[np.bool_]
    to_cover: NDArray[np.bool_]
    start: Cell
    end: Cell | None
    cell_m: float
    step_s: float
    quarter_turn_s: float
    seed: int

    def neighbours(self, cell: Cell) -> list[Cell]:
        """Return the neighbours that one step leads to, counter-clockwise from east."""
        row, col = cell
        ways = zip(MOVES, self.steps[row, col], strict=True)
        return [(row + up, col + right) for (up, right), is_open in ways if is_open]


def grid_problem(problem: CoverageProblem, seed: int) -> GridProblem:
    """Return a problem as the input of a planner of the user's own."""
    lattice, cost = problem.lattice, problem.cost
    bits = lattice.steps[..., np.newaxis] >> np.arange(len(MOVES), dtype=np.uint8)
    steps = (bits & 1).astype(np.bool_)
    steps.setflags(write=False)
    return GridProblem(
        steps,
        problem.to_cover,
        lattice.local(problem.start),
        None if problem.end is None else lattice.local(problem.end),
        lattice.cell_m,
        cost.step_s,
        cost.quarter_turn_s,
        seed,
    )


@dataclass(frozen=True, slots=True)
class OwnPlanner:
    """A user's code as a planner.

    Attributes:
        code: the code.
        seed: seed passed to the code.
        most_s: time that it may take [s]; None for no limit.
    """

    code: UserCode
    seed: int = 0
    most_s: float | None = None

    def plan(
        self, problem: CoverageProblem, stop: StoppingCriterion, observe: Observer
    ) -> CoveragePath:
        """Return the code's walk; only ``most_s`` ends it, and ``observe`` is not called.

        Raises:
            PlannerFailed: the code raised, or took longer than ``most_s``.
            IllegalWalk: the result is not a walk, or does not solve the problem.
        """
        given, began = grid_problem(problem, self.seed), time.perf_counter()
        cells = walk_of(self.code, given, self.most_s)
        taken_s = time.perf_counter() - began
        window = problem.lattice.window
        cells = cells + np.array((window.row0, window.col0), np.int32)
        cost_s = problem.cost.of_walk(cells)
        return CoveragePath(cells, self.code.name, self.seed, cost_s=cost_s, first_walk_s=taken_s)


def walk_of(code: UserCode, problem: GridProblem, most_s: float | None = None) -> NDArray[np.int32]:
    """Return the walk of a planner of the user's own, int32 (n, 2).

    ``most_s`` is the time that the code may take [s]; None for no limit.

    Raises:
        PlannerFailed: the code raised, or took longer than ``most_s``.
        IllegalWalk: the result is not a walk, or does not solve the problem.
    """
    try:
        # The user's code runs here only: ``_in_bounds`` also runs it, if it returned a generator.
        with no_longer_than(most_s):
            given = code.walk(problem)
            if not isinstance(given, Iterable) or getattr(given, "shape", None) == ():
                raise IllegalWalk(f"planner {code.name}: it must return cells, got {shown(given)}")
            walk = _in_bounds(given, MOST_STEPS_PER_CELL * problem.to_cover.size)
    except TookTooLongError as error:
        raise too_long(error, code.name, code.file, most_s) from error
    except IllegalWalk:
        raise
    except RAISED as error:
        raise failure(error, code.name, code.file) from error
    return _checked(problem, walk, code.name)


def _in_bounds(walk: Iterable[Cell], most: int) -> list[Cell | str]:
    """Return the first ``most + 1`` cells that the code returned or yielded, as plain integers.

    An item that is no cell ends the list, and is returned as text.
    """
    found: list[Cell | str] = []
    for _, given in zip(range(most + 1), walk, strict=False):
        cell = _cell(given)
        found.append(shown(given) if cell is None else cell)
        if cell is None:
            break
    return found


def _checked(problem: GridProblem, walk: list[Cell | str], name: str) -> NDArray[np.int32]:
    """Return a walk, int32 (n, 2); raise IllegalWalk, with the step, if it is no solution."""

    def no(why: str) -> IllegalWalk:
        return IllegalWalk(f"planner {name}: {why}")

    if len(walk) > MOST_STEPS_PER_CELL * problem.to_cover.size:
        raise no(f"its walk does not end: more than {len(walk) - 1} cells")
    before: Cell | None = None
    seen = np.zeros(problem.to_cover.shape, np.bool_)
    for number, cell in enumerate(walk):
        if isinstance(cell, str):
            raise no(f"cell {number} of its walk must be (row, col), got {cell}")
        if before is None and cell != problem.start:
            raise no(f"its walk must begin in the start cell {problem.start}, begins in {cell}")
        if before is not None and cell not in problem.neighbours(before):
            raise no(
                f"step {number} of its walk, {before} to {cell}, {_why_not(problem, before, cell)}"
            )
        seen[cell] = True
        before = cell
    if before is None:
        raise no("its walk is empty; it has the start cell at least")
    if problem.end not in (None, before):
        raise no(f"its walk must end in cell {problem.end}, ends in {before}")
    left = problem.to_cover & ~seen
    if left.any():
        first = tuple(np.argwhere(left)[0].tolist())
        total = np.count_nonzero(problem.to_cover)
        raise no(f"its walk leaves {np.count_nonzero(left)} of {total} cells, the first is {first}")
    return np.array(walk, np.int32)


def _cell(given: object) -> Cell | None:
    """Return an item as a cell of plain integers; None if it is not a cell."""
    if not isinstance(given, Sequence | np.ndarray):
        return None
    try:
        row, col = (int(at) for at in given)
        return (row, col) if row == given[0] and col == given[1] else None
    except (TypeError, ValueError, OverflowError):
        return None


def _why_not(problem: GridProblem, here: Cell, there: Cell) -> str:
    rows, cols = problem.to_cover.shape
    if not (0 <= there[0] < rows and 0 <= there[1] < cols):
        return f"leaves the grid of {rows} x {cols} cells"
    if abs(there[0] - here[0]) + abs(there[1] - here[1]) != 1:
        return "is not to a neighbour in the same row or column"
    if not problem.steps[there].any():
        return "is to a cell that is not free"
    return "is not possible: the robot does not fit between the two"
