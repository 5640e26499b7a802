"""Shut in: the way out for a robot that cannot continue from its place."""

from __future__ import annotations

from dataclasses import dataclass

from fasaco_edge.grid.lattice import Cell
from fasaco_edge.mission.core.doing import Doing
from fasaco_edge.mission.core.events import PathUpdate, State
from fasaco_edge.mission.core.route import Route
from fasaco_edge.mission.core.way_out import WayOut
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.map.reachable_area import ReachableArea
from fasaco_edge.mission.orders.sequencer import Sequencer


@dataclass(frozen=True, slots=True)
class ShutIn:
    """Leads the robot out, if its track leads out."""

    map: MapState
    orders: Sequencer
    route: Route
    way_out: WayOut

    def lead_out(
        self, why: str, update: PathUpdate | None, now: float, goal: Cell | None = None
    ) -> Doing:
        """Lead the robot back along its track, to a place where it can continue, or to a goal.

        A robot in a keep-out zone stays, as a person has drawn the zone. To be called in each step
        while the robot cannot continue.

        Args:
            why: what shuts it in.
            update: the path that this step has made up to now: an empty path is not withdrawn
                again.
            now: time [s].
            goal: destination; None for the nearest work.
        """
        if self.map.is_kept_out:
            return Doing(State.BLOCKED, why, update)

        def leads_on(area: ReachableArea) -> bool:
            return area.contains(goal) if goal else not self.orders.is_shut_in(area)

        way = self.way_out.lead(leads_on, why, now)
        back = f"{why}: drives back along its track"
        if way is not None:
            reason = back if len(way) else why
            update = self.route.publish_way_out(way, reason, now) or update
        if self.route.is_way_out:
            return Doing(State.COVERING, back, update)
        return Doing(State.BLOCKED, why, update)

    def why(self, area: ReachableArea) -> str:
        """Return what shuts the robot in; "" if it can reach most of its former area."""
        if not self.orders.is_shut_in(area):
            return ""
        reached, once = self.orders.reached_m2(area)
        return f"shut in: {reached:.1f} of {once:.1f} m2 in reach"
