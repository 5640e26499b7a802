"""Executive: the rules by which a mission decides what the robot does next."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from fasaco_edge.grid.lattice import Cell
from fasaco_edge.mission.core.errands import Errands
from fasaco_edge.mission.core.order_work import OrderWork
from fasaco_edge.mission.core.parts import MissionParts
from fasaco_edge.mission.core.path_checks import PathChecks
from fasaco_edge.mission.core.trouble import DRIVING, Troubles
from fasaco_edge.mission.events import Decision, Doing, PathUpdate
from fasaco_edge.mission.work.order_state import Stage
from fasaco_edge.states import State

# States in which the robot rests: by command, at the end of its order, or to charge.
STOPPED = frozenset((State.PAUSED, State.IDLE, State.DONE, State.CHARGING))


class Executive:
    """Decides by ``rules``; owns the mission's state.

    Attributes:
        troubles: current troubles; read-only.
    """

    @property
    def rules(self) -> tuple[Callable[[], Doing | None], ...]:
        """The rules, in order; each returns the mission's activity, or None to let the next rule
        decide."""
        return (
            self._charge_in_time,
            self._end_in_time,
            self._give_way,
            self._rest,
            self._find_place,
            self._run_errand,
            self._wait_for_room,
            self._look_around,
            self._judge_path,
            self._plan,
            self._end_order,
            self._drive,
        )

    def __init__(self, parts: MissionParts) -> None:
        self.map, self.monitor, self.orders = parts.map, parts.monitor, parts.orders
        self.route, self.charging = parts.route, parts.charging
        self.time_limit, self.giving_way, self.dock = parts.time_limit, parts.giving_way, parts.dock
        self.way_out, self.blocked = parts.way_out, parts.blocked
        self._looking = parts.look_around
        self._standing, self._checks = parts.standing, PathChecks(parts)
        self._errands = Errands(parts)
        self._work = OrderWork(parts, self._errands)
        self.troubles = Troubles(parts)
        self._state, self._reason = State.WAITING_FOR_MAP, "no map yet"
        # State of this step: the time [s], the robot's cell once known, and the path made so far,
        # which is published unless a rule returns another path.
        self._now = 0.0
        self._cell: Cell = 0, 0
        self._update: PathUpdate | None = None

    def continue_from(self, before: Executive) -> None:
        """Continue where another mission ended; a docked robot stays docked."""
        self.troubles.continue_from(before.troubles)
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
        """The mission's activity, regardless of troubles."""
        makes_way = bool(self.giving_way.waits_for) and len(self.route.path.cells) > 0
        return State.RETURNING if self._state is State.DONE and makes_way else self._state

    def decide(self, now: float) -> Decision:
        """Return the decision at ``now`` [s], by the first rule that returns an activity."""
        self._now, self._update = now, None
        self.way_out.forget_why()
        doing = next(doing for rule in self.rules if (doing := rule()) is not None)
        self._state, self._reason = doing.state, doing.reason
        self.troubles.update(self.doing, now)
        return Decision(plan=doing.plan, path=doing.path or self._update)

    def _charge_in_time(self) -> None:
        """Begin to charge if due, and end charging if the battery suffices."""
        orders, charging, now = self.orders, self.charging, self._now
        charging.update(now)
        errand, docked = orders.order_state.errand, self._state is State.CHARGING
        if errand == "charge" and charging.is_enough(now, docked=docked):
            orders.set_state(replace(orders.order_state, errand=""))
        elif not errand and charging.is_due(now):
            charging.begin_errand()
            orders.set_state(replace(orders.order_state, errand="charge"))

    def _end_in_time(self) -> None:
        """End the order if the robot has to leave now to be at home in time."""
        is_due = self.time_limit.is_due(self._now)
        may_work_s = self.time_limit.may_work_s(self._now)
        self.orders.scope.worth.allow(min(may_work_s, self.charging.may_work_s))
        if not is_due:
            return
        if not self.orders.order_state.errand:
            self.route.abandon()
            self.route.requests.want("time is up")
        self.orders.run_out_of_time(self.time_limit.minutes)

    def _give_way(self) -> Doing | None:
        """Wait or make way for another robot, but not in the dock."""
        errand, building = self.orders.order_state.errand, self.map.building
        is_docked = errand == "charge" and self._why_in_dock() is not None
        lacks_map = building.why or self._why_no_mask()
        may_drive = self.monitor.is_sound(self._now) and not lacks_map and not is_docked
        return self.giving_way.decide(self._state, self._now, may_drive=may_drive)

    def _rest(self) -> Doing | None:
        """Rest if a command, the battery or a missing input requires it."""
        resting = self._why_rest()
        if resting is None:
            return None
        if resting[0] in STOPPED:
            self._standing.reset()
        return Doing(*resting)

    def _why_rest(self) -> tuple[State, str] | None:
        """Return state and reason of a robot that has to rest; else None."""
        order = self.orders.order_state
        doubt = self.map.building.why if order.order is not None or order.errand else ""
        if order.paused or doubt:
            return (State.PAUSED, order.why_paused) if order.paused else (State.BLOCKED, doubt)
        if order.errand == "charge" and (docked := self._why_in_dock()):
            return docked
        if not order.errand and not order.is_open:
            return (State.DONE, self.orders.ending) if order.order else (State.IDLE, order.why)
        if self.map.ground.lattice is None:
            return State.WAITING_FOR_MAP, self.map.why_no_map()
        if self.map.pose is None:
            return State.WAITING_FOR_POSE, self.map.why_no_pose()
        no_mask = self._why_no_mask()
        return (State.BLOCKED, no_mask) if no_mask else None

    def _why_no_mask(self) -> str:
        """Return why the keep-out zones of this map are missing; "" if they are known."""
        if why := self.map.places.why_no_keep_out:
            return why
        grid, mask_frame = self.map.grid, self.map.places.mask_frame
        if grid is None or mask_frame in ("", grid.frame):
            return ""
        return (
            f"the keep-out mask is in frame {mask_frame!r}, the map in {grid.frame!r}: "
            f"waits for a mask in {grid.frame!r}"
        )

    def _why_in_dock(self) -> tuple[State, str] | None:
        """Return state and reason of a robot that is, or may be, in its dock; else None.

        After a restart a robot near its dock waits for the first battery message, so that no path
        leads it out of the dock.
        """
        if self.dock.holds(is_charging=self._state is State.CHARGING):
            return State.CHARGING, self.charging.why(self._now)
        if not self.charging.gauge.power and self.dock.is_near():
            return State.BLOCKED, "near the dock: waits for the battery to say if it charges"
        return None

    def _find_place(self) -> Doing | None:
        """Find the robot's cell; lead a robot outside of all cells back to the nearest cell."""
        route, cell = self.route, self.map.robot_cell()
        if cell is None or self.map.area is None:
            self.map.forget_area()
            looks = self._looking.turn(None, self._now)
            return looks or self.way_out.lead_out(self.map.why_misplaced(), self._now)
        self._cell = cell
        self._standing.update(cell, self._now)
        if not len(route.path.cells):
            self.monitor.clear_doubt()  # without a path there is no doubt about it
        self._update = route.truncate(self._now)
        return None

    def _run_errand(self) -> Doing | None:
        """Drive home or to the dock; rest on arrival, and resume the path afterwards."""
        if self.orders.order_state.errand:
            return self._errands.run(self._cell, self._now) or self._rest()
        self._update = self.route.take_up("goes on", self._now) or self._update
        return None

    def _wait_for_room(self) -> Doing | None:
        """Wait for a room that the order names, once all other zones are done."""
        name = self.orders.order_state.waits_for
        return self._work.wait_for_room(name, self._now) if name else None

    def _look_around(self) -> Doing | None:
        """Turn on the spot, before the first path, if the map shows hardly any floor.

        A zone that the map does not show yet is looked for otherwise.
        """
        zone = self.orders.order_state.current_zone
        seeks_zone = zone is not None and zone.polygon is not None
        return None if seeks_zone else self._looking.turn(self.map.area, self._now)

    def _judge_path(self) -> None:
        """Request a plan if the path no longer serves the order."""
        cell, now = self._cell, self._now
        if self._state in DRIVING:
            self._checks.check(cell, now, is_covering=self._state is State.COVERING)
        if reason := self.orders.begin_stage(cell, now):
            self.route.requests.want(reason)
        if reason := self._work.share(cell, now):
            self.route.requests.want(reason)

    def _plan(self) -> Doing | None:
        route, state = self.route, self._state
        if not route.requests.wanted or route.requests.pending is not None:
            return None
        if why := route.requests.why_not_yet(self._now):
            return Doing(State.BLOCKED, why)
        # Wait a moment after the robot was stopped.
        if state is State.BLOCKED and not self._standing.has_waited:
            return Doing(state, self._reason)
        return self._work.plan(self._cell, state, self._now)

    def _end_order(self) -> Doing | None:
        """Stop if the order is over, or if its last cells wait for a retry."""
        route, orders = self.route, self.orders
        if orders.order_state.stage is Stage.RETURNING and self._cell == orders.goal():
            orders.advance(self._now)
        waits = orders.is_waiting and route.path.finished and route.requests.pending is None
        if waits or orders.order_state.stage is Stage.OVER:
            return self._work.settle(self._now)
        return None

    def _drive(self) -> Doing:
        """Drive on; publish the path again to a robot that stands; request better paths."""
        route, now, update = self.route, self._now, self._update
        state, reason = self._state, self._reason
        if route.requests.pending is not None and not len(route.path.cells):
            state, reason = State.PLANNING, route.requests.pending.reason
        elif self.orders.order_state.stage is not Stage.RETURNING:
            state, reason = State.COVERING, ""
        drives = len(route.path.ahead) > 1 and update is None
        if drives and route.requests.pending is None and (why := self.blocked.asks_again(now)):
            update = route.publish_anew(why, now)
        if self._standing.is_on_path and update is None:
            update = route.publish(route.path.ahead, "robot stands", now)
            self._standing.record_try()
        is_free = (
            state is State.COVERING and route.requests.pending is None and not route.requests.wanted
        )
        return Doing(state, reason, update, route.request_improvement(now) if is_free else None)
