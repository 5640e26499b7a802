"""Events in: what a mission hears, and what that changes before anything is decided."""

from __future__ import annotations

from collections.abc import Sequence

from fasaco_edge.errors import FasacoError
from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.grid.occupancy import MapPatch
from fasaco_edge.mission.core.events import (
    Answer,
    CommandReceived,
    Event,
    MapReceived,
    PatchesLost,
    PatchRun,
    PathUpdate,
    PlanBroken,
    PlanReady,
    PoseReceived,
)
from fasaco_edge.mission.core.parts import Parts
from fasaco_edge.mission.coverage.ledger import LedgerMismatchError
from fasaco_edge.mission.orders.order_state import CommandError


class EventHandler:
    """Takes events in, one after the other.

    Attributes:
        answers: to the commands taken so far.
        forgotten: whether one of them was to forget what is covered.
        stopped: an empty path that is due unless a later one follows; None for none.
        faults: what went wrong, also with events that were taken all the same.
    """

    def __init__(self, parts: Parts) -> None:
        self.answers: list[Answer] = []
        self.forgotten = False
        self.stopped: PathUpdate | None = None
        self.faults: list[FasacoError] = []
        self._parts = parts

    def take(self, event: Event | PatchRun) -> PathUpdate | None:
        """Take one event; return a path that is due at once.

        Raises:
            FasacoError: it cannot be used, and changes nothing.
        """
        match event:
            case MapReceived(grid):
                if self._parts.site.take_map(grid):
                    self._begin_in(grid.frame)
                self._look_at_map()
            case PatchRun(patches):
                self._take_patches(patches)
            case PatchesLost(count):
                self._parts.site.lose_patches(count)
            case PoseReceived(pose):
                self._take_pose(pose)
            case PlanReady():
                return self._take_plan(event)
            case PlanBroken():
                self._parts.route.give_up(event)
                self._parts.spare.rest(self._parts.now)
                raise event.why
            case CommandReceived():
                self._obey(event)
        return None

    def _take_patches(self, patches: Sequence[MapPatch]) -> None:
        is_other, faults = self._parts.site.take_patches(patches)
        self.faults += faults
        if is_other:
            self._look_at_map()

    def _look_at_map(self) -> None:
        """See what a new map changed; raise LedgerMismatchError where it is another building's."""
        parts, site = self._parts, self._parts.site
        assert site.free is not None
        assert site.grid is not None
        parts.watch.map_came(parts.now)
        parts.route.mend()
        if site.map_moved and site.pose is not None:
            parts.log.part(site.pose.pose)
        else:
            self._record()  # the pose may have come before the map
        self._go_on_after(parts.log.check(site.free, site.grid.frame))

    def _go_on_after(self, misfit: LedgerMismatchError | None) -> None:
        """Find out what can be reached; begin anew where the ledger is of another place."""
        parts = self._parts
        if misfit is not None:
            parts.take_order(parts.agenda.assignment.in_other_building(str(misfit)))
        parts.survey()
        if misfit is not None:
            parts.route.want(parts.log.opening)
            raise misfit

    def _begin_in(self, frame: str) -> None:
        """Let a frame count; raise LedgerMismatchError where there is progress in another."""
        parts = self._parts
        is_other_map = parts.site.turn()
        before = parts.log.ledger.frame
        misfit = parts.log.move_to(frame)
        if misfit is None and before not in ("", frame):
            why = f"map and poses are in frame {frame!r} now, no more in {before!r}"
            parts.take_order(parts.agenda.assignment.in_other_frame(why))
        if is_other_map or misfit is not None:
            self._leave(f"map and poses are in frame {frame!r} now")
            parts.watch.map_came(parts.now)
        if misfit is not None:
            self._record()
        if is_other_map or misfit is not None:
            self._go_on_after(misfit)

    def _leave(self, why: str) -> None:
        """Stop the robot: its path leads through another map."""
        self.stopped = self._parts.route.stop(why) or self.stopped
        self._parts.route.disown()
        self._parts.route.mend()
        self._parts.watch.forget_pose()

    def _take_pose(self, stamped: StampedPose) -> None:
        parts, site, route = self._parts, self._parts.site, self._parts.route
        if site.frames.hear_pose(stamped, parts.now):
            self._begin_in(stamped.frame)
        site.take_pose(stamped)
        astray = parts.watch.pose_came(stamped.pose, parts.now)
        if astray:
            parts.log.lift()
        again = parts.log.follow(stamped.pose)
        self._record()
        cell = site.cell()
        if cell is None:
            return
        if astray or site.ground is None or not site.ground.contains(cell):
            parts.survey()
        if again:
            route.want(f"map and pose moved: {again} cells to be covered again")
        parts.agenda.pass_by(cell)
        route.path = route.path.driven_to(cell, parts.log.ledger.has_visited)

    def _record(self) -> None:
        """Count what lies under the tool; a pose kilometres astray is no drive."""
        lattice, stamped = self._parts.site.lattice, self._parts.site.pose
        if lattice is None or stamped is None:
            return
        pose = stamped.pose
        if lattice.contains(lattice.cell_at(pose.x, pose.y)):
            full = self._parts.log.record(pose)
            if full is not None:
                self.faults.append(full)

    def _take_plan(self, event: PlanReady) -> PathUpdate | None:
        route, watch = self._parts.route, self._parts.watch
        asked = route.asked
        if route.is_improving:
            self._parts.spare.spend(event.seconds, self._parts.now, route.revision)
        update = route.take_plan(event)
        if asked is not None and route.asked is None and not route.wanted:
            watch.plan_made(asked.number)
        return update

    def _obey(self, event: CommandReceived) -> None:
        """Take a command; what is wrong with it goes to whoever gave it."""
        parts, before = self._parts, self._parts.agenda.assignment
        try:
            if event.command == "start":
                parts.site.check_zones(event.order)
            after = before.commanded(event.command, event.order)
            plan = self._replan() if event.command == "replan" else None
        except FasacoError as error:
            self.answers.append(Answer(event.number, error))
            return
        self.answers.append(Answer(event.number, plan=plan))
        if event.command == "reset":
            self._reset()
        if after.order is not before.order:
            parts.take_order(after)
            parts.survey()
        elif after.paused and not before.paused:
            parts.route.disown()
        elif before.paused and not after.paused:
            parts.route.want("resumed")
        parts.agenda.assignment = after

    def _reset(self) -> None:
        """Forget what is covered but where the tool is now, and which frame counts."""
        parts, site = self._parts, self._parts.site
        self.forgotten = True
        site.frames.forget()
        if site.turn():
            self._leave("reset")
            parts.watch.map_came(parts.now)
        parts.log.begin_anew(site.frames.counts)
        parts.route.mend()
        self._record()

    def _replan(self) -> int:
        """Want a full new plan, and return its number; CommandError where there is none to make."""
        site = self._parts.site
        if site.lattice is None:
            raise CommandError("nothing to plan: there is no map yet")
        if site.pose is None:
            raise CommandError("nothing to plan: there is no pose yet")
        if site.ground is None or site.cell() is None:
            raise CommandError(f"nothing to plan: {site.misplaced()}")
        if not self._parts.agenda.can_plan:
            raise CommandError("nothing to plan: no reachable cell is left to cover")
        return self._parts.route.want_anew("asked for")
