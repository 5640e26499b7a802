"""Giving way: when the robot waits for other robots of its fleet, and where it makes way for them.

While it waits, its path is set aside. Afterwards it resumes the path, or plans a new way home.
``fleet.mission.traffic`` decides what obstructs the robot.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.fleet.mission.layer import FleetLayer
from fasaco_edge.fleet.mission.refuge import discs, refuge
from fasaco_edge.fleet.mission.traffic import (
    AHEAD_M,
    NEAR_M,
    PATIENCE_S,
    SPACING_M,
    STANDS_S,
    WAIT_M,
    Neighbour,
    Obstruction,
    Points,
    least_apart_m,
    obstruction,
    spaced,
)
from fasaco_edge.grid.lattice import Cell, Footprint
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.mission.company import Waiting
from fasaco_edge.mission.events import Doing, PathUpdate
from fasaco_edge.mission.line.way import sees_on
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.map.stay import Stay
from fasaco_edge.mission.orders.order import Errand
from fasaco_edge.mission.path.route import NO_CELLS, Route
from fasaco_edge.mission.work.order_state import Stage
from fasaco_edge.mission.work.sequencer import Sequencer
from fasaco_edge.states import State

# Largest gap between a robot that stands on its path and another robot that blocks it; least
# displacement that counts as motion [m].
BESIDE_M, MOVED_M = 0.4, 0.1
# Distance from the centre of the refuge within which the robot has arrived [m].
ARRIVED_M = 0.05
# Length of the way to the refuge that is checked for other robots [points].
LOOK_POINTS = int(WAIT_M / 2 / SPACING_M)
# A robot obstructs the way to the refuge if its distance from that way decreases by more than this
# after the way was chosen [m].
COMES_M = 0.05
# A robot that has stayed within STAYS_M [m] for LONG_S [s] plans around the robot that obstructs
# it, even if that robot's noisy poses seem to move. After TOO_LONG_S [s] it is reported as stuck.
STAYS_M, LONG_S, TOO_LONG_S = 0.2, 30.0, 60.0
# Least time between two searches for a refuge [s].
AGAIN_S = 2.0


class GivingWay(Waiting):
    """Decides when the robot waits, where it goes to make way, and when it goes on.

    Attributes:
        waits_for: name of the robot that it waits for; "" for none.
        is_near: whether another robot is near.
    """

    def __init__(
        self,
        robot: str,
        footprint: Footprint,
        map_state: MapState,
        orders: Sequencer,
        route: Route,
        fleet: FleetLayer,
    ) -> None:
        self.waits_for = self._reason = ""
        self.is_near = False
        self._neighbours: Mapping[str, Neighbour] = {}
        self._robot, self._radius_m = robot, footprint.robot_radius_m
        self._cell_m = footprint.cell_m
        self._map, self._orders = map_state, orders
        self._route, self._fleet = route, fleet
        self._since = self._sought_at = 0.0
        self._refuge: Cell | None = None
        # The refuge that the robot failed to reach from its present place.
        self._failed_refuge: Cell | None = None
        # Distances of the way from other robots when it was chosen [m].
        self._apart_m: dict[str, float] = {}
        self._has_work = True
        # The path to resume after the wait, and the errand of that path.
        self._held, self._errand = NO_CELLS, ""
        # Where, and since when, the robot is free to drive on; where, and since when, it stays.
        self._free, self._stay = Stay(MOVED_M), Stay(STAYS_M)
        # Reason and time of its last wait.
        self._waited, self._waited_at = "", -math.inf

    def continue_from(self, before: Waiting) -> None:
        """Take over the state of a predecessor: where the robot stays, and why it waited."""
        if not isinstance(before, GivingWay):
            return
        self._waited, self._waited_at = before._waited, before._waited_at
        self._stay = before._stay

    def line(self) -> Points:
        """Return the path's next AHEAD_M, from the robot, as points (x, y) [m], float64 (n, 2)."""
        pose = self._map.pose
        if pose is None or self._map.ground.lattice is None:
            return np.zeros((0, 2))
        count = int(AHEAD_M / self._cell_m) + 2
        # A way to a refuge may begin with a cell beside the robot's own.
        first = 1 if self._refuge is None else 0
        cells = self._cells()[first : count + 1]
        here = np.array([[pose.pose.x, pose.pose.y]])
        return (
            np.concatenate((here, self._map.ground.lattice.centres(cells))) if len(cells) else here
        )

    def _cells(self) -> NDArray[np.int32]:
        """Return the path ahead, or the path set aside during a wait."""
        if self._refuge is not None and len(self._route.path.ahead):
            return self._route.path.ahead
        if not self._has_work:
            return NO_CELLS
        is_held = self.waits_for and self._route.aside is not None
        return self._held if is_held else self._route.path.ahead

    def decide(self, state: State, now: float, *, may_drive: bool) -> Doing | None:
        """Return what the robot does while it waits or makes way; None if it does neither.

        A robot whose order is over makes way, too.
        """
        order, pose = self._orders.order_state, self._map.pose
        self._neighbours = self._fleet.others.neighbours(now)
        # Robots near one another publish more often, even at rest.
        here = None if pose is None else (pose.pose.x, pose.pose.y)
        self.is_near = here is not None and any(
            math.dist((near.message.x, near.message.y), here) < NEAR_M
            for near in self._neighbours.values()
        )
        is_going = (order.order is not None or order.errand) and not order.paused
        if not (is_going and self._fleet.has_members and may_drive):
            self._end()
            return None
        # Others may have swept this robot's last cells while it waited.
        is_homing = order.stage is Stage.RETURNING
        is_over = bool(self.waits_for) and not is_homing and not self._orders.cells.left()
        self._has_work = bool(order.errand) or (order.is_open and not is_over)
        update = self._look(now, order.errand)
        if not self.waits_for:
            return None
        cell = self._map.robot_cell()
        if order.errand or is_homing:
            state = State.RETURNING
        elif state is not State.DONE and cell is not None:
            state = State.COVERING if order.is_open else State.DONE
            if why := self._fleet.share(self._orders.cells.untried, cell, now):
                self._route.requests.want(why)
        return Doing(state, self._reason, update)

    def why_stuck(self, now: float) -> str:
        """Return why the robot seems permanently stuck, or ""."""
        is_stuck = now - self._waited_at <= STANDS_S and now - self._stay.since > TOO_LONG_S
        return f"{self._waited} for more than a minute" if is_stuck else ""

    def _end(self) -> None:
        self.waits_for = self._reason = ""
        self._refuge = None

    def _look(self, now: float, errand: Errand) -> PathUpdate | None:
        """Decide whether to wait; return the path to publish, if any.

        A robot without work left makes way, but does not wait: it has no path of its own. A change
        of the errand ends the wait: the new way may not lead past the other robot.

        The first case that holds decides:

        | case | this robot |
        |---|---|
        | its place is unknown, or no other robot is within NEAR_M | goes on |
        | it is on its way to a refuge, for PATIENCE_S at most | goes there |
        | another robot obstructs it (``traffic.obstruction``) | waits or makes way |
        | it was free to drive, and stood for PATIENCE_S beside another robot | is blocked by it |
        | none of these | goes on |
        """
        if errand != self._errand:
            self._errand = errand
            self._end()
        # The search for a refuge starts at the robot, which is far from its path on a short cut.
        area, cell, pose = self._map.area, self._map.cell_at_pose(), self._map.pose
        here = (math.inf, math.inf) if pose is None else (pose.pose.x, pose.pose.y)
        self._note_place(here, now)
        if area is None or cell is None or not self.is_near:
            self._end()
            return None
        if self._is_underway(here, now):
            return None
        if self._refuge is not None and now - self._sought_at > PATIENCE_S:
            self._failed_refuge = self._refuge
        self._refuge = None
        if found := self._obstruction(here, now):
            return self._hold(found, area, cell, here, now)
        self._end()
        return None

    def _note_place(self, here: tuple[float, float], now: float) -> None:
        """Note where the robot is, and since when it has been free to drive on from there."""
        if not self._free.update(here, now) and len(self._cells()) < 2:
            self._free.begin(here, now)
        if self.waits_for:
            self._waited, self._waited_at = self._reason, now
        # A moment without an obstruction does not end a wait.
        has_waited = now - self._waited_at <= STANDS_S
        if self._stay.update(here, now) or not has_waited:
            self._stay.begin(here, now)
            self._failed_refuge = None

    def _is_underway(self, here: tuple[float, float], now: float) -> bool:
        """Return whether the robot drives to its refuge, and no other robot obstructs the way."""
        ahead = self._route.path.ahead
        is_there = self._refuge is None or self._is_in(self._refuge, here)
        is_stuck = now - self._sought_at > PATIENCE_S
        if is_there or is_stuck or not len(ahead):
            return False
        line = spaced(self.line())[: LOOK_POINTS + 1]
        return all(
            apart_m >= self._apart_m.get(name, self._clear_m(self._neighbours[name])) - COMES_M
            for name, apart_m in self._apart_of(line).items()
        )

    def _apart_of(self, line: Points) -> dict[str, float]:
        """Return a line's distance from each other robot [m], capped at the clearance required."""
        return {
            name: min(
                self._clear_m(near),
                float(np.hypot(*(line - (near.message.x, near.message.y)).T).min()),
            )
            for name, near in self._neighbours.items()
        }

    def _clear_m(self, near: Neighbour) -> float:
        return least_apart_m(self._radius_m, near.message)

    def _is_in(self, refuge: Cell, here: tuple[float, float]) -> bool:
        """Return whether the robot is at the centre of its refuge; at the edge it may obstruct."""
        place = self._map.ground.place_of(refuge)
        return place is None or math.dist(here, place) <= ARRIVED_M

    def _sees(self, area: ReachableArea, a: Points, b: Points) -> bool:
        """Return whether the robot can drive straight between two points, (2,): x, y [m].

        Without a map of the floor, the points must be in one cell, or in two joined by a step.
        """
        if self._map.ground.floor is not None:
            return sees_on(self._map.ground.floor, a, b)
        ends = [area.lattice.cell_at(*point.tolist()) for point in (a, b)]
        return 1 <= len(area.shortest_path(ends[0], ends[1])) <= 2

    def _obstruction(self, here: tuple[float, float], now: float) -> Obstruction | None:
        line, pace_s_m, others = self.line(), self._fleet.step_s / self._cell_m, self._neighbours
        found = obstruction(
            self._robot, self._radius_m, pace_s_m, spaced(line), others, self.waits_for
        )
        if found is not None or not self._is_stalled(now) or len(line) < 2:
            return found
        # The robot should drive, but its line passes nearer to the other robot than its cells do,
        # or a sensor has stopped it.
        for name, near in sorted(others.items()):
            reach_m = self._radius_m + near.message.radius_m + BESIDE_M
            if math.dist(here, (near.message.x, near.message.y)) < reach_m:
                return Obstruction(name, is_blocked=True)
        return None

    def _is_stalled(self, now: float) -> bool:
        """Return whether the robot stands although it has long been free to drive."""
        return now - self._free.since > PATIENCE_S

    def _hold(
        self,
        found: Obstruction,
        area: ReachableArea,
        cell: Cell,
        here: tuple[float, float],
        now: float,
    ) -> PathUpdate | None:
        route, neighbours = self._route, self._neighbours
        if found.robot != self.waits_for:
            # The time of waiting goes on if only the other robot has changed.
            self._since = self._stay.since
        was_waiting = bool(self.waits_for)
        self.waits_for, self._reason = found.robot, found.reason
        has_path = len(route.path.cells) > 0
        ahead = route.path.ahead
        # A new order during the wait brings a new path.
        if route.set_aside() or not was_waiting:
            self._held = ahead
        is_long = now - self._since > PATIENCE_S or self._is_stalled(now)
        # The robot is not free to drive while it waits.
        self._free.count_from(now)
        # Plans also avoid a robot with right of way, as it may be jammed.
        stands = neighbours[found.robot].stands_s > STANDS_S or now - self._stay.since > LONG_S
        if is_long and stands:
            self._fleet.others.avoid(found.robot)
        if (found.is_on_path or is_long) and now - self._sought_at >= AGAIN_S:
            self._sought_at = now
            places, sees = self._map.ground.places_of, partial(self._sees, area)
            way = refuge(area, cell, here, self._radius_m, neighbours, places, sees)
            to = None if way is None else (int(way[-1, 0]), int(way[-1, 1]))
            if way is not None and to and to != self._failed_refuge and not self._is_in(to, here):
                self._refuge = to
                beside = discs(self._radius_m, neighbours)
                update = route.publish(way, self._reason, now, beside=beside)
                self._apart_m = self._apart_of(spaced(self.line()))
                return update
            if self._fleet.others.is_avoided(found.robot):
                self._end()
                return None
        return route.publish(NO_CELLS, self._reason, now) if has_path else None
