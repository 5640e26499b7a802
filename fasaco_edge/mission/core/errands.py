"""Errands: the drive home or to the dock, by the shortest path; coverage waits meanwhile."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import Cell
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.mission.core.parts import MissionParts
from fasaco_edge.mission.events import Doing, PathUpdate
from fasaco_edge.mission.orders.order import Errand
from fasaco_edge.mission.path.route import NO_CELLS
from fasaco_edge.states import State

# An errand ends this long after the robot enters the last cell [s]. Meanwhile the robot drives to
# the centre of the cell and turns.
ARRIVAL_S = 2.0
NO_WAY = "no way {}: waits for a map that shows one"
PLACES: dict[Errand, str] = {"home": "home", "charge": "to the dock"}


class Errands:
    """Drives and ends errands."""

    def __init__(self, parts: MissionParts) -> None:
        self.map, self.monitor, self.orders = parts.map, parts.monitor, parts.orders
        self.route, self.charging, self.way_out = parts.route, parts.charging, parts.way_out
        self.standing, self.company = parts.standing, parts.company

    def run(self, cell: Cell, now: float) -> Doing | None:
        """Drive on to the destination of the errand; None if it ends in ``cell``, at home."""
        route, orders, area, path = self.route, self.orders, self.map.area, self.route.path
        errand, update = orders.order_state.errand, None
        is_new = route.set_aside()
        route.requests.want_none()
        goal = orders.goal(errand)
        if cell == goal and not is_new and self.standing.in_cell_s >= ARRIVAL_S:
            if errand == "charge":
                return Doing(State.CHARGING, self.charging.why(now))
            orders.set_state(orders.order_state.arrived())
            return None
        is_off = path.finished or path.is_far(cell) or bool(self.monitor.doubt)
        stands = cell != goal and self.standing.is_on_path
        if stands and not is_new:
            self.standing.record_try()
        is_lost = cell != goal and ((is_off and self.standing.has_waited) or stands)
        to = PLACES[errand]
        if is_new or is_lost or not len(path.cells) or tuple(path.cells[-1].tolist()) != goal:
            self.monitor.clear_doubt()
            if goal is None:
                return Doing(State.BLOCKED, NO_WAY.format(to))
            if area is None or not area.contains(goal):
                return self.way_out.lead_out(NO_WAY.format(to), now, goal)
            here = self.map.cell_at_pose() or cell
            why = self.charging.why_due() if errand == "charge" else ""
            update = self.lead(self.way(area, here, goal), f"drives {to}{why}", errand, now)
        return Doing(State.RETURNING, f"on the way {to}", update)

    def way(self, area: ReachableArea, cell: Cell, goal: Cell) -> NDArray[np.int32]:
        """Return the shortest path, if possible around robots that stand in the way."""
        around = self.company.passable(area, cell)
        path = around.shortest_path(cell, goal) if around.contains(goal) else NO_CELLS
        return path if len(path) else area.shortest_path(cell, goal)

    def lead(self, path: NDArray[np.int32], reason: str, errand: Errand, now: float) -> PathUpdate:
        """Publish a path to the destination of an errand, with the heading there."""
        place = self.map.places.place(errand)
        yaw = None if place is None else place.stand.yaw
        return self.route.publish(path, reason, now, end_yaw=yaw)
