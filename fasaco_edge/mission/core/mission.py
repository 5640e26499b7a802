"""Mission: events in, decisions out; owner of map, ledger, order and route.

``step(events, now)`` runs a mission. This opens no session, reads no clock and touches no file, so
missions can be tested and repeated with plain values.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from fasaco_edge.errors import LedgerMismatchError, NotPublished
from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.core.charging import BatteryGauge
from fasaco_edge.mission.core.company_kind import ALONE, CompanyKind
from fasaco_edge.mission.core.drive_meter import DriveMeter
from fasaco_edge.mission.core.event_handler import EventHandler
from fasaco_edge.mission.core.executive import Executive
from fasaco_edge.mission.core.lattice_layout import LatticeLayout
from fasaco_edge.mission.core.lattice_rotation import LatticeRotation
from fasaco_edge.mission.core.parts import Lasting, laid_parts
from fasaco_edge.mission.core.trouble import Trouble
from fasaco_edge.mission.coverage.counts import Coverage
from fasaco_edge.mission.coverage.ledger import LedgerSnapshot
from fasaco_edge.mission.coverage.relaid_ledger import relaid_ledger
from fasaco_edge.mission.events import (
    Decision,
    Event,
    MapReceived,
    PathUpdate,
    PoseReceived,
    PriorityReceived,
)
from fasaco_edge.mission.map.placing import restored
from fasaco_edge.mission.rooms.room_book import RoomBook
from fasaco_edge.mission.rooms.room_watch import RoomWatch
from fasaco_edge.mission.work.idle_places import IdlePlaces
from fasaco_edge.mission.work.order_state import OrderState, Stage
from fasaco_edge.planners.living_trail import LivingTrail
from fasaco_edge.states import State

__all__ = ["Mission", "MissionConfig"]


class Mission:
    """Covers everything reachable on a growing map.

    Attributes:
        state, reason: its state, and the reason.
        map, orders, covered, line, drive: owners of the map, the order, the cells covered by this
            robot and others, the line, the measured driving; read-only.
        route: the path and the pending plan, with counts; read-only.
        company: the other robots; read-only.
        rotation: the lattice rotation, which converts the mission's places to the map frame;
            read-only.
        room_cells: the cells of the rooms; read-only.
        charging: the battery, and when to charge; read-only.
        time_limit: when the order has to end; read-only.
    """

    def __init__(
        self, config: MissionConfig, order: OrderState | None = None, kind: CompanyKind = ALONE
    ) -> None:
        """Start with an order, by default for everything reachable, and a kind of company."""
        self._config, self._kind = config, kind
        self.drive, self._rooms = DriveMeter(), RoomWatch()
        self._lasting = Lasting(drive=self.drive, battery=BatteryGauge(), rooms=self._rooms)
        self._layout = LatticeLayout(config)
        self._idle = IdlePlaces(config)
        self._lay_cells()
        self._continue(order or OrderState.autostart())

    def _lay_cells(self) -> None:
        """Start a mission on a lattice at the decided angle, with cells of the decided edge."""
        self.rotation = LatticeRotation(self._layout.deg)
        # The newest map in the lattice's frame, and the same map in the map frame.
        self._laid_grid: OccupancyGrid | None = None
        self._given_grid: OccupancyGrid | None = None
        config = self.rotation.config(self._layout.sized(self._config))
        parts = laid_parts(config, self._kind, self._lasting, self.rotation.deg)
        self.map, self.covered, self.orders = parts.map, parts.ledger, parts.orders
        self.route, self.line, self.company = parts.route, parts.line, parts.company
        self.charging, self.time_limit = parts.charging, parts.time_limit
        self.giving_way, self.room_cells = parts.giving_way, parts.room_cells
        self._trail, self._changes = parts.trail, parts.changes
        self._handler = EventHandler(parts)
        self._executive = Executive(parts)

    def restore(
        self,
        before: LedgerSnapshot | None = None,
        order: OrderState | None = None,
        rooms: RoomBook | None = None,
    ) -> None:
        """Continue from before a restart; to be called before the first step.

        If a map contradicts the ledger (``coverage.fit``), the step with that map reports the fault
        LedgerMismatchError, and coverage starts from zero.

        Args:
            before: ledger, which may be empty; None for none.
            order: order; None to keep the mission's order.
            rooms: rooms, which the mission changes; None for none.
        """
        if rooms is not None:
            self._rooms.book = rooms
        order = order or self.order_state
        if before is not None and self._layout.restore(before, order.current_pass):
            self._lay_cells()
        self._continue(order, before, restart=before)

    def _continue(
        self,
        order: OrderState,
        before: LedgerSnapshot | None = None,
        *,
        restart: LedgerSnapshot | None = None,
        is_confirmed: bool = False,
    ) -> None:
        """Continue an order with its ledger, and with the ledger of the last restart."""
        deg, cell_m = self.rotation.deg, self._layout.cell_m
        rotated_by_deg, scale = 0.0, 1.0
        if before is not None:
            rotated_by_deg, scale = deg - before.lattice_deg, cell_m / before.cell_m
        if before is not None and not before.is_empty:
            before = relaid_ledger(before, deg, cell_m)
            self.covered.restore(before, is_confirmed=is_confirmed)
            self._trail.restore(before.trail)
            self.map.frames.activate(before.frame)
            if restart is not None and order.stage is not Stage.OVER:
                self.covered.record_restart(relaid_ledger(restart, deg, cell_m))
        self.map.places.restore(order.places)
        if order.order is not None:
            order = replace(order, order=restored(order.order, self._rooms.book))
        if order.last is not None:
            order = replace(order, last=restored(order.last, self._rooms.book))
        self._changes.begin_order(self.rotation.order(order, rotated_by_deg, scale))
        self.state, self.reason = self._executive.status()

    def continue_from(self, before: Mission) -> None:
        """Take over a predecessor's state of robot and inputs, and its doubt about the building.

        To be called before the first step, which gets the events of the predecessor's
        ``newest_inputs``.
        """
        self._executive.continue_from(before._executive)
        if before.rotation != self.rotation or before._layout.cell_m != self._layout.cell_m:
            return
        self.orders.reach.continue_from(before.orders.reach)
        self.orders.uncovered.continue_from(before.orders.uncovered)
        self._executive.way_out.continue_from(before._executive.way_out)
        if before.is_in_doubt:
            self.map.continue_from(before.map)

    def newest_inputs(self) -> list[Event]:
        """Return the newest map, pose and priorities as events for a succeeding mission."""
        monitor = self._executive.monitor
        priorities = self.rotation.grid(self.orders.scope.worth.given)
        return [
            *([MapReceived(self.grid, monitor.map_at)] if self.grid is not None else []),
            *([PoseReceived(self.pose, monitor.pose_at)] if self.pose is not None else []),
            *([PriorityReceived(priorities)] if priorities is not None else []),
        ]

    @property
    def is_in_doubt(self) -> bool:
        """Whether the map may show another building than before."""
        return self.map.building.is_foreign or bool(self.map.building.why)

    def step(self, events: Iterable[Event], now: float) -> Decision:
        """Apply events in order and decide.

        Args:
            events: events since the last step. An event that cannot be used is reported as a fault
                and changes nothing.
            now: time of any monotonic clock [s].
        """
        events = list(events)
        begun = self._fit_map(events, now)
        happened = self._align(self._handle(events, now), now)
        happened = self._find_rooms(happened, now)
        decided = self._executive.decide(now)
        self.state, self.reason = self._executive.status()
        stop = self.route.stop(self.reason, now) if self.state.is_at_rest else None
        path = stop or decided.path or happened.path or begun
        self._trail.finish(path)
        path = self.line.finish(path, now)
        self.state, self.reason = self._executive.status()
        if path is not None:
            path = self.rotation.path(path, self.lattice)
            path = replace(path, speed_m_s=self.order_state.speed_m_s)
        plan = decided.plan and self._trail.with_trail(decided.plan)
        return replace(happened, plan=plan, path=path)

    def _find_rooms(self, happened: Decision, now: float) -> Decision:
        """Find rooms if due, and let the order follow them; return the decision."""
        if any(isinstance(fault, LedgerMismatchError) for fault in happened.faults):
            self._rooms.leave_building()
        try:
            if self.grid is not None and not self.is_in_doubt:
                self._rooms.update(self.grid, now)
        except Exception as error:  # the robot can sweep without rooms
            why = f"rooms of this map were not published: {type(error).__name__}: {error}"
            hint = "the robot goes on with the rooms it knows; report it with the log"
            fault = NotPublished(why, hint=hint)
            happened = replace(happened, faults=(*happened.faults, fault))
        self._changes.follow_rooms()
        return happened

    def _handle(self, events: Iterable[Event], now: float) -> Decision:
        return self._handler.handle(map(self.rotation.event, events), now)

    def _align(self, happened: Decision, now: float) -> Decision:
        """Change the lattice if the pass or the walls require it; return the combined decision."""
        state, grid, pose = self.order_state, self.grid, self.pose
        self._layout.receive_faults(happened.faults)
        # Keep the cells during an errand, for the path set aside, and while the building is in
        # doubt.
        if state.errand or self.is_in_doubt or grid is None or pose is None:
            return happened
        lay = None if state.current_zone is None else state.current_pass
        why = self._layout.change(lay, grid, pose)
        stop = self._lay_anew(why, now) if why else None
        return replace(happened, path=stop or happened.path)

    def _fit_map(self, events: Iterable[Event], now: float) -> PathUpdate | None:
        """Use the usual lattice for a map that does not fit otherwise; return the path, if any."""
        maps = (event.grid for event in events if isinstance(event, MapReceived))
        why = self._layout.rotates_back_for(maps)
        return self._lay_anew(why, now) if why else None

    def _lay_anew(self, why: str, now: float) -> PathUpdate | None:
        """Continue on another lattice; return the path that stops the robot, if any."""
        before, route, restart = self.snapshot(), self.route, self.covered.before
        order = replace(self.order_state, reached=self.orders.reached)
        is_confirmed = self.covered.is_confirmed and not self.map.building.is_foreign
        executive, held = self._executive, self.newest_inputs()
        # The robot must not drive a path that is no longer checked.
        stop = route.stop(why, now)
        self._lay_cells()
        self._continue(order, before, restart=restart, is_confirmed=is_confirmed)
        self.route.continue_from(route)
        self._executive.continue_from(executive)
        self.drive.break_track()
        self._handle(held, now)
        self.route.requests.want(why)
        return stop

    @property
    def doing(self) -> State:
        """Its activity, regardless of troubles."""
        return self._executive.doing

    @property
    def troubles(self) -> tuple[Trouble, ...]:
        """The troubles in the present state, the most serious first."""
        return self._executive.troubles.found

    def idle_places(self, now: float) -> str:
        """Return which keep-outs and places have no effect on the map at ``now`` [s]; "" if none.

        For reports only, not for decisions.
        """
        if self.grid is None:
            return ""
        is_theirs = not self.map.places.why
        order = self.orders.order_state
        return self._idle.find(self.grid, self.map.map_revision, order, now, is_theirs=is_theirs)

    def coverage(self) -> Coverage | None:
        """Return the counts of coverage; None before there is a map."""
        if (lattice := self.map.ground.lattice) is None:
            return None
        return self.map.coverage(self.covered, self.orders.reach.known(lattice))

    def snapshot(self) -> LedgerSnapshot:
        """Return the state kept over a restart: coverage, and the order's progress."""
        trail = self._trail.snapshot()
        note = replace(self.order_state, reached=self.orders.reached).to_json()
        ledger, lattice_deg = self.covered.snapshot(), self.rotation.deg
        return replace(ledger, trail=trail, note=note, lattice_deg=lattice_deg)

    @property
    def rooms(self) -> RoomBook:
        """The rooms, in the map frame."""
        return self._rooms.book

    @property
    def order_state(self) -> OrderState:
        """The order and its progress."""
        state, places = self.orders.order_state, self.map.places.note
        return state if state.places == places else replace(state, places=places)

    @property
    def grid(self) -> OccupancyGrid | None:
        """The newest map; None before the first map."""
        if self.map.given is not self._laid_grid:
            given = self.map.given
            self._laid_grid, self._given_grid = given, self.rotation.grid(given)
        return self._given_grid

    @property
    def pose(self) -> StampedPose | None:
        """The newest pose; None before the first pose."""
        return self.rotation.pose(self.map.pose)

    @property
    def lattice(self) -> CoverageLattice | None:
        """The lattice over the newest map, in the mission's frame; None before there is a map."""
        return self.map.ground.lattice

    @property
    def trail(self) -> LivingTrail:
        """The living trail."""
        return self._trail.trail
