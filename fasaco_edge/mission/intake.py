"""Events in: what a mission hears, and what that changes before anything is decided."""

from __future__ import annotations

from fasaco_edge.errors import FasacoError
from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.mission.assignment import CommandError
from fasaco_edge.mission.events import (
    Answer,
    CommandReceived,
    Event,
    MapReceived,
    PatchesLost,
    PatchReceived,
    PathUpdate,
    PlanReady,
    PoseReceived,
)
from fasaco_edge.mission.parts import Parts


class Intake:
    """Takes events in, one after the other.

    Attributes:
        answers: to the commands taken so far.
        forgotten: whether one of them was to forget what is covered.
    """

    def __init__(self, parts: Parts) -> None:
        self.answers: list[Answer] = []
        self.forgotten = False
        self._parts = parts

    def take(self, event: Event) -> PathUpdate | None:
        """Take one event; return a path that is due at once.

        Raises:
            FasacoError: it cannot be used, and changes nothing.
        """
        match event:
            case MapReceived(grid):
                self._parts.site.take_map(grid)
                self._look_at_map()
            case PatchReceived(patch):
                self._parts.site.take_patch(patch)
                self._look_at_map()
            case PatchesLost(count):
                self._parts.site.lose_patches(count)
            case PoseReceived(pose):
                self._take_pose(pose)
            case PlanReady():
                return self._take_plan(event)
            case CommandReceived():
                self._obey(event)
        return None

    def _look_at_map(self) -> None:
        """See what a new map changed; raise LedgerMismatchError where it is another building's."""
        parts, site = self._parts, self._parts.site
        assert site.free is not None
        assert site.grid is not None
        parts.watch.map_came(parts.now)
        if site.map_moved and site.pose is not None:
            parts.log.part(site.pose.pose)
        else:
            self._record()  # the pose may have come before the map
        misfit = parts.log.check(site.free, site.grid.frame)
        if misfit is not None:
            parts.take_order(parts.agenda.assignment.elsewhere(str(misfit)))
        parts.survey()
        if misfit is not None:
            parts.route.want(parts.log.opening)
            raise misfit

    def _take_pose(self, stamped: StampedPose) -> None:
        parts, site, route = self._parts, self._parts.site, self._parts.route
        site.take_pose(stamped)
        astray = parts.watch.pose_came(stamped.pose, parts.now)
        if astray:
            parts.log.lift()
        again = parts.log.follow(stamped.pose)
        self._record()
        cell = site.cell()
        if cell is None:
            return
        if astray or site.ground is None or not site.ground.holds(cell):
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
            self._parts.log.record(pose)

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
            after = before.after(event.command, event.order)
            plan = self._replan() if event.command == "replan" else None
        except FasacoError as error:
            self.answers.append(Answer(event.number, error))
            return
        self.answers.append(Answer(event.number, plan=plan))
        if event.command == "reset":
            parts.log.begin_anew()
            self.forgotten = True
        if after.order is not before.order:
            parts.take_order(after)
            parts.survey()
        elif after.paused and not before.paused:
            parts.route.disown()
        elif before.paused and not after.paused:
            parts.route.want("resumed")
        parts.agenda.assignment = after

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
