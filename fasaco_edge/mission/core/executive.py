"""The pilot: what the robot is to do now, and why."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fasaco_edge.errors import NothingToCover
from fasaco_edge.grid.lattice import Cell
from fasaco_edge.mission.core.events import Decision, PathUpdate, PlanRequest, State
from fasaco_edge.mission.core.parts import Parts
from fasaco_edge.mission.coverage.progress import DrivenPath
from fasaco_edge.mission.orders.order_state import Stage

# A robot that left its path, or stands still at its end, gets a new one, but not
# more often than this [s]: a flickering pose must not keep the planner busy.
PATIENCE_S = 1.0

# The states of a robot that drives, or soon will.
DRIVING = (State.PLANNING, State.COVERING, State.RETURNING)


class Executive:
    """Decides; the parts tell what there is to decide on."""

    def __init__(self, parts: Parts) -> None:
        self._parts = parts
        self._state, self._reason = State.WAITING_FOR_MAP, "no map yet"
        # The cell the robot is in, and since when.
        self._cell: Cell | None = None
        self._entered_at = 0.0

    def told(self) -> tuple[State, str]:
        """Return the state and its reason, as people are to hear it."""
        trouble = self._parts.watch.trouble(self._parts.now)
        if trouble and self._state in DRIVING:
            lost = self._parts.watch.pose_lost(self._parts.now)
            return State.DEGRADED, trouble + (self._parts.site.elsewhere() if lost else "")
        return self._state, self._reason

    def decide(self) -> Decision:
        """Return what is to be done now."""
        if resting := self._resting():
            return self._rest(*resting)
        parts, route, agenda = self._parts, self._parts.route, self._parts.agenda
        cell = parts.site.cell()
        if cell is None or parts.site.ground is None:
            parts.site.ground = None  # to be surveyed anew once the robot stands well
            return self._rest(State.BLOCKED, parts.site.misplaced())
        if cell != self._cell:
            self._cell, self._entered_at = cell, parts.now
        if not len(route.path.cells):
            parts.watch.doubt = ""  # there is no path the robot could be off
        update = route.cut_off()
        self._look_for_stray(cell)
        if reason := agenda.begin(cell, parts.now):
            route.want(reason)
        if route.wanted and route.asked is None:
            if why := route.broken_for(parts.now):
                return self._rest(State.BLOCKED, why)
            return Decision(path=update) if self._too_soon() else self._ask(cell, update)
        if agenda.assignment.stage is Stage.RETURNING and cell == agenda.assignment.home:
            agenda.go_on(parts.now)
        if agenda.assignment.stage is Stage.OVER or (
            agenda.waiting and route.path.finished and route.asked is None
        ):
            return self._settle(update)
        self._tell()
        return Decision(path=update, plan=self._use_spare_time())

    def _use_spare_time(self) -> PlanRequest | None:
        """Ask for a better path, if nothing else is to be done."""
        parts, route = self._parts, self._parts.route
        is_free = self._state is State.COVERING and route.asked is None and not route.wanted
        if not is_free or not parts.spare.is_there(parts.now):
            return None
        request = route.ask_for_better()
        if request is None:
            parts.spare.skip(parts.now)
        return request

    def _resting(self) -> tuple[State, str] | None:
        """Return why there is nothing to decide, if so."""
        site, agenda = self._parts.site, self._parts.agenda
        assignment = agenda.assignment
        if assignment.order is None:
            return State.IDLE, assignment.why
        if assignment.paused:
            return State.PAUSED, "paused by command"
        if assignment.stage is Stage.OVER and not assignment.automatic:
            return State.DONE, agenda.ending
        if site.lattice is None:
            return State.WAITING_FOR_MAP, site.without_map()
        if site.pose is None:
            return State.WAITING_FOR_POSE, site.without_pose()
        return None

    def _rest(self, state: State, reason: str) -> Decision:
        """Do nothing; a robot that drives stops."""
        self._state, self._reason = state, reason
        return Decision(path=self._parts.route.stop(reason))

    def _settle(self, update: PathUpdate | None) -> Decision:
        """Stand, since all is done, or until it is time to try what is not."""
        agenda = self._parts.agenda
        if agenda.waiting:
            rest = self._rest(State.BLOCKED, agenda.waits_for())
        else:
            rest = self._rest(State.DONE, agenda.ending)
        return replace(rest, path=rest.path or update)

    def _tell(self) -> None:
        """Say what is being done."""
        route = self._parts.route
        if route.asked is not None and not len(route.path.cells):
            self._state, self._reason = State.PLANNING, route.asked.reason
        elif self._parts.agenda.assignment.stage is not Stage.RETURNING:
            self._state, self._reason = State.COVERING, f"path {route.revision}"

    def _waited(self) -> bool:
        return self._parts.now - self._parts.route.published_at >= PATIENCE_S

    def _too_soon(self) -> bool:
        """Tell whether a robot that had to stop should stand a moment before a new plan."""
        return self._state is State.BLOCKED and not self._waited()

    def _look_for_stray(self, cell: Cell) -> None:
        """Want a new plan for a robot that is not where its path is, or at the end of it."""
        parts, path = self._parts, self._parts.route.path
        route, watch, waited = parts.route, parts.watch, self._waited()
        if route.asked is not None or route.wanted or self._state not in DRIVING:
            return
        if watch.doubt:
            doubted = route.published_at < watch.doubt_since
            if doubted and list(cell) in path.ahead[:2].tolist():
                watch.doubt = ""  # it only flickered
            elif waited and parts.now - watch.doubt_since >= PATIENCE_S:
                route.want(watch.doubt)
            return
        last = tuple(path.cells[-1].tolist()) if len(path.cells) else None
        if (
            path.finished and (waited or (last and parts.log.ledger.has_visited(last)))
        ) or self._stands_at(last, path):
            if parts.agenda.gives_up():
                parts.agenda.go_on(parts.now)
            else:
                route.want("cells left over")
        elif waited and path.is_far(cell):
            route.want("robot left the path")

    def _stands_at(self, last: Cell | None, path: DrivenPath) -> bool:
        """Tell whether the robot stands in the last cell of a path it did not drive all along.

        It missed a cell: by the count of cells it is still before that one.
        """
        if self._cell != last or last == tuple(path.ahead[0].tolist()):
            return False
        return self._waited() and self._parts.now - self._entered_at >= PATIENCE_S

    def _ask(self, cell: Cell, update: PathUpdate | None) -> Decision:
        """Ask for the plan that is wanted; where nothing is to be covered, go on."""
        parts, route, agenda = self._parts, self._parts.route, self._parts.agenda
        agenda.reopen()
        while agenda.assignment.stage is not Stage.RETURNING:
            try:
                problem = agenda.problem(cell, route.kept)
            except NothingToCover:
                if reason := agenda.seek(cell):
                    route.want(reason)
                    continue
                agenda.go_on(parts.now)
                if agenda.waiting or agenda.assignment.stage is Stage.OVER:
                    route.want_none()
                    return self._settle(update)
                if reason := agenda.begin(cell, parts.now):
                    route.want(reason)
                continue
            request = route.ask(problem)
            parts.watch.plan_asked(request.number)
            self._state = State.COVERING if len(route.path.cells) else State.PLANNING
            self._reason = request.reason
            return Decision(plan=request, path=update)
        return self._go_home(cell, update)

    def _go_home(self, cell: Cell, update: PathUpdate | None) -> Decision:
        parts, route, home = self._parts, self._parts.route, self._parts.agenda.assignment.home
        assert parts.site.ground is not None
        route.want_none()
        parts.watch.doubt = ""
        if home is None or cell == home:
            parts.agenda.go_on(parts.now)
            return self._settle(update)
        way = parts.site.ground.shortest_path(cell, home)
        if not len(way):
            return self._rest(State.BLOCKED, "no way home: waits for a map that shows one")
        self._state, self._reason = State.RETURNING, "on the way home"
        if np.array_equal(way, route.path.ahead):
            return Decision(path=update)
        return Decision(path=route.publish(way, "returning home"))
