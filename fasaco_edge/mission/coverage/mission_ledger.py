"""Mission ledger: covered cells and swept floor, valid while no map contradicts them.

A ledger from before a restart may belong to another building than the map now shows (``fit``). It
stays valid, and is compared with each map, until a map knows enough to decide. From then on each
map is compared with the previous building (``map.building_watch``).

In a fleet a cell counts as swept once a robot has swept its centre, and no robot drives there for
the rest of the cell's floor. The robot that has passed the cell remembers this rest, in any robot's
part, and sweeps it when its line passes near again.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import LedgerFullError, LedgerMismatchError
from fasaco_edge.grid.geometry import Point, Pose2D, Window
from fasaco_edge.grid.lattice import Cell, CoverageLattice, mask_of
from fasaco_edge.mission.coverage.fit import Fit, Verdict
from fasaco_edge.mission.coverage.floor_tiles import FLOOR_TILE, PIXEL_M
from fasaco_edge.mission.coverage.ledger import (
    DROPPED_TILES,
    MOST_TILES,
    TILE,
    Cells,
    CoverageLedger,
    LedgerSnapshot,
)
from fasaco_edge.mission.coverage.loop_closure import Motion, certain_floor, uncertain_cells
from fasaco_edge.mission.coverage.others_cells import OthersCells
from fasaco_edge.mission.coverage.swept_floor import (
    DROPPED_FLOOR_TILES,
    MOST_FLOOR_TILES,
    SweptFloor,
)

if TYPE_CHECKING:
    from fasaco_edge.mission.coverage.tool_sight import ToolSight

# New furniture blocks less than this share of the known covered cells on one map.
MANY_AT_ONCE = 0.2
# Limit on the passed cells kept; the oldest are dropped.
MOST_PASSED = 2_000
# Limit on the returns to a cell: a third return would leave the same floor unswept.
MOST_AGAIN = 2

PlaceOf = Callable[[Cell], Point | None]


def _full(most: int, size: str, dropped: int) -> LedgerFullError:
    return LedgerFullError(
        f"the ledger holds {most} tiles of {size} at most: the {dropped} farthest from the robot "
        "were dropped"
    )


class PassedCells:
    """Cells that the robot has passed and in which floor is unswept."""

    def __init__(self) -> None:
        # Sorted by their last check, oldest first.
        self._cells: dict[Cell, None] = {}

    def clear(self) -> None:
        """Forget all passed cells."""
        self._cells.clear()

    def add(self, cell: Cell) -> None:
        """Add a cell that the robot has passed."""
        self._cells[cell] = None
        if len(self._cells) > MOST_PASSED:
            self.drop(next(iter(self._cells)))

    def next(self, most: int) -> list[Cell]:
        """Return the cells to check now, oldest check first."""
        cells = list(self._cells)[:most]
        for cell in cells:
            del self._cells[cell]
            self._cells[cell] = None
        return cells

    def drop(self, cell: Cell) -> None:
        """Forget a cell: its floor is swept."""
        self._cells.pop(cell, None)

    def inside(self, window: Window) -> NDArray[np.bool_]:
        """Return which cells of a window are passed cells, bool (rows, cols)."""
        return mask_of(self._cells, window)


class MissionLedger:
    """Owns covered cells and swept floor.

    Attributes:
        current: the covered cells.
        floor: the swept floor.
        first_plan_reason: reason of the first plan.
        reopened: how often covered cells were opened again.
        shared: cells swept by other robots.
        passed: cells that this robot has passed while floor in them is unswept.
        before: the coverage from before a restart in the middle of an order; None for none.
    """

    def __init__(
        self,
        cell_m: float,
        tool_m: float,
        ahead_m: float = 0.0,
        shared: OthersCells | None = None,
        sight: ToolSight | None = None,
    ) -> None:
        """Start empty.

        Args:
            cell_m: edge of a cell [m].
            tool_m: width of the tool [m].
            ahead_m: distance of the tool's centre ahead of the robot's centre of rotation [m].
            shared: cells swept by other robots; None for a robot alone.
            sight: floor that the tool touches, if it is wider than the robot; else None.
        """
        self._sight = sight
        self._cell_m, self._tool_m, self._ahead_m = cell_m, tool_m, ahead_m
        self.current, self.floor = self._nothing("")
        self.first_plan_reason = "first plan"
        self.reopened = 0
        self.shared = shared or OthersCells()
        self.passed = PassedCells()
        self.before: LedgerSnapshot | None = None
        self._opened_again: Counter[Cell] = Counter()
        # The ledger from before a restart; None once a map has confirmed it.
        self._resumed: LedgerSnapshot | None = None

    @property
    def version(self) -> tuple[int, int, int]:
        """Changes whenever covered cells change."""
        return self.current.total, self.shared.version, self.reopened

    def visits(self, window: Window) -> NDArray[np.uint16]:
        """Return the visits to cells, uint16 (rows, cols); 1 for a cell that only others swept."""
        own = self.current.visits(window)
        return np.maximum(own, self.shared.swept(window)) if self.shared.version else own

    def record_restart(self, before: LedgerSnapshot) -> None:
        """Record the coverage from before a restart, in present cells."""
        self.before = before

    def not_since(self, window: Window) -> NDArray[np.bool_]:
        """Return which cells of a window were last visited before the restart."""
        visits = self.current.visits(window)
        if self.before is None:
            return np.zeros(visits.shape, np.bool_)
        same: NDArray[np.bool_] = (visits > 0) & (visits == self.before.visits(window))
        return same

    def snapshot(self) -> LedgerSnapshot:
        """Return a copy of the present coverage."""
        cells, floor = self.current.snapshot(), self.floor.snapshot()
        return replace(cells, floor=floor, fleet=self.shared.encode())

    def _nothing(self, frame: str) -> tuple[CoverageLedger, SweptFloor]:
        return CoverageLedger(self._cell_m, frame), SweptFloor(self._tool_m, self._sight)

    @property
    def is_confirmed(self) -> bool:
        """Whether no further map can contradict the ledger."""
        return self._resumed is None

    def restore(self, before: LedgerSnapshot, *, is_confirmed: bool = False) -> None:
        """Continue the ledger from before a restart; ``is_confirmed``: see the property."""
        self._resumed = None if is_confirmed else before
        self.current = CoverageLedger.restored(before)
        self.floor = SweptFloor.restored(before.floor, self._tool_m, self._sight)
        self.shared.restore(before.fleet)
        if cells := before.cells:
            self.first_plan_reason = f"first plan, {cells} cells were covered before"

    def record(
        self, pose: Pose2D, place_of: PlaceOf | None = None, farthest_m: float = 0.0
    ) -> LedgerFullError | None:
        """Record driving to ``pose``; return a fault if tiles were dropped.

        Args:
            pose: the robot's pose.
            place_of: see ``CoverageLedger.record``.
            farthest_m: longest possible drive since the previous pose; 0 if unknown [m].
        """
        tool = pose
        if ahead_m := self._ahead_m:
            x = pose.x + ahead_m * math.cos(pose.yaw)
            tool = Pose2D(x, pose.y + ahead_m * math.sin(pose.yaw), pose.yaw)
        dropped = self.current.dropped, self.floor.dropped
        self.current.record(pose, place_of, farthest_m)
        self.floor.record(tool, farthest_m)
        if self.current.dropped != dropped[0]:
            return _full(MOST_TILES, f"{TILE} x {TILE} cells", DROPPED_TILES)
        if self.floor.dropped != dropped[1]:
            pixels = f"{FLOOR_TILE} x {FLOOR_TILE} pixels of floor"
            return _full(MOST_FLOOR_TILES, pixels, DROPPED_FLOOR_TILES)
        return None

    def may_open_again(self, cell: Cell) -> bool:
        """Return whether a cell may be opened once more."""
        return self._opened_again[cell] < MOST_AGAIN

    def open_again(self, cells: Collection[Cell]) -> None:
        """Count cells as uncovered, as floor in them is unswept."""
        for cell in cells:
            self.current.open_again(cell)
        self._opened_again.update(cells)
        self.reopened += 1
        self.shared.record_forgotten()

    def break_track(self) -> None:
        """Note that the robot's track to its next pose is unknown."""
        self.current.break_track()
        self.floor.break_track()

    def lift_tool(self) -> None:
        """Note that the map has moved: track and cells under the tool are unknown."""
        self.current.lift_tool()
        self.floor.break_track()

    def forget_uncertain(self, motion: Motion) -> int:
        """Forget cells that a motion of the map makes uncertain; return their number."""
        self._forget_passed()
        before = self.snapshot()
        cells, floor = uncertain_cells(before, motion), certain_floor(before.floor, motion)
        self.current.forget(cells)
        self.floor.leave(floor)
        # Cells of other robots become uncertain, too: each robot records on a map of its own.
        self.shared.disregard(uncertain_cells(self.shared.snapshot(self._cell_m), motion))
        self.shared.record_forgotten()
        return before.cells - self.current.snapshot().cells

    def forget(self, inside: Callable[[Window, float], NDArray[np.bool_]]) -> None:
        """Forget some cells and their floor, except the floor now under the tool.

        Args:
            inside: for a window and the edge of its squares [m], returns which squares have their
                centre inside, bool (rows, cols).
        """

        def cells_inside(rows: Cells, cols: Cells) -> NDArray[np.bool_]:
            row0, col0 = int(rows.min()), int(cols.min())
            around = Window(row0, col0, int(rows.max()) + 1, int(cols.max()) + 1)
            return inside(around, self._cell_m)[rows - row0, cols - col0]

        self._forget_passed()
        self.before = None
        self.current.forget(cells_inside)
        self.floor.forget(lambda window: inside(window, PIXEL_M))
        self.shared.disregard(cells_inside)
        self.shared.record_forgotten()

    def move_to(self, frame: str) -> LedgerMismatchError | None:
        """Move to ``frame``; start over, and return the fault, if cells lie in another frame."""
        self.shared.enter(frame)
        was = self.current.frame
        if was in ("", frame):
            self.current.move_to(frame)
            return None
        cells = self.current.snapshot().cells
        self._replace(frame)
        self.shared.clear()
        if not cells:
            return None
        return self._begun_anew(
            f"the ledger of {cells} covered cells lies in frame {was!r}, the map in {frame!r}"
        )

    def reset(self, frame: str) -> None:
        """Forget everything; ``frame``: frame of the poses, "" if none is active."""
        self._replace(frame)
        self.shared.reset()
        self.shared.disregard(lambda rows, _: np.ones(len(rows), np.bool_))
        self.first_plan_reason = "first plan"

    def check(self, lattice: CoverageLattice, frame: str) -> LedgerMismatchError | None:
        """Start over, and return the fault, if a map shows another building than the ledger's."""
        if frame == self.current.frame:
            self.shared.enter(frame)
        if self._resumed is None:
            return None
        verdict = Fit.of(self._resumed, lattice).verdict
        if verdict is Verdict.OPEN:
            return None
        self._resumed = None
        return None if verdict is Verdict.SAME else self._leave_building(frame)

    def contradicts(self, lattice: CoverageLattice) -> bool:
        """Return whether a map with other walls blocks more covered cells than furniture would."""
        fit = Fit.of(self.current.snapshot(), lattice)
        return fit.verdict is Verdict.OTHER and fit.blocked >= MANY_AT_ONCE * fit.known

    def begin_elsewhere(self, frame: str) -> LedgerMismatchError:
        """Start over in another building, with its map in ``frame``; return the fault to report."""
        self.shared.leave_building(frame)
        return self._leave_building(frame)

    def _leave_building(self, frame: str) -> LedgerMismatchError:
        cells = self.current.snapshot().cells
        self._replace(frame)
        self.shared.clear()
        return self._begun_anew(
            f"the ledger of {cells} covered cells is of another building than the map"
        )

    def _forget_passed(self) -> None:
        self.passed.clear()
        self._opened_again.clear()

    def _replace(self, frame: str) -> None:
        self.current, self.floor = self._nothing(frame)
        self._resumed = self.before = None
        self._forget_passed()
        self.shared.record_forgotten()

    def _begun_anew(self, why: str) -> LedgerMismatchError:
        misfit = LedgerMismatchError(why)
        self.first_plan_reason = f"{misfit}: begun anew"
        return misfit
