"""Order changes: new orders and commands, applied to map, orders and route."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from fasaco_edge.errors import CommandError, FasacoError, OrderError, WouldForget
from fasaco_edge.grid.geometry import Polygon, Window
from fasaco_edge.grid.rotation import rotated_polygon
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.coverage.floor_tiles import window_of
from fasaco_edge.mission.coverage.ledger import TILE, LedgerSnapshot
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.events import Answer, CommandReceived, PathUpdate
from fasaco_edge.mission.line.layer import LineLayer
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.map.placing import placed, rotated_order
from fasaco_edge.mission.orders.mask import mask_polygons
from fasaco_edge.mission.orders.order import MissionOrder, Zone
from fasaco_edge.mission.orders.zones import in_zones
from fasaco_edge.mission.path.map_motion import MapMotion
from fasaco_edge.mission.path.route import Route
from fasaco_edge.mission.rooms.room_commands import carry_out
from fasaco_edge.mission.rooms.room_watch import RoomWatch
from fasaco_edge.mission.work.order_state import OrderState, Stage
from fasaco_edge.mission.work.sequencer import Sequencer
from fasaco_edge.planners.cost import LONGEST_S

OTHERS_FIRST = "priorities have changed"


@dataclass(slots=True, eq=False)
class OrderChanges:
    """Changes the order and its consequences: keep-outs, reachable area, path."""

    config: MissionConfig
    map: MapState
    ledger: MissionLedger
    orders: Sequencer
    route: Route
    line: LineLayer
    motion: MapMotion
    rooms: RoomWatch
    # Whether the robot is in no fleet: the robots of a fleet have the same cells.
    is_alone: bool
    # Keep-out polygons that apply to every order.
    _configured: tuple[Polygon, ...] = field(default=(), init=False)
    # The version of the rooms and the order at the last comparison.
    _followed: tuple[int, MissionOrder | None] = field(default=(-1, None), init=False)

    def __post_init__(self) -> None:
        policy = self.config.policy
        self._configured = policy.keep_out + mask_polygons(policy.keep_out_mask)

    @property
    def lattice_deg(self) -> float:
        """Angle of the cells' rows to the x axis of the map frame [deg]."""
        return self.config.lattice_deg or 0.0

    def begin_order(self, order: OrderState) -> None:
        """Begin another order, or end the present order if the new state has no order."""
        self.route.abandon()
        self.motion.forget_order()
        self._keep_out(order)
        self.orders.begin_order(order)
        self.update_area()

    def _keep_out(self, order: OrderState) -> None:
        ordered = order.order.keep_out if order.order else ()
        drawn = tuple(keep_out.polygon for keep_out in order.keep_out)
        if self.lattice_deg:
            drawn = tuple(rotated_polygon(polygon, -self.lattice_deg) for polygon in drawn)
        self.map.ground.keep_out(self._configured + ordered + drawn, self.map.grid)
        self.line.receive_map()

    def update_area(self) -> None:
        """Update the reachable area; ask for a new plan if the area has changed."""
        before, route = self.map.area, self.route
        self.map.update_area()
        area = self.map.area
        if area is None:
            return
        self.orders.reach.record_area()
        if before is None:
            again = "robot is on coverable ground again"
            route.requests.want(again if route.revision else self.ledger.first_plan_reason)
        elif change := area.change_since(before):
            route.requests.want(str(change), change.window)

    def answer(self, event: CommandReceived) -> tuple[Answer, OrderState | None]:
        """Return the answer to a command, and the state that follows; None if it is refused."""
        before, book = self.orders.order_state, self.rooms.on(self.map.grid)
        try:
            if event.room is not None:
                carry_out(book, event.command, event.room)
                return Answer(event.number), before
            order = rotated_order(self.map.places.located(event.order, book), -self.lattice_deg)
            if event.command == "start":
                self.map.check_zones(order)
                self._check_passes(order)
            asked = event.asked._replace(order=order)
            has_home = self.map.places.place("home") is not None
            after = before.commanded(asked, has_home=has_home)
            if not asked.discard:
                _check_loss(asked.name, before.forgets(asked, after), self.ledger, self.map)
            plan = self._replan() if event.command == "replan" else None
        except FasacoError as error:
            return Answer(event.number, error), None
        return Answer(event.number, plan=plan), after

    def _check_passes(self, order: MissionOrder) -> None:
        """Raise OrderError if a pass has an impossible speed, or, in a fleet, cells of its own."""
        kinds = [kind for zone in order.zones for kind in zone.kinds]
        usual = self.config.speed_m_s
        least = usual * self.config.cost.step_s / LONGEST_S
        for speed in (kind.speed_m_s for kind in kinds if kind.speed_m_s and usual):
            if speed > usual:
                text = f"expected at most robot.speed_m_s, {usual:g}, got {speed:g}"
                raise OrderError(f"speed_m_s: {text}", key="passes")
            if speed < least:
                text = f"expected at least {least:g}, a cell in an hour, got {speed:g}"
                raise OrderError(f"speed_m_s: {text}", key="passes")
        for name in () if self.is_alone else ("angle_deg", "overlap"):
            if any(getattr(kind, name) is not None for kind in kinds):
                raise OrderError(
                    f"{name} is for a robot alone; robots of a fleet share cells",
                    key="passes",
                    hint=f"leave {name} out; for the direction of lanes, use auto or cross",
                )

    def change_to(self, after: OrderState, now: float) -> PathUpdate | None:
        """Change to the state that follows a command at ``now`` [s]; return the path, if any."""
        before, update = self.orders.order_state, None
        if after.order is not before.order:
            self.begin_order(after)
        elif after.keep_out != before.keep_out:
            update = self._change_keep_outs(after, now)
        elif after.paused and not before.paused:
            self.route.requests.pause()
        elif before.paused and not (after.paused or after.errand):
            update = self._resume(after, now)
        self.orders.set_state(after)
        return update

    def follow_rooms(self) -> None:
        """Let zones of the order follow their rooms; ask for a plan if cells to cover change."""
        book, state = self.rooms.book, self.orders.order_state
        if self._followed == (book.version, state.order) or state.order is None:
            return
        begun = state.zone - (1 if state.waits_for else 0)
        before = state.order.as_given
        given = placed(before, book, begun)
        order = state.order
        if given is not before:
            order = rotated_order(given, -self.lattice_deg)
            self.orders.set_state(replace(state, order=order))
            lattice, zone = self.map.ground.lattice, self.orders.order_state.current_zone
            if lattice is not None and zone is not None and state.begun:
                zones = (state.current_zone or zone,), (zone,)
                then, now = (in_zones(each, lattice.window, lattice.cell_m) for each in zones)
                if (then != now).any():
                    what = f"the outline of {zone.name!r} has changed"
                    self.route.requests.want(what if zone.polygon else "other rooms are left out")
                is_other = zone.ranked != (state.current_zone or zone).ranked
                if is_other and self.orders.scope.worth.choose_again():
                    self.route.requests.want(OTHERS_FIRST)
        self._followed = book.version, order

    def _change_keep_outs(self, order: OrderState, now: float) -> PathUpdate | None:
        """Apply changed keep-outs to the same order; stop a robot inside a keep-out."""
        before = self.map.area
        self._keep_out(order)
        self.route.requests.forget_failure()
        self.update_area()
        self.orders.reach.record_keep_outs(before)
        if not self.map.is_kept_out:
            return None
        # Near the zone's border the robot may still reach floor outside, but not on the same path.
        self.map.set_path_cell(None)
        return self.route.stop("robot is in a keep-out zone", now)

    def _resume(self, order: OrderState, now: float) -> PathUpdate | None:
        self.route.requests.forget_failure()
        if order.begun and order.stage is not Stage.RETURNING:
            return self.route.resume(now)
        self.route.requests.want("resumed")
        return None

    def _replan(self) -> int:
        """Ask for a full new plan; return its number, or raise CommandError if none can be made."""
        if self.map.ground.lattice is None:
            raise CommandError("nothing to plan: there is no map yet", hint="publish a map first")
        if self.map.pose is None:
            raise CommandError("nothing to plan: there is no pose yet", hint="publish a pose first")
        if self.map.area is None or self.map.robot_cell() is None:
            hint = "drive the robot to free floor, or check map, pose and robot radius"
            raise CommandError(f"nothing to plan: {self.map.why_misplaced()}", hint=hint)
        if not self.orders.part.can_plan:
            hint = "the floor in reach is covered: `mission start` covers it again"
            raise CommandError("nothing to plan: no reachable cell is left to cover", hint=hint)
        return self.route.requests.want_full("asked for")


