"""Order work: the next plan of an order, or its end if nothing is left to plan."""

from __future__ import annotations

import numpy as np

from fasaco_edge.errors import NothingToCover
from fasaco_edge.grid.lattice import Cell
from fasaco_edge.mission.core.errands import NO_WAY, Errands
from fasaco_edge.mission.core.parts import MissionParts
from fasaco_edge.mission.events import Doing
from fasaco_edge.mission.work.order_state import Stage
from fasaco_edge.states import State


class OrderWork:
    """Plans the rest of an order, and ends it."""

    def __init__(self, parts: MissionParts, errands: Errands) -> None:
        self.map, self.monitor, self.orders = parts.map, parts.monitor, parts.orders
        self.route, self.line, self.company = parts.route, parts.line, parts.company
        self.errands, self.way_out = errands, parts.way_out

    def plan(self, cell: Cell, state: State, now: float) -> Doing:
        """Request the wanted plan; if nothing is left to cover, continue with the order.

        Args:
            cell: the robot's cell.
            state: state of the mission so far.
            now: time [s].
        """
        route, orders = self.route, self.orders
        orders.reopen()
        # A robot that stands and waits for others or for a map needs no division in each step.
        stands = state is State.COVERING and not len(route.path.cells)
        self.share(cell, now, at_once=not stands)
        while orders.order_state.stage is not Stage.RETURNING:
            if why := orders.part.why_standing(now):
                return self._stand_by(why, now)
            try:
                problem = orders.part.problem(cell, route.path_to_keep, orders.goal())
            except NothingToCover:
                if ended := self._go_on_elsewhere(cell, now):
                    return ended
                continue
            request = route.requests.request_plan(problem)
            self.monitor.record_request(request.number)
            state = State.COVERING if len(route.path.cells) else State.PLANNING
            return Doing(state, request.reason, plan=request)
        return self._return_home(cell, now)

    def _go_on_elsewhere(self, cell: Cell, now: float) -> Doing | None:
        """Find other work for a robot without reachable cells to cover; None to plan again.

        In this order: a way out if the robot is shut in, a viewpoint, a wait for others, floor that
        the line has missed, giving up unreachable cells, the next stage of the order.
        """
        route, orders, area = self.route, self.orders, self.map.area
        if area is not None and (why := self.way_out.why_shut_in(area)):
            return self.way_out.lead_out(why, now)
        if reason := orders.part.explore(cell):
            route.requests.want(reason)
            return None
        if why := orders.part.why_looking(cell, now):
            return self._stand_by(why, now)
        if self.line.left.open_missed():
            if why := self.line.left.share.why:
                route.requests.want(why)
            return None
        if area is not None and orders.cells.pass_over(area):
            # Cells of others come before a retry.
            self.share(cell, now, at_once=True)
            return None
        return self._next_stage(cell, now)

    def _next_stage(self, cell: Cell, now: float) -> Doing | None:
        """Advance the order; None if its next stage has something to plan."""
        route, orders = self.route, self.orders
        orders.advance(now)
        if name := orders.order_state.waits_for:
            return self.wait_for_room(name, now)
        if orders.is_waiting or orders.order_state.stage is Stage.OVER:
            route.requests.want_none()
            return self.settle(now)
        if reason := orders.begin_stage(cell, now):
            route.requests.want(reason)
        return None

    def settle(self, now: float) -> Doing:
        """Stop: all is covered, or the rest waits for a retry."""
        orders, area = self.orders, self.map.area
        if not orders.is_waiting:
            return Doing(State.DONE, orders.ending)
        if area is not None and (why := self.way_out.why_shut_in(area)):
            return self.way_out.lead_out(why, now)
        return Doing(State.BLOCKED, orders.waiting_reason())

    def wait_for_room(self, name: str, now: float) -> Doing:
        """Stand until a room has the name ``name``."""
        reason = f"waits for a room {name!r}: no room on the map has this name yet"
        self.route.requests.want_none()
        return Doing(State.BLOCKED, reason, self.route.stop(reason, now))

    def share(self, cell: Cell, now: float, *, at_once: bool = False) -> str:
        """Divide the remaining cells if due; return why a plan is wanted, or ""."""
        if self.orders.order_state.stage is Stage.RETURNING:
            return ""
        return self.company.share(self.orders.cells.untried, cell, now, at_once=at_once)

    def _stand_by(self, reason: str, now: float) -> Doing:
        return Doing(State.COVERING, reason, self.route.stop(reason, now))

    def _return_home(self, cell: Cell, now: float) -> Doing:
        """Drive to where the order ends, or end it there."""
        route, area, home = self.route, self.map.area, self.orders.goal()
        assert area is not None
        route.requests.want_none()
        self.monitor.clear_doubt()
        if home is None or cell == home:
            self.orders.advance(now)
            return self.settle(now)
        path = self.errands.way(area, cell, home)
        if not len(path):
            return self.way_out.lead_out(NO_WAY.format("home"), now, home)
        update = None
        if not np.array_equal(path, route.path.ahead):
            why = ": time is up" if self.orders.order_state.late else ""
            update = self.errands.lead(path, f"returning home{why}", "home", now)
        return Doing(State.RETURNING, "on the way home", update)
