"""Event handler: application of events to the mission's state, before the mission decides."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial

from fasaco_edge.errors import FasacoError, LedgerMismatchError, WrongFrame
from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.core.order_changes import OTHERS_FIRST
from fasaco_edge.mission.core.parts import MissionParts
from fasaco_edge.mission.coverage.driven_poses import Driven
from fasaco_edge.mission.events import (
    Answer,
    BatteryReceived,
    CommandReceived,
    Decision,
    Event,
    FollowerBlocked,
    MapReceived,
    MemberReceived,
    PatchesLost,
    PatchRun,
    PathUpdate,
    PlanBroken,
    PlanReady,
    PoseReceived,
    PriorityReceived,
    in_runs,
)


class EventHandler:
    """Applies events, one after the other, to the parts of a mission."""

    def __init__(self, parts: MissionParts) -> None:
        self.map, self.ledger, self.monitor = parts.map, parts.ledger, parts.monitor
        self.orders, self.route, self.line = parts.orders, parts.route, parts.line
        self.trail, self.company, self.changes = parts.trail, parts.company, parts.changes
        self.way_out, self.blocked, self.motion = parts.way_out, parts.blocked, parts.motion
        self.drive, self.battery = parts.lasting.drive, parts.lasting.battery
        self.rooms = parts.lasting.rooms
        self._now = 0.0
        self._path: PathUpdate | None = None
        self._faults: list[FasacoError] = []
        self._answers: list[Answer] = []
        self._is_forgotten = False

    def handle(self, events: Iterable[Event], now: float) -> Decision:
        """Apply events at ``now`` [s]; return their immediate results.

        An event that cannot be used is reported as a fault and changes nothing.
        """
        self._now, self._path, self._is_forgotten = now, None, False
        self._faults, self._answers = [], []
        stood = bool(self.map.building.why)
        for event in in_runs(events):
            self._attempt(partial(self._apply, event))
        self._attempt(self._open_floor)
        self._attempt(self._check_building)
        self._settle_frame()
        if stood and not self.map.building.why:
            self.route.requests.want("the map shows the building of the ledger again")
        return Decision(
            path=self._path,
            faults=tuple(self._faults),
            answers=tuple(self._answers),
            forgotten=self._is_forgotten,
        )

    def _attempt(self, change: Callable[[], None]) -> None:
        try:
            change()
        except FasacoError as error:
            # The error's traceback would hold the map until garbage is collected.
            self._faults.append(error.with_traceback(None))

    def _apply(self, event: Event | PatchRun) -> None:
        match event:
            case MapReceived(grid, at):
                if self.map.receive_map(grid):
                    self._enter_frame(grid.frame)
                self._map_changed(at)
            case PatchRun(patches):
                has_changed, faults = self.map.receive_patches(patches)
                self._faults += faults
                if has_changed:
                    self._map_changed()
            case PatchesLost(count):
                self.map.receive_loss(count)
            case PoseReceived(pose, at):
                self._receive_pose(pose, at)
            case BatteryReceived():
                drives = len(self.route.path.ahead) > 1
                self.battery.receive(event, self._now, drives=drives)
            case PriorityReceived(grid):
                self._receive_priorities(grid)
            case PlanReady() | PlanBroken():
                self._receive_plan(event)
            case CommandReceived():
                self._obey(event)
            case FollowerBlocked():
                self._close_floor(event)
            case MemberReceived():
                self._receive_member(event)

    def _receive_member(self, event: MemberReceived) -> None:
        if reason := self.company.receive(event, self._now):
            self.route.requests.want(reason)

    def _close_floor(self, event: FollowerBlocked) -> None:
        if self.blocked.receive(event, self.map, self.route.revision, self._now):
            self._map_changed(self.monitor.map_at)

    def _receive_priorities(self, grid: OccupancyGrid) -> None:
        """Take in a map of priorities; raise WrongFrame if it is in another frame than the map.

        If there is no map yet, ``_settle_frame`` checks the frame later.
        """
        used = self.map.grid
        if used is not None and grid.frame != used.frame:
            raise _in_other_frame(grid, used)
        if self.orders.scope.worth.receive(grid):
            self.route.requests.want(OTHERS_FIRST)

    def _open_floor(self) -> None:
        """Reopen closed floor when its time is up, if the robot has work."""
        order = self.orders.order_state
        is_at_work = order.is_open or bool(order.errand)
        if is_at_work and self.map.grid is not None and self.map.obstacles.open_due(self._now):
            self.map.draw_obstacles()
            self._map_changed(self.monitor.map_at)

    def _map_changed(self, at: float | None = None) -> None:
        """Follow a new map; raise LedgerMismatchError if it shows another building."""
        assert self.map.ground.free is not None
        assert self.map.grid is not None
        self.monitor.receive_map(self._now if at is None else at)
        self.line.receive_map()
        self.route.requests.receive_map()
        before = self._compare_buildings()
        if before is not None and (self.map.has_moved or self.map.building.is_foreign):
            self.motion.receive_map(before)
            self.way_out.forget_track()
        else:
            self._record_again()  # the pose may have come before the map
            if self.map.shift is not None:
                self.orders.shift_reached(self.map.shift)
        free, frame = self.map.without_obstacles(self.map.ground.free), self.map.grid.frame
        shows_floor = self.map.shows_floor
        self._change_building(self.ledger.check(free, frame) if shows_floor else None)

    def _compare_buildings(self) -> Pose2D | None:
        """Compare the newest map with earlier ones; return the robot's pose on the earlier maps."""
        if self.map.ground.plain is None or self.map.ground.free is None:
            return None
        pose = None if self.map.pose is None else self.map.pose.pose
        if not self.map.shows_floor:
            self.map.building.receive_blank_map()
            return pose
        plain, free = map(self.map.without_obstacles, (self.map.ground.plain, self.map.ground.free))
        contradicts = partial(self.ledger.contradicts, free)
        return self.map.building.receive_map(plain, pose, self._now, contradicts)

    def _settle_frame(self) -> None:
        """Assign the map's frame to places and orders without one; drop any in other frames."""
        grid, frames = self.map.grid, self.map.frames
        if grid is None or grid.frame != frames.active or not frames.is_settled:
            return
        if fault := self.map.places.enter(grid.frame):
            self._faults.append(fault)
        given = self.orders.scope.worth.given
        if given is not None and given.frame != grid.frame:
            self.orders.scope.worth.receive(None)
            self._faults.append(_in_other_frame(given, grid))
        order = self.orders.order_state
        if not order.frame:
            self.orders.set_state(replace(order, frame=grid.frame))
        elif order.frame != grid.frame:
            why = f"it was given in frame {order.frame!r}, the map is in {grid.frame!r}"
            after = order.in_other_frame(why)
            self.changes.begin_order(replace(after, frame=grid.frame))

    def _check_building(self) -> None:
        """Raise LedgerMismatchError once the map has shown another building for long enough."""
        if self.map.grid is None or not self.map.building.update(self._now):
            return
        misfit = self.ledger.begin_elsewhere(self.map.grid.frame)
        self._record_again()
        self._change_building(misfit)

    def _change_building(self, misfit: LedgerMismatchError | None) -> None:
        """Continue on a new map; drop the places if the map shows another building."""
        if misfit is not None:
            self.map.building.accept_building(self._now)
            self.map.places.leave_building(self.ledger.current.frame)
        self._go_on(misfit)

    def _go_on(self, misfit: LedgerMismatchError | None) -> None:
        """Update the reachable area; start over if the ledger belongs to another place."""
        if misfit is None:
            self.changes.update_area()
            return
        self.orders.scope.worth.receive(None)
        self._path = self.route.stop(str(misfit), self._now) or self._path
        self.motion.leave_map()
        self.changes.begin_order(self.orders.order_state.in_other_building(str(misfit)))
        self.route.requests.want(self.ledger.first_plan_reason)
        raise misfit

    def _enter_frame(self, frame: str) -> None:
        """Activate a frame; raise LedgerMismatchError for progress in another frame."""
        is_other_map = self.map.switch_frame()
        before = self.ledger.current.frame
        misfit = self.ledger.move_to(frame)
        if misfit is None and before not in ("", frame):
            why = f"map and poses are in frame {frame!r} now, no longer in {before!r}"
            self.changes.begin_order(self.orders.order_state.in_other_frame(why))
        if not is_other_map and misfit is None:
            return
        self._leave_map(f"map and poses are in frame {frame!r} now")
        self.monitor.receive_map(self._now)
        self.line.receive_map()
        self._compare_buildings()
        if misfit is not None:
            self._record_again()
        self._go_on(misfit)

    def _leave_map(self, why: str) -> None:
        """Stop the robot: its path belongs to another map."""
        self._path = self.route.stop(why, self._now) or self._path
        self.route.abandon()
        self.monitor.forget_pose(self._now)
        self.motion.leave_map()
        self.way_out.forget_track()

    def _receive_pose(self, stamped: StampedPose, at: float | None = None) -> None:
        if self.map.frames.receive_pose(stamped, self._now):
            self._enter_frame(stamped.frame)
        before = self.map.pose
        self.map.receive_pose(stamped)
        has_jumped = self.monitor.receive_pose(stamped, self._now if at is None else at)
        if has_jumped:
            self.ledger.break_track()
            self.drive.break_track()
            self.way_out.forget_track()
            if before is not None:
                self.map.building.record_jump(before.pose, stamped.pose, self._now)
        self.drive.receive_pose(stamped)
        self.way_out.receive_pose(stamped.pose)
        # While the map shows another building, poses are invalid: no floor under them is swept.
        is_known = self.map.building.receive_pose(stamped.pose, self._now)
        if is_known:
            if (motion := self.motion.receive_pose(stamped.pose)) is not None:
                if self.map.building.pop_closure():
                    self.orders.move_home(motion)
                    self.rooms.move(motion, self.changes.lattice_deg)
                self.monitor.driven.break_track()
            for driven in self.monitor.driven.receive_pose(stamped):
                self._record(driven)
        self.line.receive_pose(stamped.pose, self.monitor.on_line_m)
        if has_jumped and self.line.is_followed:
            self.monitor.clear_doubt()  # the robot has driven on between two poses
        cell = self.map.robot_cell()
        if cell is None:
            return
        if has_jumped or self.map.area is None or not self.map.area.contains(cell):
            self.changes.update_area()
        self._path = self.motion.move_path(self._now) or self._path
        self.orders.part.record_cell(cell)
        self.route.record_cell(cell, self.ledger.current.has_visited)
        self.trail.fade_driven()

    def _record_again(self) -> None:
        if self.map.pose is not None and not self.monitor.driven.holds:
            self._record(Driven(self.map.pose.pose, self.monitor.farthest_m))

    def _record(self, driven: Driven) -> None:
        """Record floor swept on the way to a pose; a pose far outside the map is ignored."""
        lattice, pose = self.map.ground.lattice, driven.pose
        if lattice is None:
            return
        if not driven.is_joined:
            self.ledger.break_track()
        if lattice.contains(lattice.cell_at(pose.x, pose.y)):
            full = self.ledger.record(pose, self.map.ground.place_of, driven.farthest_m)
            if full is not None:
                self._faults.append(full)

    def _receive_plan(self, event: PlanReady | PlanBroken) -> None:
        if isinstance(event, PlanBroken):
            self.route.fail(event, self._now)
            raise event.why
        request = self.route.requests.pending
        if request is not None and request.number == event.number:
            self.trail.receive_plan(event.path)
        self._path = self.route.accept(event, self._now) or self._path
        if (
            request is not None
            and self.route.requests.pending is None
            and not self.route.requests.wanted
        ):
            self.monitor.receive_plan(request.number)

    def _obey(self, event: CommandReceived) -> None:
        """Carry out a command; an error becomes its answer."""
        answer, after = self.changes.answer(event)
        self._answers.append(answer)
        if after is None:
            return
        if event.command == "reset":
            self._reset()
        self._path = self.changes.change_to(after, self._now) or self._path

    def _reset(self) -> None:
        """Forget the choice of a frame, and all coverage except under the tool."""
        self._is_forgotten = True
        self.map.places.reset()
        self.map.frames.reset()
        if self.map.switch_frame():
            self._leave_map("reset")
            self.monitor.receive_map(self._now)
            self.line.receive_map()
        self.ledger.reset(self.map.frames.active)
        self.motion.leave_map()
        self.map.building.reset()
        self._compare_buildings()
        self.route.requests.forget_failure()
        self._record_again()


def _in_other_frame(priorities: OccupancyGrid, used: OccupancyGrid) -> WrongFrame:
    return WrongFrame(
        f"priorities in frame {priorities.frame!r}, map in {used.frame!r}",
        hint="publish them in the frame of the map",
    )
