"""Reachable area: the cells the robot can reach, updated incrementally."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.changes import LatticeChange, carried, carried_copy
from fasaco_edge.grid.geometry import Pose2D, Window
from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.kernels import COL_STEP, ROW_STEP
from fasaco_edge.kernels.lattice.reach import reachable_from, shortest_walk, update_reach

# If the robot's own cell is not coverable, by a small offset or a noisy scan, the nearest coverable
# cell within this distance is taken [cells].
ANCHOR_CELLS = 1.5

# Bit of a step in a step mask, by index 3 * rows + columns + 4.
_BIT_OF_MOVE = np.zeros(9, np.uint8)
for _direction, (_row, _col) in enumerate(zip(ROW_STEP, COL_STEP, strict=True)):
    _BIT_OF_MOVE[3 * _row + _col + 4] = 1 << _direction

# Share of changed cells above which a full search is as fast.
LOCAL_SHARE = 0.01


@dataclass(frozen=True, slots=True)
class AreaChange:
    """Counts of reachable cells gained, lost, or with other steps than before.

    ``window``: the smallest window around these cells; None for none.
    """

    gained: int
    lost: int
    rewired: int
    window: Window | None = field(default=None, compare=False)

    def __bool__(self) -> bool:
        return bool(self.gained or self.lost or self.rewired)

    def __str__(self) -> str:
        parts = [
            f"{count} {'cell' if count == 1 else 'cells'} {what}"
            for count, what in ((self.gained, "more"), (self.lost, "fewer"))
            if count
        ]
        if not parts:
            parts = [f"passages changed at {self.rewired} cells"]
        return "map: " + ", ".join(parts)


@dataclass(frozen=True, slots=True, eq=False)
class ReachableArea:
    """A lattice and which of its cells the robot can reach, bool (rows, cols)."""

    lattice: CoverageLattice
    reachable: NDArray[np.bool_]

    @classmethod
    def around(cls, lattice: CoverageLattice, cell: Cell) -> Self:
        """Return the area that is reachable from a coverable ``cell``."""
        reachable = reachable_from(lattice.steps, *lattice.local(cell)).astype(bool)
        return cls(lattice, reachable)

    def updated(self, change: LatticeChange, cell: Cell) -> ReachableArea:
        """Return the area that is reachable from ``cell`` after a change of the lattice.

        Equals ``around``, but is computed incrementally where possible.
        """
        lattice = change.after
        if lattice is self.lattice and self.contains(cell):
            return self
        if change.before is not self.lattice:
            return ReachableArea.around(lattice, cell)
        old, new = self.lattice.window, lattice.window
        changed = change.cells - np.array((new.row0, new.col0), np.int32)
        is_local = 0 < len(changed) <= lattice.states.size * LOCAL_SHARE
        if is_local and (changed >= 0).all() and (changed < (new.rows, new.cols)).all():
            steps = carried(self.lattice.steps, old, new)
            steps.flags.writeable = False
            reachable = carried_copy(self.reachable, old, new)
            if update_reach(steps, lattice.steps, changed, reachable, *lattice.local(cell)):
                return ReachableArea(lattice, reachable)
        return ReachableArea.around(lattice, cell)

    def contains(self, cell: Cell) -> bool:
        """Return whether ``cell`` is reachable."""
        return self.lattice.contains(cell) and bool(self.reachable[self.lattice.local(cell)])

    def change_since(self, before: ReachableArea) -> AreaChange:
        """Compare with the previous area; cells outside an array are not reachable."""
        if before is self:
            return AreaChange(0, 0, 0)
        mine, theirs = self.lattice.window, before.lattice.window
        common = mine.intersection(theirs)
        total, total_before = np.count_nonzero(self.reachable), np.count_nonzero(before.reachable)
        if common is None:
            window = Window.around(_around(self.reachable, mine), _around(before.reachable, theirs))
            return AreaChange(int(total), int(total_before), 0, window)
        here, there = common.slices_in(mine), common.slices_in(theirs)
        now, then = self.reachable[here], before.reachable[there]
        both = now & then
        kept = np.count_nonzero(both)
        rewired = (self.lattice.steps[here] != before.lattice.steps[there]) & both
        change = AreaChange(
            gained=int(total - kept),
            lost=int(total_before - kept),
            rewired=int(np.count_nonzero(rewired)),
        )
        if not change:
            return change
        # Cells reachable in only one of the areas, even outside the other's window.
        came, went = self.reachable.copy(), before.reachable.copy()
        came[here] &= ~then
        went[there] &= ~now
        window = Window.around(_around(rewired, common), _around(came, mine), _around(went, theirs))
        return replace(change, window=window)

    def drivable_prefix(self, cells: NDArray[np.int32]) -> int:
        """Return how many leading cells of a path, int32 (n, 2), can be driven; 0 for none."""
        if not len(cells):
            return 0
        lattice = self.lattice
        if not lattice.is_coverable((int(cells[0, 0]), int(cells[0, 1]))):
            return 0
        allowed = lattice.window.values_at(lattice.steps, cells[:-1], 0)
        row_moves, col_moves = np.diff(cells[:, 0]), np.diff(cells[:, 1])
        is_step = np.abs(row_moves) + np.abs(col_moves) == 1
        allowed &= _BIT_OF_MOVE.take(3 * row_moves + col_moves + 4, mode="clip")
        legal = is_step & (allowed != 0)
        return 1 + int(np.argmin(legal)) if not legal.all() else len(cells)

    def shortest_path(self, start: Cell, goal: Cell) -> NDArray[np.int32]:
        """Return a shortest path, int32 (n, 2); empty for none."""
        lattice = self.lattice
        if not (lattice.contains(start) and lattice.contains(goal)):
            return np.empty((0, 2), np.int32)
        walk = shortest_walk(lattice.steps, lattice.local(start), lattice.local(goal))
        offset = np.array((lattice.window.row0, lattice.window.col0), np.int32)
        return (walk + offset).astype(np.int32)


def _around(marked: NDArray[np.bool_], window: Window) -> Window | None:
    """Return the smallest window around the marked cells of ``window``, bool (rows, cols)."""
    found = Window.of(marked)
    return found.moved(window.row0, window.col0) if found else None


def anchor_cell(lattice: CoverageLattice, pose: Pose2D) -> Cell | None:
    """Return the coverable cell at ``pose``, or the nearest beside it; None for none."""
    row, col = lattice.cell_at(pose.x, pose.y)
    best, best_distance = None, ANCHOR_CELLS * lattice.cell_m
    for cell in ((row + i, col + j) for i in (0, -1, 1) for j in (0, -1, 1)):
        if not lattice.is_coverable(cell):
            continue
        if cell == (row, col):
            return cell
        x, y = (cell[1] + 0.5) * lattice.cell_m, (cell[0] + 0.5) * lattice.cell_m
        distance = math.hypot(x - pose.x, y - pose.y)
        if distance < best_distance:
            best, best_distance = cell, distance
    return best
