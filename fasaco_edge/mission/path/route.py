"""Route: the published path, and the part of it that is kept while the robot is stopped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import Cell
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.mission.company import Company
from fasaco_edge.mission.coverage.loop_closure import Motion, moved_cells
from fasaco_edge.mission.events import BETTER, PathUpdate, PlanBroken, PlanReady, PlanRequest
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.path.path_progress import PathProgress
from fasaco_edge.mission.path.plan_requests import BROKEN_S, Attempt, PlanRequests, SpareTime
from fasaco_edge.mission.work.sequencer import Sequencer

NO_CELLS: NDArray[np.int32] = np.empty((0, 2), np.int32)


class Route:
    """Publishes paths from requested plans. All times ``now`` are [s].

    Attributes:
        requests: the plans that are wanted and pending.
        path: the published path, and the robot's progress on it.
        revision: counts the published paths.
        unchanged, outdated: count the plans that were not published: they equal the current path,
            or do not fit the newest map.
        published_at: when a path was last published or confirmed by a plan.
        aside: the rest of the path, int32 (n, 2), kept during an errand; None without an errand.
        is_way_out: whether the published path is a way out, along no cells.
        begun_at: when the robot last got a path to drive after a time without one.
        beside: other robots that the path's line keeps clear of, float64 (k, 3): x, y, least
            distance [m]; a line that begins nearer to a robot comes no nearer to it. None for no
            such limit.
    """

    def __init__(
        self, spare_share: float, map_state: MapState, orders: Sequencer, company: Company
    ) -> None:
        self.requests = PlanRequests()
        self.path = PathProgress(NO_CELLS)
        # The part of a path kept for later: beyond a block, or the whole rest after a stop.
        self._kept = PathProgress(NO_CELLS)
        self.aside: NDArray[np.int32] | None = None
        # Heading at the end of the path [rad]; None for the heading of the last segment.
        self._end_yaw: float | None = None
        self.revision = 0
        # Numbers of the path and of its walk (a new path over the same cells is the same walk), and
        # of the last walk that was searched as a whole.
        self._numberings = self._walks = self._searched = 0
        self.unchanged = self.outdated = 0
        self.published_at = self.begun_at = 0.0
        self.is_way_out = False
        self.beside: NDArray[np.float64] | None = None
        self._map, self._orders, self._company = map_state, orders, company
        self._spare = SpareTime(spare_share)
        self._checked_on: ReachableArea | None = None

    def continue_from(self, before: Route) -> None:
        """Continue the counts of another route; its pending plan is discarded."""
        self.requests.continue_from(before.requests)
        self.revision = before.revision
        self.unchanged, self.outdated = before.unchanged, before.outdated

    @property
    def path_to_keep(self) -> NDArray[np.int32]:
        """The part of the path that the next plan should keep, int32 (n, 2).

        It includes the part beyond a block, or the rest after a stop: most of it is still valid.
        """
        return np.concatenate((self.path.ahead, self._kept.ahead))

    @property
    def is_cut(self) -> bool:
        """Whether a part of the path is kept beyond its end, for the next plan."""
        return len(self._kept.cells) > 0

    @property
    def held(self) -> PathProgress:
        """The path; if the robot was stopped, the kept part of its last path."""
        return self.path if len(self.path.cells) else self._kept

    def abandon(self) -> None:
        """Cancel the wanted plan, and discard the pending plan: they are for another order."""
        self.requests.abandon()
        self._kept, self.aside = PathProgress(NO_CELLS), None

    def set_aside(self) -> bool:
        """Keep the path during an errand; return False if a path is kept already."""
        if self.aside is not None:
            return False
        self.requests.pause()
        self.aside, self._kept = self.path_to_keep, PathProgress(NO_CELLS)
        return True

    def take_up(self, reason: str, now: float) -> PathUpdate | None:
        """Resume the kept path after an errand, once a plan connects to it."""
        if self.aside is None:
            return None
        update = self.publish(NO_CELLS, reason, now) if len(self.path.cells) else None
        self._kept, self.aside = PathProgress(self._from_nearer_end(self.aside)), None
        self.requests.want(reason)
        return update

    def _from_nearer_end(self, cells: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return a kept path, reversed if its end is nearer to the robot than its start.

        A path that has to end at home is not reversed: the saved way would be driven at the end.
        """
        area, cell = self._map.area, self._map.robot_cell()
        if (
            area is None
            or cell is None
            or not len(cells)
            or self._orders.order_state.returns_home_next
        ):
            return cells
        ends = [area.shortest_path(cell, (int(row), int(col))) for row, col in cells[[0, -1]]]
        is_nearer = 0 < len(ends[1]) < len(ends[0])
        return np.ascontiguousarray(cells[::-1]) if is_nearer else cells

    def resume(self, now: float) -> PathUpdate | None:
        """Publish the kept path after a pause; ask for a plan if the path is no longer valid."""
        area, cell, cells = self._map.area, self._map.robot_cell(), self._kept.ahead
        holds = (
            not self.requests.wanted
            and area is not None
            and len(cells) > 0
            and cell == tuple(cells[0].tolist())
            and area.drivable_prefix(cells) == len(cells)
        )
        if holds:
            return self.publish(cells, "resumed", now)
        self.requests.want("resumed")
        return None

    def move(self, before: NDArray[np.int32], motion: Motion, now: float) -> PathUpdate | None:
        """Move the path with the map, and ask for a plan that repairs it.

        Its drivable part is published at once: the robot must not follow the path at its old place.
        ``before``: int32 (n, 2), n >= 1, ``path_to_keep`` before the map moved.
        """
        self.requests.discard_pending()
        self.requests.want("map and pose moved")
        assert self._map.ground.lattice is not None
        cells = moved_cells(before, motion, self._map.ground.lattice.cell_m)
        cell, area, was_driving = self._map.robot_cell(), self._map.area, len(self.path.cells) > 0
        drivable = 0
        if cell is not None and area is not None and was_driving:
            lead = area.shortest_path(cell, (int(cells[0, 0]), int(cells[0, 1])))
            cells = np.concatenate((lead[:-1], cells))
            drivable = area.drivable_prefix(cells)
        update = self.publish(cells[:drivable], self.requests.wanted, now) if was_driving else None
        self._kept = PathProgress(cells[drivable:])
        return update

    def request_improvement(self, now: float) -> PlanRequest | None:
        """Request a better path; None without spare time, or if too little of the path is left."""
        if not self._spare.is_available(now, self._walks):
            return None
        number = self.requests.attempts + 1
        # A walk that was extended with the map, or cut to a part, has up to a third more turns
        # than a new search would find. So every other attempt searches the whole rest, once for
        # each walk.
        is_full = number % 2 == 1 and self._searched != self._walks
        attempt = Attempt.at(self.path, self._numberings, self._orders, number, is_full=is_full)
        if attempt is None:
            self._spare.rest(now)
            return None
        if is_full:
            self._searched = self._walks
        return self.requests.request_attempt(attempt)

    def fail(self, event: PlanBroken, now: float) -> None:
        """Note that the pending plan failed: the same problem would fail again."""
        self._spare.rest(now, BROKEN_S)
        self.outdated += self.requests.close_failed(event, now)

    def accept(self, event: PlanReady, now: float) -> PathUpdate | None:
        """Publish a requested plan, unless it is no longer valid."""
        if self.requests.is_improving:
            self._spare.spend(event.seconds, now, self._walks)
        request, attempt, area = self.requests.pending, self.requests.attempt, self._map.area
        if request is None or request.number != event.number:
            return None
        is_abandoned = self.requests.close()
        if attempt is None:
            self.requests.forget_failure()
        cell = self._map.robot_cell()
        if is_abandoned or cell is None or area is None:
            self.outdated += attempt is None
            return None
        if attempt is not None:
            return self._accept_better(attempt, event, area, now)
        cells = self._from_here(event.path.cells, cell, area)
        if not len(cells) or area.drivable_prefix(cells) < len(cells):
            self.outdated += 1
            self.requests.want_instead("the map changed while planning", request.changed)
            return None
        if np.array_equal(cells, self.path.ahead):
            # The follower has this path already; a path that ended at a cut is complete now.
            self._kept = PathProgress(NO_CELLS)
            self.unchanged += 1
            self.published_at = now
            return None
        update = self.publish(cells, request.reason, now, event, request.changed)
        return replace(update, may_wait=True)

    def _accept_better(
        self, attempt: Attempt, event: PlanReady, area: ReachableArea, now: float
    ) -> PathUpdate | None:
        if attempt.numbering != self._numberings:
            return None
        cells = attempt.improved(self.path, event.path.cells)
        if cells is None or area.drivable_prefix(cells) < len(cells):
            return None
        return replace(self.publish(cells, BETTER, now, event), may_wait=True)

    def _from_here(
        self, cells: NDArray[np.int32], here: Cell, area: ReachableArea
    ) -> NDArray[np.int32]:
        """Return a new plan without the cells that were covered while it was made.

        The robot joins it at the first cell that still needs a visit. The result is empty if no
        path leads there, for instance if the robot was carried elsewhere.
        """
        first = self._first_open(cells, area.lattice.window)
        to = int(cells[first, 0]), int(cells[first, 1])
        lead = self._company.passable(area, here).shortest_path(here, to)
        return np.concatenate((lead[:-1], cells[first:])) if len(lead) else lead

    def _first_open(self, cells: NDArray[np.int32], window: Window) -> int:
        """Return the index of the first cell that needs a visit; the last index if none does."""
        found = window.values_at(self._orders.cells.open_cells(window), cells, True)
        return int(np.argmax(found)) if found.any() else len(cells) - 1

    def publish(
        self,
        cells: NDArray[np.int32],
        reason: str,
        now: float,
        ready: PlanReady | None = None,
        changed: Window | None = None,
        end_yaw: float | None = None,
        beside: NDArray[np.float64] | None = None,
    ) -> PathUpdate:
        """Publish a path that replaces the current path."""
        self.revision += 1
        self.is_way_out = False
        self._numberings += 1
        self._walks += not np.array_equal(cells, self.path.ahead)
        self.published_at = now
        if len(self.path.ahead) < 2:
            self.begun_at = now
        self.path, self._kept = PathProgress(cells), PathProgress(NO_CELLS)
        self._end_yaw, self.beside = end_yaw, beside
        plan, seconds = (ready.path, ready.seconds) if ready else (None, 0.0)
        return PathUpdate(self.revision, cells, reason, plan, seconds, changed, end_yaw=end_yaw)

    def publish_way_out(
        self, way: NDArray[np.float64], reason: str, now: float
    ) -> PathUpdate | None:
        """Publish a way along no cells, float64 (n, 2): x, y [m], and keep the current path.

        Return None for an empty way if there is no path to stop.
        """
        if not len(way):
            return self.stop(reason, now)
        kept = self.path_to_keep
        update = self.publish(NO_CELLS, reason, now)
        self._kept, self.is_way_out = PathProgress(kept), True
        return replace(update, xy=way)

    def publish_anew(self, reason: str, now: float) -> PathUpdate:
        """Publish the rest of the path once more, with a new line."""
        ahead, end_yaw, beside = self.path.ahead, self._end_yaw, self.beside
        return self.publish(ahead, reason, now, end_yaw=end_yaw, beside=beside)

    def keep_back(self) -> None:
        """Note that the newest path is not published yet."""
        self.revision -= 1

    def publish_line(self, reason: str, now: float) -> PathUpdate:
        """Publish a new line along the same cells; a pending attempt stays valid."""
        self.revision += 1
        self.published_at = now
        return PathUpdate(self.revision, self.path.ahead, reason, end_yaw=self._end_yaw)

    def record_cell(self, cell: Cell, has_visited: Callable[[Cell], bool]) -> None:
        """Record that the robot is in ``cell``, see ``PathProgress.driven_to``."""
        self._hold(self.held.driven_to(cell, has_visited))

    def record_index(self, index: int) -> None:
        """Record the robot's index on the path, as its line shows."""
        held = self.held
        if held.index < index < len(held.cells):
            self._hold(replace(held, index=index))

    def _hold(self, held: PathProgress) -> None:
        if len(self.path.cells):
            self.path = held
        else:
            self._kept = held

    def stop(self, reason: str, now: float) -> PathUpdate | None:
        """Publish an empty path and keep the current path; None without a path to drive."""
        if not len(self.path.cells) and not self.is_way_out:
            return None
        kept = self.path_to_keep
        update = self.publish(NO_CELLS, reason, now)
        # At the end of its path nothing is left to drive.
        self._kept = PathProgress(kept if len(kept) > 1 else NO_CELLS)
        return update

    def truncate(self, now: float) -> PathUpdate | None:
        """Cut the path before a block that a new map shows; ask for a new plan.

        The path becomes empty if the robot's own cell is blocked or off the map.
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
        self.requests.want(f"path blocked at cell ({row}, {col})", self.requests.changed)
        beyond = PathProgress(np.concatenate((ahead[drivable:], self._kept.ahead)))
        update = self.publish(
            ahead[:drivable], self.requests.wanted, now, changed=self.requests.changed
        )
        self._kept = beyond
        return replace(update, may_wait=True)
