"""Executive: decides what the robot does next, and why."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import NothingToCover
from fasaco_edge.grid.lattice import Cell
from fasaco_edge.mission.company import Company, Waiting
from fasaco_edge.mission.core.blocked_follower import BlockedFollower
from fasaco_edge.mission.core.charging import Charging
from fasaco_edge.mission.core.events import Decision, PathUpdate, State
from fasaco_edge.mission.core.in_dock import InDock
from fasaco_edge.mission.core.path_checks import PathChecks
from fasaco_edge.mission.core.route import NO_CELLS, Route
from fasaco_edge.mission.core.standing import Standing
from fasaco_edge.mission.core.trail_layer import TrailLayer
from fasaco_edge.mission.core.trouble import DRIVING, Troubles
from fasaco_edge.mission.core.way_out import WayOut
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.line.layer import LineLayer
from fasaco_edge.mission.map.inputs import InputMonitor
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.map.reachable_area import ReachableArea
from fasaco_edge.mission.orders.order import Errand
from fasaco_edge.mission.orders.order_state import Stage
from fasaco_edge.mission.orders.sequencer import Sequencer

# An errand ends once the robot was in the last cell for this long [s]: its path leads to the centre
# and ends with a turn.
ARRIVAL_S = 2.0
NO_WAY = "no way {}: waits for a map that shows one"
# States of a robot that is not to drive, as somebody said so, or as its order is over.
STOPPED = frozenset((State.PAUSED, State.IDLE, State.DONE, State.CHARGING))
PLACES: dict[Errand, str] = {"home": "home", "charge": "to the dock"}


@dataclass(slots=True, eq=False)
class Executive:
    """Decides from map, ledger, monitor, orders and route; owns the mission's state.

    Attributes:
        mask_frame: the frame of the map that the keep-out mask belongs to; "" for any.
        troubles: what is wrong meanwhile; read-only.
    """

    map: MapState
    ledger: MissionLedger
    monitor: InputMonitor
    orders: Sequencer
    route: Route
    line: LineLayer
    trail: TrailLayer
    company: Company
    charging: Charging
    giving_way: Waiting
    dock: InDock
    way_out: WayOut
    blocked: BlockedFollower
    mask_frame: str
    troubles: Troubles = field(init=False)
    _state: State = field(default=State.WAITING_FOR_MAP, init=False)
    _reason: str = field(default="no map yet", init=False)
    _now: float = field(default=0.0, init=False)
    _standing: Standing = field(init=False)
    _checks: PathChecks = field(init=False)
    _is_shut_in: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        self._standing = Standing(self.map, self.route)
        self._checks = PathChecks(
            self.ledger, self.monitor, self.orders, self.route, self.line, self._standing
        )
        self.troubles = Troubles(
            self.map,
            self.monitor,
            self.charging,
            self.giving_way,
            self._standing,
            self.dock,
            self.way_out,
            self.line.offset,
            self.blocked,
        )

    def succeed(self, before: Executive) -> None:
        """Go on where another mission ended; a docked robot stays docked."""
        self.troubles.succeed(before.troubles)
        if before._state is State.CHARGING:
            self._state, self._reason = before._state, before._reason

    def status(self) -> tuple[State, str]:
        """Return the reported state and its reason, by the last decision."""
        found = self.troubles.found
        if found and self.doing in DRIVING:
            return State.DEGRADED, found[0].text
        if self.doing is State.COVERING and not self._reason:
            return State.COVERING, f"path {self.route.revision}"
        return self.doing, self._reason

    @property
    def doing(self) -> State:
        """What the mission does, with or without troubles."""
        makes_way = bool(self.giving_way.waits_for) and len(self.route.path.cells) > 0
        return State.RETURNING if self._state is State.DONE and makes_way else self._state

    def decide(self, now: float) -> Decision:
        """Return what is to be done at ``now`` [s]."""
        self._is_shut_in = False
        decision = self._decide(now)
        if not self._is_shut_in:
            self.way_out.end()
        self.troubles.look(self.doing, now)
        return decision

    def _decide(self, now: float) -> Decision:
        self._now = now
        self._consider_charging()
        if held := self._give_way():
            return held
        if resting := self._why_resting():
            if resting[0] in STOPPED:
                self._standing.begin_anew()
            return self._rest(*resting, None)
        route = self.route
        cell = self.map.robot_cell()
        if cell is None or self.map.area is None:
            self.map.forget_area()
            return self._lead_out(self.map.why_misplaced(), None)
        self._standing.look(cell, now)
        if not len(route.path.cells):
            self.monitor.clear_doubt()  # without a path the robot cannot be off it
        update = route.truncate(now)
        if self.orders.order_state.errand:
            return self._run_errand(cell, update)
        return self._carry_on(cell, route.take_up("goes on", now) or update)

    def _carry_on(self, cell: Cell, update: PathUpdate | None) -> Decision:
        """Continue with the order."""
        route, orders, now = self.route, self.orders, self._now
        if self._state in DRIVING:
            self._checks.check_deviation(cell, now)
        if self._state is State.COVERING and self.company.has_members:
            self._checks.check_worth(now)
        if reason := orders.begin(cell, now):
            route.want(reason)
        if reason := self._share(cell):
            route.want(reason)
        if route.wanted and route.pending is None:
            if why := route.why_not_yet(now):
                return self._rest(State.BLOCKED, why, update)
            # Wait a moment after the robot was stopped.
            is_too_soon = self._state is State.BLOCKED and not self._standing.has_waited
            return Decision(path=update) if is_too_soon else self._request(cell, update)
        if orders.order_state.stage is Stage.RETURNING and cell == orders.goal():
            orders.advance(now)
        if orders.order_state.stage is Stage.OVER or (
            orders.is_waiting and route.path.finished and route.pending is None
        ):
            return self._settle(update)
        if route.pending is not None and not len(route.path.cells):
            self._state, self._reason = State.PLANNING, route.pending.reason
        elif orders.order_state.stage is not Stage.RETURNING:
            self._state, self._reason = State.COVERING, ""
        drives = len(route.path.ahead) > 1 and update is None
        if drives and route.pending is None and (why := self.blocked.asks_again(now)):
            update = route.publish_anew(why, now)
        if self._standing.is_on_path and update is None:
            update = route.publish(route.path.ahead, "robot stands", now)
            self._standing.note_again()
        is_free = self._state is State.COVERING and route.pending is None and not route.wanted
        return Decision(path=update, plan=route.request_improvement(now) if is_free else None)

    def _give_way(self) -> Decision | None:
        """Wait, or make way, for another robot of the fleet; None where there is no need.

        A robot whose order is over makes way, too; not one in its dock.
        """
        order, way = self.orders.order_state, self.giving_way
        way.look_around(self._now)
        is_going = (order.order is not None or order.errand) and not order.paused
        is_docked = order.errand == "charge" and self._why_in_dock() is not None
        lacks_map = self.map.building.why or self._why_no_mask()
        may_drive = self.monitor.is_sound(self._now) and not lacks_map
        if not (is_going and self.company.has_members and may_drive) or is_docked:
            way.end()
            return None
        # Others may have swept meanwhile what this robot waits to drive to.
        is_homing = order.stage is Stage.RETURNING
        is_vain = bool(way.waits_for) and not is_homing and not self.orders.cells.left()
        has_work = bool(order.errand) or (order.is_open and not is_vain)
        update = way.look(self._now, has_work=has_work, errand=order.errand)
        if not way.waits_for:
            return None
        cell = self.map.robot_cell()
        if order.errand or is_homing:
            self._state = State.RETURNING
        elif self._state is not State.DONE and cell is not None:
            self._state = State.COVERING if order.is_open else State.DONE
            if reason := self._share(cell):
                self.route.want(reason)
        self._reason = way.reason
        return Decision(path=update)

    def _why_resting(self) -> tuple[State, str] | None:
        """Return state and reason where there is nothing to decide; else None."""
        order = self.orders.order_state
        doubt = self.map.building.why if order.order is not None or order.errand else ""
        if order.paused or doubt:
            return (State.PAUSED, order.why_paused) if order.paused else (State.BLOCKED, doubt)
        if order.errand == "charge" and (docked := self._why_in_dock()):
            return docked
        if not order.errand and not order.is_open:
            return (State.DONE, self.orders.ending) if order.order else (State.IDLE, order.why)
        if self.map.lattice is None:
            return State.WAITING_FOR_MAP, self.map.why_no_map()
        if self.map.pose is None:
            return State.WAITING_FOR_POSE, self.map.why_no_pose()
        no_mask = self._why_no_mask()
        return (State.BLOCKED, no_mask) if no_mask else None

    def _why_no_mask(self) -> str:
        """Return why keep-out zones for this map are missing; "" where none is due, or none is.

        Those of another map would keep out of other places.
        """
        if why := self.map.places.why_no_keep_out:
            return why
        grid = self.map.grid
        if grid is None or self.mask_frame in ("", grid.frame):
            return ""
        return (
            f"the keep-out mask is in frame {self.mask_frame!r}, the map in {grid.frame!r}: "
            "waits for one in the map's"
        )

    def _rest(self, state: State, reason: str, update: PathUpdate | None) -> Decision:
        """Be in a state: at rest the mission withdraws the path; else ``update`` is published.

        ``update`` is what this step has made of the path: a path that was cut to nothing is not
        withdrawn again.
        """
        self._state, self._reason = state, reason
        return Decision(path=update)

    def _lead_out(self, why: str, update: PathUpdate | None, goal: Cell | None = None) -> Decision:
        """Lead a robot that is shut in back along its track, to where it can go on, or to a goal.

        Not one in a keep-out zone, which a person has drawn. ``update``: see ``_rest``.
        """
        if self.map.is_kept_out:
            return self._rest(State.BLOCKED, why, update)

        def leads_on(area: ReachableArea) -> bool:
            return area.contains(goal) if goal else not self.orders.is_shut_in(area)

        self._is_shut_in = True
        way = self.way_out.lead(leads_on, why, self._now)
        back = f"{why}: drives back along its track"
        if way is not None:
            reason = back if len(way) else why
            update = self.route.publish_way_out(way, reason, self._now) or update
        if self.route.is_way_out:
            return self._rest(State.COVERING, back, update)
        return self._rest(State.BLOCKED, why, update)

    def _stand_by(self, reason: str, update: PathUpdate | None) -> Decision:
        """Stand in the middle of an order, without a path."""
        stop = self.route.stop(reason, self._now)
        return self._rest(State.COVERING, reason, stop or update)

    def _settle(self, update: PathUpdate | None) -> Decision:
        """Stop: all is covered, or the rest waits for a retry."""
        orders, area = self.orders, self.map.area
        if orders.is_waiting and area is not None and orders.is_shut_in(area):
            return self._lead_out(self._why_shut_in(area), update)
        if orders.is_waiting:
            return self._rest(State.BLOCKED, orders.waiting_reason(), update)
        return self._rest(State.DONE, orders.ending, update)

    def _request(self, cell: Cell, update: PathUpdate | None) -> Decision:
        """Request the wanted plan; if nothing is left to cover, continue with the order."""
        route, orders = self.route, self.orders
        orders.reopen()
        # One that stands, as others go on or for a map, has no more reason in each step.
        stands = self._state is State.COVERING and not len(route.path.cells)
        self._share(cell, at_once=not stands)
        while orders.order_state.stage is not Stage.RETURNING:
            if why := orders.why_standing(self._now):
                return self._stand_by(why, update)
            try:
                problem = orders.problem(cell, route.path_to_keep)
            except NothingToCover:
                if self.map.area is not None and orders.is_shut_in(self.map.area):
                    return self._lead_out(self._why_shut_in(self.map.area), update)
                if reason := orders.explore(cell):
                    route.want(reason)
                    continue
                if why := orders.why_looking(cell, self._now):
                    return self._stand_by(why, update)
                if self.line.open_missed():
                    continue
                if orders.pass_over_unreachable():
                    self._share(cell, at_once=True)
                    continue
                orders.advance(self._now)
                if orders.is_waiting or orders.order_state.stage is Stage.OVER:
                    route.drop()
                    return self._settle(update)
                if reason := orders.begin(cell, self._now):
                    route.want(reason)
                continue
            request = route.request_plan(self.trail.posed(problem))
            self.monitor.note_request(request.number)
            self._state = State.COVERING if len(route.path.cells) else State.PLANNING
            self._reason = request.reason
            return Decision(plan=request, path=update)
        return self._return_home(cell, update)

    def _why_shut_in(self, area: ReachableArea) -> str:
        """Return what shuts the robot in: most of what it could reach is out of reach."""
        reached, once = self.orders.reached_m2(area)
        return f"shut in: {reached:.1f} of {once:.1f} m2 in reach"

    def _share(self, cell: Cell, *, at_once: bool = False) -> str:
        """Divide the rest among the fleet if due; return why a plan is wanted, or ""."""
        if self.orders.order_state.stage is Stage.RETURNING:
            return ""
        return self.company.share(self.orders.cells.open_cells, cell, self._now, at_once=at_once)

    def _return_home(self, cell: Cell, update: PathUpdate | None) -> Decision:
        route, area, home = self.route, self.map.area, self.orders.goal()
        assert area is not None
        route.drop()
        self.monitor.clear_doubt()
        if home is None or cell == home:
            self.orders.advance(self._now)
            return self._settle(update)
        path = self._way(area, cell, home)
        if not len(path):
            return self._lead_out(NO_WAY.format("home"), update, home)
        self._state, self._reason = State.RETURNING, "on the way home"
        if np.array_equal(path, route.path.ahead):
            return Decision(path=update)
        return Decision(path=self._lead(path, "returning home", "home"))

    def _way(self, area: ReachableArea, cell: Cell, goal: Cell) -> NDArray[np.int32]:
        """Return the shortest path, around robots that stand in the way where that is possible."""
        around = self.orders.passable(area, cell)
        path = around.shortest_path(cell, goal) if around.contains(goal) else NO_CELLS
        return path if len(path) else area.shortest_path(cell, goal)

    def _lead(self, path: NDArray[np.int32], reason: str, errand: Errand) -> PathUpdate:
        """Publish a path to the destination of an errand, with the heading there."""
        place = self.map.places.place(errand)
        yaw = None if place is None else place.stand.yaw
        return self.route.publish(path, reason, self._now, end_yaw=yaw)

    def _run_errand(self, cell: Cell, update: PathUpdate | None) -> Decision:
        """Drive to the destination of an errand by the shortest path; coverage waits."""
        route, orders, area, path = self.route, self.orders, self.map.area, self.route.path
        errand = orders.order_state.errand
        is_new = route.set_aside()
        route.drop()
        goal = orders.goal(errand)
        if cell == goal and not is_new and self._standing.in_cell_s >= ARRIVAL_S:
            if errand == "charge":
                return self._rest(State.CHARGING, self.charging.why(self._now), update)
            return self._arrive(update)
        is_off = path.finished or path.is_far(cell) or bool(self.monitor.doubt)
        stands = cell != goal and self._standing.is_on_path
        if stands and not is_new:
            self._standing.note_again()
        is_lost = cell != goal and ((is_off and self._standing.has_waited) or stands)
        to = PLACES[errand]
        if is_new or is_lost or not len(path.cells) or tuple(path.cells[-1].tolist()) != goal:
            self.monitor.clear_doubt()
            if goal is None:
                return self._rest(State.BLOCKED, NO_WAY.format(to), update)
            if area is None or not area.contains(goal):
                return self._lead_out(NO_WAY.format(to), update, goal)
            here = self.map.cell_at_pose() or cell
            why = self.charging.why_due() if errand == "charge" else ""
            update = self._lead(self._way(area, here, goal), f"drives {to}{why}", errand)
        self._state, self._reason = State.RETURNING, f"on the way {to}"
        return Decision(path=update)

    def _consider_charging(self) -> None:
        """Begin to charge if due, and end charging if it is enough."""
        orders, charging = self.orders, self.charging
        charging.look(self._now)
        errand = orders.order_state.errand
        docked = self._state is State.CHARGING
        if errand == "charge" and charging.is_enough(self._now, docked=docked):
            orders.set_state(replace(orders.order_state, errand=""))
        elif not errand and charging.is_due(self._now):
            orders.set_state(replace(orders.order_state, errand="charge"))

    def _why_in_dock(self) -> tuple[State, str] | None:
        """Return state and reason of a robot that is, or may be, in its dock; else None.

        After a restart it may be there until the first battery message: no path may lead it out.
        """
        if self.dock.holds(is_charging=self._state is State.CHARGING):
            return State.CHARGING, self.charging.why(self._now)
        if not self.charging.gauge.power and self.dock.is_near():
            return State.BLOCKED, "near the dock: waits for the battery to say if it charges"
        return None

    def _arrive(self, update: PathUpdate | None) -> Decision:
        """End an errand on arrival."""
        self.orders.set_state(self.orders.order_state.arrived())
        resting = self._why_resting()
        assert resting is not None
        return self._rest(*resting, update)
