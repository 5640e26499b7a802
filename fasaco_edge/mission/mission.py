"""The mission: what is covered, what changed, when to replan.

``step(events, now)`` is all there is. It opens no session, reads no clock and
touches no file, so that a mission can be tested, and repeated, with plain
values.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import FasacoError, NothingToCover, PatchWithoutBase, WrongFrame
from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.grid.lattice import MAX_LATTICE_CELLS, Cell, CoverageLattice, Footprint
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.mission.events import (
    Decision,
    Event,
    MapReceived,
    PatchesLost,
    PatchReceived,
    PathUpdate,
    PlanReady,
    PlanRequest,
    PoseReceived,
)
from fasaco_edge.mission.ground import Ground, anchor_cell
from fasaco_edge.mission.ledger import CoverageLedger
from fasaco_edge.mission.progress import Coverage, DrivenPath, LeftOver, State
from fasaco_edge.planners.cost import STEPS_ALONE, CoverageCost
from fasaco_edge.planners.problem import CoverageProblem

# A robot that left its path, or stands still at its end, gets a new one, but not
# more often than this [s]: a flickering pose must not keep the planner busy.
PATIENCE_S = 1.0


@dataclass(frozen=True, slots=True)
class MissionConfig:
    """What the mission is for: the robot, the largest lattice it plans on, what walks cost."""

    footprint: Footprint
    max_lattice_cells: int = MAX_LATTICE_CELLS
    cost: CoverageCost = STEPS_ALONE


class Mission:
    """Covers all that is reachable, of a map that is still growing."""

    def __init__(self, config: MissionConfig) -> None:
        self.config = config
        self.grid: OccupancyGrid | None = None
        self.map_revision = 0
        self.pose: StampedPose | None = None
        self.state = State.WAITING_FOR_MAP
        self.reason = "no map yet"
        self.ledger = CoverageLedger(config.footprint.cell_m)
        self.path = DrivenPath.none()
        self.revision = 0
        self.plans = 0
        self._lattice: CoverageLattice | None = None
        self._ground: Ground | None = None
        self._checked_on: Ground | None = None
        self._patches_lost = False
        self._wanted = ""
        self._asked: PlanRequest | None = None
        self._now = 0.0
        self._published_at = 0.0
        self._left_over = LeftOver()

    def step(self, events: Iterable[Event], now: float) -> Decision:
        """Take events in order and decide.

        Args:
            events: what has happened since the last step. An event that cannot be
                used is reported as a fault and changes nothing.
            now: time [s] of any steady clock.
        """
        self._now = now
        faults: list[FasacoError] = []
        path: PathUpdate | None = None
        for event in events:
            try:
                path = self._take(event) or path
            except FasacoError as error:
                faults.append(error)
        decision = self._decide()
        return replace(decision, path=decision.path or path, faults=tuple(faults))

    def coverage(self) -> Coverage | None:
        """Return how far the mission is; None before there is a map."""
        if self._lattice is None:
            return None
        reachable = self._ground.reachable if self._ground else None
        visits = self.ledger.visits(self._lattice.window)
        return Coverage.of(self._lattice, reachable, visits)

    @property
    def lattice(self) -> CoverageLattice | None:
        """The lattice over the newest map; None before there is one."""
        return self._lattice

    @property
    def planning(self) -> bool:
        """Whether a plan has been asked for and is not there yet."""
        return self._asked is not None

    @property
    def wants_plan(self) -> bool:
        """Whether a plan will be asked for once the one under way is there."""
        return bool(self._wanted)

    def _take(self, event: Event) -> PathUpdate | None:
        match event:
            case MapReceived(grid):
                self._patches_lost = False
                self._take_map(grid)
            case PatchReceived(patch):
                self._take_map(self._patched(patch))
            case PatchesLost(count):
                self._patches_lost = True
                raise PatchWithoutBase(f"{count} map updates were lost")
            case PoseReceived(pose):
                self._take_pose(pose)
            case PlanReady():
                return self._take_plan(event)
        return None

    def _patched(self, patch: MapPatch) -> OccupancyGrid:
        if self.grid is None or self._patches_lost:
            why = "updates before it were lost" if self._patches_lost else "there is no map yet"
            raise PatchWithoutBase(f"map update refused: {why}")
        return self.grid.patched(patch)

    def _take_map(self, grid: OccupancyGrid) -> None:
        if self.grid is not None and grid.frame != self.grid.frame:
            raise WrongFrame(f"map in frame {grid.frame!r}, the mission's is {self.grid.frame!r}")
        config = self.config
        lattice = CoverageLattice.from_map(grid, config.footprint, config.max_lattice_cells)
        self.grid, self._lattice = grid, lattice
        self.map_revision += 1
        if self.pose is not None and self.pose.frame != grid.frame:
            self.pose = None
        self._survey()

    def _take_pose(self, pose: StampedPose) -> None:
        if self.grid is None:
            self.pose = pose
            return
        if pose.frame != self.grid.frame:
            raise WrongFrame(f"pose in frame {pose.frame!r}, map in {self.grid.frame!r}")
        self.pose = pose
        x, y = pose.pose.x, pose.pose.y
        # A pose kilometres astray is no drive.
        if self._lattice is not None and self._lattice.contains(self._lattice.cell_at(x, y)):
            self.ledger.record(pose.pose)
        cell = self._cell()
        if cell is None:
            return
        if self._ground is None or not self._ground.holds(cell):
            self._survey()
        self.path = self.path.driven_to(cell, self.ledger.has_visited)

    def _cell(self) -> Cell | None:
        """Return the coverable cell the robot is in, or next to."""
        if self._lattice is None or self.pose is None:
            return None
        return anchor_cell(self._lattice, self.pose.pose)

    def _survey(self) -> None:
        """Find out what can be reached now; want a new plan if that changed."""
        before, self._ground = self._ground, None
        cell = self._cell()
        if cell is None or self._lattice is None:
            return
        self._ground = Ground.around(self._lattice, cell)
        if before is None:
            self._wanted = "robot is on coverable ground again" if self.revision else "first plan"
        elif change := self._ground.change_since(before):
            self._wanted = str(change)

    def _take_plan(self, event: PlanReady) -> PathUpdate | None:
        asked = self._asked
        if asked is None or asked.number != event.number:
            return None
        self._asked = None
        self.plans += 1
        cell = self._cell()
        if cell is None or self._ground is None:
            return None
        cells = self._from_here(event.path.cells, cell)
        if not len(cells) or self._ground.legal_steps(cells) < len(cells) - 1:
            self._wanted = self._wanted or "the map changed while planning"
            return None
        if np.array_equal(cells, self.path.ahead):
            # Nothing to change: whoever drives it need not hear of it again.
            self._published_at = self._now
            return None
        return self._publish(cells, asked.reason, event)

    def _from_here(self, cells: NDArray[np.int32], here: Cell) -> NDArray[np.int32]:
        """Return a fresh plan without what was covered while it was made.

        The robot went on meanwhile: it joins the plan at the first cell that still
        needs a visit. Empty where it cannot come there: it was carried elsewhere.
        """
        assert self._ground is not None
        assert self._lattice is not None
        window = self._lattice.window
        visits = self.ledger.visits(window)
        rows, cols = cells[:, 0] - window.row0, cells[:, 1] - window.col0
        inside = (rows >= 0) & (rows < window.rows) & (cols >= 0) & (cols < window.cols)
        still_open = np.ones(len(cells), bool)
        still_open[inside] = visits[rows[inside], cols[inside]] == 0
        first = int(np.argmax(still_open)) if still_open.any() else len(cells) - 1
        lead = self._ground.way(here, (int(cells[first, 0]), int(cells[first, 1])))
        return np.concatenate((lead[:-1], cells[first:])) if len(lead) else lead

    def _publish(
        self, cells: NDArray[np.int32], reason: str, ready: PlanReady | None = None
    ) -> PathUpdate:
        self.revision += 1
        self._published_at = self._now
        self.path = DrivenPath(cells)
        plan, seconds = (ready.path, ready.seconds) if ready else (None, 0.0)
        return PathUpdate(self.revision, cells, reason, plan, seconds)

    def _decide(self) -> Decision:
        if self._lattice is None:
            return self._rest(State.WAITING_FOR_MAP, "no map yet")
        if self.pose is None:
            return self._rest(State.WAITING_FOR_POSE, "no pose yet")
        cell = self._cell()
        if cell is None or self._ground is None:
            return self._blocked()
        update = self._cut_off()
        self._look_for_stray(cell)
        if self._left_over.given_up(self.ledger.total) and not self._wanted:
            reason = "the robot stands at its path's end, but not all cells are covered"
            self._enter(State.BLOCKED, reason)
        elif self._wanted and self._asked is None:
            return Decision(path=update) if self._too_soon() else self._ask(cell, update)
        elif self._asked is not None and not len(self.path.cells):
            self._enter(State.PLANNING, self._asked.reason)
        elif self.state is not State.DONE:
            self._enter(State.COVERING, f"path {self.revision}")
        return Decision(path=update)

    def _rest(self, state: State, reason: str) -> Decision:
        self._enter(state, reason)
        return Decision()

    def _too_soon(self) -> bool:
        """Tell whether a robot that had to stop should stand a moment before a new plan."""
        return self.state is State.BLOCKED and self._now - self._published_at < PATIENCE_S

    def _blocked(self) -> Decision:
        """Stop: the robot is where it cannot be; look again with the next map or pose."""
        self._enter(State.BLOCKED, "robot is not on coverable ground")
        self._ground = None  # to be surveyed anew once it stands well
        if not len(self.path.cells):
            return Decision()
        return Decision(path=self._publish(np.empty((0, 2), np.int32), self.reason))

    def _cut_off(self) -> PathUpdate | None:
        """Shorten a path that a new map blocks, at once; a new plan follows."""
        assert self._ground is not None
        if self._ground is self._checked_on:
            return None
        self._checked_on = self._ground
        ahead = self.path.ahead
        legal = self._ground.legal_steps(ahead) if len(ahead) else 0
        if legal >= len(ahead) - 1:
            return None
        row, col = ahead[legal + 1]
        self._wanted = f"path blocked at cell ({row}, {col})"
        return self._publish(ahead[: legal + 1], self._wanted)

    def _look_for_stray(self, cell: Cell) -> None:
        if self._asked is not None or self._wanted or self.state is not State.COVERING:
            return
        waited = self._now - self._published_at >= PATIENCE_S
        last = tuple(self.path.cells[-1].tolist()) if len(self.path.cells) else None
        if self.path.finished and (waited or (last and self.ledger.has_visited(last))):
            self._left_over.tried(self.ledger.total)
            self._wanted = "cells left over"
        elif waited and self.path.is_far(cell):
            self._wanted = "robot left the path"

    def _ask(self, cell: Cell, update: PathUpdate | None) -> Decision:
        assert self._lattice is not None
        covered = self.ledger.visits(self._lattice.window) > 0
        reason, self._wanted = self._wanted, ""
        try:
            problem = CoverageProblem.of(
                self._lattice,
                cell,
                covered=covered,
                cost=self.config.cost,
                before=self.path.ahead,
            )
        except NothingToCover:
            return self._done(update)
        self._asked = PlanRequest(self.plans + 1, problem, reason)
        self._enter(State.COVERING if len(self.path.cells) else State.PLANNING, reason)
        return Decision(plan=self._asked, path=update)

    def _done(self, update: PathUpdate | None) -> Decision:
        was_done = self.state is State.DONE
        self._enter(State.DONE, "every reachable cell is covered")
        if was_done or not self.revision:
            return Decision(path=update)
        return Decision(path=self._publish(np.empty((0, 2), np.int32), self.reason))

    def _enter(self, state: State, reason: str) -> None:
        self.state, self.reason = state, reason
