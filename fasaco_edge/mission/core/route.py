"""Route: the path the robot was given, and what is kept of it at a stop."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import Cell
from fasaco_edge.mission.core.events import PathUpdate, PlanBroken, PlanReady, PlanRequest
from fasaco_edge.mission.core.plan_requests import BROKEN_S, PlanRequests
from fasaco_edge.mission.core.spare_time import Attempt, SpareTime
from fasaco_edge.mission.coverage.progress import PathProgress
from fasaco_edge.mission.map.loop_closure import Motion, moved_cells
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.map.reachable_area import ReachableArea
from fasaco_edge.mission.orders.sequencer import Sequencer

NO_CELLS: NDArray[np.int32] = np.empty((0, 2), np.int32)


class Route(PlanRequests):
    """Requests plans, and publishes paths from them. All times ``now`` are [s].

    Attributes:
        path: the published path, and how far the robot is on it.
        revision: counts the published paths.
        unchanged, outdated: count those of the plans that led to no path, because they found
            the same path again, or because they no longer held.
        published_at: when a path was last published, or confirmed by a plan.
    """

    def __init__(self, spare_share: float, map_state: MapState, orders: Sequencer) -> None:
        super().__init__()
        self.path = PathProgress(NO_CELLS)
        # What is kept of a path that is not driven now: what lay beyond where a map blocked it, or,
        # of a robot that was stopped, all that was left.
        self._kept = PathProgress(NO_CELLS)
        # What was left of the path before an errand, for after it; None without one.
        self._aside: NDArray[np.int32] | None = None
        # The heading of the robot at the end of its path [rad]; None for the way's.
        self._end_yaw: float | None = None
        # The path over a map that has moved since, until a pose tells where to.
        self._before_motion: NDArray[np.int32] | None = None
        self.revision = 0
        # Counts the paths whose cells are numbered anew, and those of them over other cells.
        self._numberings = self._walks = 0
        self.unchanged = self.outdated = 0
        self.published_at = 0.0
        self._map = map_state
        self._orders = orders
        self._spare = SpareTime(spare_share)
        self._checked_on: ReachableArea | None = None

    def succeed(self, before: Route) -> None:
        """Go on counting where another route ended; the plan under way there is of no use here."""
        self.revision, self.plans, self.attempts = before.revision, before.plans, before.attempts
        self.unchanged, self.outdated = before.unchanged, before.outdated
        self.pending, self._attempt = before.pending, before._attempt
        self.discard_pending()

    @property
    def path_to_keep(self) -> NDArray[np.int32]:
        """What of the path the next plan is to keep where it can, int32 (n, 2).

        Also what a map cut off, or what a robot had before it that was stopped: most of that still
        holds.
        """
        return np.concatenate((self.path.ahead, self._kept.ahead))

    @property
    def held(self) -> PathProgress:
        """The path, or, of a robot that was stopped, what is kept of the one before."""
        return self.path if len(self.path.cells) else self._kept

    def abandon(self) -> None:
        """Want no plan any more, and discard the one under way: it is for another order."""
        super().abandon()
        self._kept, self._before_motion, self._aside = PathProgress(NO_CELLS), None, None

    @property
    def aside(self) -> NDArray[np.int32] | None:
        """What was left of the path before an errand, int32 (n, 2); None without one."""
        return self._aside

    def set_aside(self) -> bool:
        """Keep the path for after an errand, unless that was done; return whether it was now."""
        if self._aside is not None:
            return False
        self.pause()
        self._aside, self._kept = self.path_to_keep, PathProgress(NO_CELLS)
        return True

    def take_up(self, reason: str, now: float) -> PathUpdate | None:
        """Go on after an errand with what was set aside, once a plan leads there."""
        if self._aside is None:
            return None
        update = self.publish(NO_CELLS, reason, now) if len(self.path.cells) else None
        self._kept, self._aside = PathProgress(self._aside), None
        self.want(reason)
        return update

    def resume(self, now: float) -> PathUpdate | None:
        """Publish what is kept of the path before a pause; want a plan where that does not do."""
        area, cell, cells = self._map.area, self._map.robot_cell(), self._kept.ahead
        holds = (
            not self.wanted
            and area is not None
            and len(cells) > 0
            and cell == tuple(cells[0].tolist())
            and area.drivable_prefix(cells) == len(cells)
        )
        if holds:
            return self.publish(cells, "resumed", now)
        self.want("resumed")
        return None

    def note_map_motion(self) -> None:
        """Note that the newest map has moved; ``note_motion`` tells where to."""
        if self._before_motion is None:
            self._before_motion = self.path_to_keep

    def note_motion(self, motion: Motion | None, now: float) -> PathUpdate | None:
        """Take the path to where the map has moved, and want a plan that mends it.

        What of it can be driven is published at once: the robot must not follow the old place.
        """
        before, self._before_motion = self._before_motion, None
        if before is None or motion is None or motion.is_still or not len(before):
            return None
        self.discard_pending()
        self.want("map and pose moved")
        assert self._map.lattice is not None
        cells = moved_cells(before, motion, self._map.lattice.cell_m)
        cell, area, was_driving = self._map.robot_cell(), self._map.area, len(self.path.cells) > 0
        drivable = 0
        if cell is not None and area is not None and was_driving:
            lead = area.shortest_path(cell, (int(cells[0, 0]), int(cells[0, 1])))
            cells = np.concatenate((lead[:-1], cells))
            drivable = area.drivable_prefix(cells)
        update = self.publish(cells[:drivable], self.wanted, now) if was_driving else None
        self._kept = PathProgress(cells[drivable:])
        return update

    def request_improvement(self, now: float) -> PlanRequest | None:
        """Request a better path; None without spare time, or where too little of it is left."""
        if not self._spare.is_available(now):
            return None
        attempt = Attempt.at(self.path, self._numberings, self._orders, self.attempts + 1)
        if attempt is None:
            self._spare.skip(now)
            return None
        return self._request_attempt(attempt)

    def fail(self, event: PlanBroken, now: float) -> None:
        """Note that the plan under way failed: the same problem would make it fail again."""
        self._spare.rest(BROKEN_S, now)
        self.outdated += self._close_failed(event, now)

    def accept(self, event: PlanReady, now: float) -> PathUpdate | None:
        """Publish a plan that was requested, unless it no longer holds."""
        if self.is_improving:
            self._spare.spend(event.seconds, now, self._walks)
        request, attempt, area = self.pending, self._attempt, self._map.area
        if request is None or request.number != event.number:
            return None
        is_abandoned = self._close_request()
        cell = self._map.robot_cell()
        if is_abandoned or cell is None or area is None:
            self.outdated += attempt is None
            return None
        if attempt is not None:
            return self._accept_better(attempt, event, area, now)
        cells = self._from_here(event.path.cells, cell, area)
        if not len(cells) or area.drivable_prefix(cells) < len(cells):
            self.outdated += 1
            self._changed = Window.around(self._changed, request.changed)
            if not self.wanted:
                self.want("the map changed while planning", request.changed)
            return None
        if np.array_equal(cells, self.path.ahead):
            # The follower has this path already.
            self.unchanged += 1
            self.published_at = now
            return None
        return self.publish(cells, request.reason, now, event, request.changed)

    def _accept_better(
        self, attempt: Attempt, event: PlanReady, area: ReachableArea, now: float
    ) -> PathUpdate | None:
        """Publish the path with a better rest; None where that saves too little."""
        if attempt.numbering != self._numberings:
            return None
        cells = attempt.joined(self.path, event.path.cells)
        if cells is None or area.drivable_prefix(cells) < len(cells):
            return None
        return self.publish(cells, "better further on", now, event)

    def _from_here(
        self, cells: NDArray[np.int32], here: Cell, area: ReachableArea
    ) -> NDArray[np.int32]:
        """Return a new plan without what was covered while it was made.

        The robot drove on meanwhile: it joins the plan at the first cell that still needs a
        visit. Empty where no path leads there: the robot was carried elsewhere.
        """
        window = area.lattice.window
        still_open = window.values_at(self._orders.open_cells(window), cells, True)
        first = int(np.argmax(still_open)) if still_open.any() else len(cells) - 1
        lead = area.shortest_path(here, (int(cells[first, 0]), int(cells[first, 1])))
        return np.concatenate((lead[:-1], cells[first:])) if len(lead) else lead

    def publish(
        self,
        cells: NDArray[np.int32],
        reason: str,
        now: float,
        ready: PlanReady | None = None,
        changed: Window | None = None,
        end_yaw: float | None = None,
    ) -> PathUpdate:
        """Publish a path in place of the one before."""
        self.revision += 1
        self._numberings += 1
        self._walks += not np.array_equal(cells, self.path.ahead)
        self.published_at = now
        self.path, self._kept = PathProgress(cells), PathProgress(NO_CELLS)
        self._end_yaw = end_yaw
        plan, seconds = (ready.path, ready.seconds) if ready else (None, 0.0)
        return PathUpdate(
            self.revision, cells, reason, plan, seconds, changed, end_yaw=self._end_yaw
        )

    def publish_line(self, reason: str, now: float) -> PathUpdate:
        """Publish another line along the same cells; an attempt at better ones still holds."""
        self.revision += 1
        self.published_at = now
        return PathUpdate(self.revision, self.path.ahead, reason, end_yaw=self._end_yaw)

    def follow(self, cell: Cell, has_visited: Callable[[Cell], bool]) -> None:
        """Note that the robot is in ``cell``, see ``PathProgress.driven_to``."""
        self._hold(self.held.driven_to(cell, has_visited))

    def follow_line(self, index: int) -> None:
        """Note that the robot is, by its line, at a cell of the path."""
        held = self.held
        if held.index < index < len(held.cells):
            self._hold(replace(held, index=index))

    def _hold(self, held: PathProgress) -> None:
        if len(self.path.cells):
            self.path = held
        else:
            self._kept = held

    def stop(self, reason: str, now: float) -> PathUpdate | None:
        """Publish an empty path, keep the one before; None where the robot has none to drive."""
        if not len(self.path.cells):
            return None
        kept = self.path_to_keep
        update = self.publish(NO_CELLS, reason, now)
        # At its end nothing is left to drive.
        self._kept = PathProgress(kept if len(kept) > 1 else NO_CELLS)
        return update

    def truncate(self, now: float) -> PathUpdate | None:
        """Cut a path that a new map blocks before the block, at once; a new plan follows.

        Nothing is left of it where the robot's own cell is blocked or no longer on the map.
        """
        area = self._map.area
        if area is None or area is self._checked_on:
            return None
        self._checked_on = area
        ahead = self.path.ahead
        drivable = area.drivable_prefix(ahead)
        if drivable == len(ahead):
            return None
        row, col = ahead[drivable]
        self.want(f"path blocked at cell ({row}, {col})", self._changed)
        beyond = PathProgress(np.concatenate((ahead[drivable:], self._kept.ahead)))
        update = self.publish(ahead[:drivable], self.wanted, now, changed=self._changed)
        self._kept = beyond
        return update
