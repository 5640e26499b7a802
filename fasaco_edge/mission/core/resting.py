"""Resting: why there is nothing for the robot to drive, whatever the map shows."""

from __future__ import annotations

from dataclasses import dataclass

from fasaco_edge.mission.core.charging import Charging
from fasaco_edge.mission.core.events import State
from fasaco_edge.mission.core.in_dock import InDock
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.orders.sequencer import Sequencer


@dataclass(frozen=True, slots=True)
class Resting:
    """Looks for a reason to rest.

    Attributes:
        mask_frame: the frame of the map that the keep-out mask belongs to; "" for any.
    """

    map: MapState
    orders: Sequencer
    charging: Charging
    dock: InDock
    mask_frame: str

    def why(self, state: State, now: float) -> tuple[State, str] | None:
        """Return state and reason where there is nothing to decide at ``now`` [s]; else None.

        Args:
            state: of the mission so far.
            now: time [s].
        """
        order = self.orders.order_state
        doubt = self.map.building.why if order.order is not None or order.errand else ""
        if order.paused or doubt:
            return (State.PAUSED, order.why_paused) if order.paused else (State.BLOCKED, doubt)
        if order.errand == "charge" and (docked := self.why_in_dock(state, now)):
            return docked
        if not order.errand and not order.is_open:
            return (State.DONE, self.orders.ending) if order.order else (State.IDLE, order.why)
        if self.map.lattice is None:
            return State.WAITING_FOR_MAP, self.map.why_no_map()
        if self.map.pose is None:
            return State.WAITING_FOR_POSE, self.map.why_no_pose()
        no_mask = self.why_no_mask()
        return (State.BLOCKED, no_mask) if no_mask else None

    def why_no_mask(self) -> str:
        """Return why the keep-out zones of this map are missing; "" if they are not.

        The zones of another map would close other places.
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

    def why_in_dock(self, state: State, now: float) -> tuple[State, str] | None:
        """Return state and reason of a robot that is, or may be, in its dock; else None.

        After a restart it may be there until the first battery message: no path may lead it out.
        """
        if self.dock.holds(is_charging=state is State.CHARGING):
            return State.CHARGING, self.charging.why(now)
        if not self.charging.gauge.power and self.dock.is_near():
            return State.BLOCKED, "near the dock: waits for the battery to say if it charges"
        return None