def _check_loss(command: str, zones: tuple[Zone, ...], ledger: MissionLedger, on: MapState) -> None:
    """Refuse a command that would forget covered cells in zones; without a map, anywhere.

    Cells under the tool stay covered, and do not count.

    Raises:
        WouldForget: there are such cells; the text gives their number, their area, and their share
            of the reachable cells.
    """
    if not zones:
        return
    lattice, own = on.ground.lattice, ledger.current.snapshot()
    cells, share = max(own.cells - len(own.under_tool), 0), ""
    if lattice is not None:
        window = lattice.window
        covered = (ledger.visits(window) > 0) & in_zones(zones, window, lattice.cell_m)
        for cell in own.under_tool:
            if lattice.contains(cell):
                covered[lattice.local(cell)] = False
        cells = int(np.count_nonzero(covered)) + _beyond(window, zones, own)
        if on.area is not None:
            reachable = on.area.reachable
            inside, whole = (
                int(np.count_nonzero(each)) for each in (covered & reachable, reachable)
            )
            percent = 100 * inside / max(whole, 1)
            words = "less than 1 %" if percent < 1 else f"{percent:.0f} %"
            share = f", {words} of the floor in reach"
    if cells:
        cells_m2, noun = cells * own.cell_m**2, "cell" if cells == 1 else "cells"
        raise WouldForget(f"{command} forgets {cells} covered {noun} ({cells_m2:.1f} m2){share}")


def _beyond(window: Window, zones: tuple[Zone, ...], own: LedgerSnapshot) -> int:
    """Return the number of covered cells in zones outside the map's window.

    The map may have been larger before the mapper was restarted.
    """
    cells = 0
    for place in own.tiles:
        for part in window_of(place, TILE).without(window):
            covered = (own.visits(part) > 0) & in_zones(zones, part, own.cell_m)
            for row, col in own.under_tool:
                if part.contains(Window(row, col, row + 1, col + 1)):
                    covered[row - part.row0, col - part.col0] = False
            cells += int(np.count_nonzero(covered))
    return cells
