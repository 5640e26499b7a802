"""Mission: events in, decisions out; it owns the map, the ledger, the order and the route.

``step(events, now)`` is all there is. It opens no session, reads no clock and touches no file,
so that a mission can be tested, and repeated, with plain values.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.core.charging import Charging
from fasaco_edge.mission.core.event_handler import EventHandler
from fasaco_edge.mission.core.events import Decision, Event
from fasaco_edge.mission.core.executive import Executive
from fasaco_edge.mission.core.route import Route
from fasaco_edge.mission.core.trail_layer import TrailLayer
from fasaco_edge.mission.coverage.drive_meter import DriveMeter, DriveTimes
from fasaco_edge.mission.coverage.ledger import CoverageLedger, LedgerSnapshot
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.coverage.progress import Coverage, ZoneProgress, zone_progress
from fasaco_edge.mission.coverage.swept_floor import SweptFloor
from fasaco_edge.mission.coverage.unreached import Unreached
from fasaco_edge.mission.fleet.layer import FleetLayer
from fasaco_edge.mission.fleet.shared import SharedProgress
from fasaco_edge.mission.line.layer import FloorToSweep, LineLayer
from fasaco_edge.mission.map.inputs import InputMonitor
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.orders.order_state import OrderState
from fasaco_edge.mission.orders.sequencer import Sequencer
from fasaco_edge.planners.living_trail import LivingTrail

__all__ = ["Mission", "MissionConfig"]


class Mission:
    """Covers all that is reachable, of a map that is still growing.

    Attributes:
        state, reason: what it is doing, and why.
        route: the path, the plan under way, and counts of both; to be read only.
        fleet: the other robots; to be read only.
        charging: the battery, and when to charge; to be read only.
    """

    def __init__(self, config: MissionConfig, order: OrderState | None = None) -> None:
        """Begin with an order; by default with one for everything that can be reached."""
        self._map = MapState(config)
        cell_m, sweeping = config.footprint.cell_m, config.sweeping
        self._ledger = MissionLedger(cell_m, sweeping.tool_m if sweeping else cell_m)
        monitor = InputMonitor(config)
        self.fleet = FleetLayer(config.robot, config.cost.step_s, self._map, self._ledger)
        self._orders = Sequencer(config, self._map, self._ledger, self.fleet)
        self.route = Route(config.spare_share, self._map, self._orders)
        owners = self._map, self._ledger, monitor, self._orders, self.route
        self._line = LineLayer(sweeping, self._map, self._ledger, self._orders, self.route)
        self._trail = TrailLayer(config, self._map, self.route)
        self._drive = DriveMeter()
        self.charging = Charging(config, self._map, self._orders, self.route)
        measured = self._drive, self.fleet, self.charging.gauge
        self._handler = EventHandler(*owners, self._line, self._trail, *measured, config.policy)
        decided_by = self._trail, self.fleet, self.charging
        self._executive = Executive(*owners, *decided_by, config.policy)
        self.restore_order(order or OrderState.autostart())

    def restore_ledger(self, before: LedgerSnapshot) -> None:
        """Go on where a ledger from before a restart ended, unless the map contradicts it.

        To be called before the first step. A contradiction, see ``coverage.mission_ledger``, is
        reported as a fault (LedgerMismatchError) with the map that shows it; what was covered
        since the restart still counts then.
        """
        self._ledger.resume(before)
        self._trail.resume(before.trail)
        self._map.frames.activate(before.frame)

    def restore_order(self, order: OrderState) -> None:
        """Go on with an order from before a restart; to be called before the first step."""
        self._handler.begin_order(order)
        self.state, self.reason = self._executive.status()

    def step(self, events: Iterable[Event], now: float) -> Decision:
        """Apply events in order and decide.

        Args:
            events: what has happened since the last step. An event that cannot be used is
                reported as a fault and changes nothing.
            now: time [s] of any steady clock.
        """
        happened = self._handler.handle(events, now)
        decided = self._executive.decide(now)
        self.state, self.reason = self._executive.status()
        path = decided.path or happened.path
        self._trail.finish(path)
        path = self._line.finish(path, now)
        return replace(happened, plan=decided.plan, path=path)

    def coverage(self) -> Coverage | None:
        """Return how much is covered; None before there is a map."""
        return self._map.coverage(self._ledger)

    def floor_to_sweep(self) -> FloorToSweep | None:
        """Return how much floor is to be swept; None where cells are counted."""
        return self._line.to_sweep

    def drive_times(self) -> DriveTimes:
        """Return what driving takes the robot, as its poses show."""
        return self._drive.times

    def unreached(self) -> Unreached:
        """Return what of the order stays uncovered as things are."""
        return self._orders.unreached()

    def zone_progress(self) -> list[ZoneProgress]:
        """Return how far each zone of the order is."""
        return zone_progress(self.order_state, self._map.area, self._ledger)

    def snapshot(self) -> LedgerSnapshot:
        """Return all that is to outlive a restart: what is covered, and how far the order is."""
        trail, note = self._trail.snapshot(), self.order_state.to_json()
        return replace(self._ledger.snapshot(), trail=trail, note=note)

    @property
    def order_state(self) -> OrderState:
        """The order, and how far it is carried out."""
        return self._orders.order_state

    @property
    def home(self) -> Cell | None:
        """The cell (row, col) the robot returns to; None where there is none yet."""
        return self._orders.goal()

    @property
    def grid(self) -> OccupancyGrid | None:
        """The newest map; None before there is one."""
        return self._map.grid

    @property
    def map_revision(self) -> int:
        """Goes up by one with each new state of the map; 0 before there is one."""
        return self._map.map_revision

    @property
    def pose(self) -> StampedPose | None:
        """The newest pose; None before there is one."""
        return self._map.pose

    @property
    def lattice(self) -> CoverageLattice | None:
        """The lattice over the newest map; None before there is one."""
        return self._map.lattice

    @property
    def ledger(self) -> CoverageLedger:
        """Which cells are covered."""
        return self._ledger.current

    @property
    def covered(self) -> MissionLedger:
        """Which cells this robot and others have covered."""
        return self._ledger

    @property
    def shared(self) -> SharedProgress:
        """Which cells other robots have swept."""
        return self._ledger.shared

    def open_cells(self) -> int:
        """Return how many cells are still to be swept, by this robot or another."""
        return self._orders.left()

    @property
    def trail(self) -> LivingTrail:
        """The pheromone on the lattice."""
        return self._trail.trail

    @property
    def floor(self) -> SweptFloor:
        """Which floor is swept."""
        return self._ledger.floor
