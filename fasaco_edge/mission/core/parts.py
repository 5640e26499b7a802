"""Parts of a mission on one lattice, each the only owner of its state."""

from __future__ import annotations

from dataclasses import dataclass

from fasaco_edge.mission.company import Company, Waiting
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.core.charging import BatteryGauge, Charging
from fasaco_edge.mission.core.company_kind import ALONE, CompanyKind
from fasaco_edge.mission.core.drive_meter import DriveMeter
from fasaco_edge.mission.core.in_dock import InDock
from fasaco_edge.mission.core.look_around import LookAround
from fasaco_edge.mission.core.order_changes import OrderChanges
from fasaco_edge.mission.core.standing import BlockedFollower, Standing
from fasaco_edge.mission.core.time_limit import TimeLimit
from fasaco_edge.mission.core.way_out import WayOut
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.coverage.tool_sight import ToolSight
from fasaco_edge.mission.line.layer import LineLayer
from fasaco_edge.mission.map.input_monitor import InputMonitor
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.path.map_motion import MapMotion
from fasaco_edge.mission.path.route import Route
from fasaco_edge.mission.path.trail_layer import TrailLayer
from fasaco_edge.mission.rooms.room_cells import RoomCells
from fasaco_edge.mission.rooms.room_watch import RoomWatch
from fasaco_edge.mission.work.sequencer import Sequencer


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Lasting:
    """The parts that stay when the lattice changes.

    Attributes:
        drive: the measured driving.
        battery: the battery's level and drain.
        rooms: the rooms of the building, in the map frame.
    """

    drive: DriveMeter
    battery: BatteryGauge
    rooms: RoomWatch


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MissionParts:
    """The parts of a mission.

    Attributes:
        map: the newest map, the robot's cell, the reachable cells.
        ledger: the cells covered by this robot and others, and the swept floor.
        monitor: which maps and poses are in use, and which are missing.
        orders: the order, and the cells left.
        route: the published path and the pending plan.
        line: the line over the path.
        trail: the trail from which ants start.
        motion: moves coverage, trail and path with the map after a loop closure.
        company: the other robots; ``giving_way``: which of them this robot waits for.
        charging: when to charge; ``dock``: whether the robot is in its dock.
        time_limit: when the order has to end.
        way_out: the way back for a robot that the map has shut in.
        look_around: turns a robot that sees hardly anything.
        blocked: the follower's report of what blocks the robot.
        standing: how long the robot has not moved.
        changes: orders and commands that change all of these.
        lasting: the parts that stay when the lattice changes.
        room_cells: the room of each cell.
    """

    map: MapState
    ledger: MissionLedger
    monitor: InputMonitor
    orders: Sequencer
    route: Route
    line: LineLayer
    trail: TrailLayer
    motion: MapMotion
    company: Company
    giving_way: Waiting
    charging: Charging
    dock: InDock
    time_limit: TimeLimit
    way_out: WayOut
    look_around: LookAround
    blocked: BlockedFollower
    standing: Standing
    changes: OrderChanges
    lasting: Lasting
    room_cells: RoomCells


def laid_parts(
    config: MissionConfig, kind: CompanyKind, lasting: Lasting, lattice_deg: float
) -> MissionParts:
    """Return new parts on a lattice.

    Args:
        config: the configuration, in the frame of the lattice.
        kind: builds the parts that handle other robots.
        lasting: the parts that stay.
        lattice_deg: angle of the lattice to the map frame [deg].
    """
    map_state = MapState(config)
    cell_m, tool_m, sweeping = config.footprint.cell_m, config.tool_m, config.sweeping
    ahead_m = sweeping.ahead_m if sweeping else 0.0
    footprint, sight = config.footprint, None
    if sweeping and tool_m > 2.0 * (radius_m := footprint.robot_radius_m):
        sight = ToolSight(tool_m, radius_m, footprint.free_at_most, lambda: map_state.grid)
    ledger = MissionLedger(cell_m, tool_m, ahead_m, kind.cells(), sight)
    company = kind.company(config, map_state, ledger)
    room_cells = RoomCells(lasting.rooms, lattice_deg)
    orders = Sequencer(config, map_state, ledger, company, room_cells)
    route = Route(config.spare_share, map_state, orders, company)
    line = LineLayer(sweeping, map_state, ledger, orders, route)
    trail = TrailLayer(config, map_state, route)
    motion = MapMotion(ledger, orders, trail, route)
    return MissionParts(
        map=map_state,
        ledger=ledger,
        monitor=InputMonitor(config),
        orders=orders,
        route=route,
        line=line,
        trail=trail,
        motion=motion,
        company=company,
        giving_way=kind.waiting(config, map_state, orders, route, company),
        charging=Charging(config, map_state, orders, route, lasting.battery),
        dock=InDock(map_state, lasting.battery),
        time_limit=TimeLimit(config, map_state, orders),
        way_out=WayOut(map_state, orders, route),
        look_around=LookAround(config, map_state, route),
        blocked=BlockedFollower(),
        standing=Standing(map_state, route),
        changes=OrderChanges(
            *(config, map_state, ledger, orders, route, line, motion, lasting.rooms),
            is_alone=kind is ALONE,
        ),
        lasting=lasting,
        room_cells=room_cells,
    )
