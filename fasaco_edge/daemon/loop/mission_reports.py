"""The mission's parts of a status and of a reply: map, pose, coverage, floor, plans, order."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from fasaco_edge.grid.geometry import Polygon
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.map.placing import left_out
from fasaco_edge.mission.orders.order import order_document
from fasaco_edge.mission.work.order_state import OrderState, Stage
from fasaco_edge.wire.documents.replies import (
    CoverageReport,
    FloorLeft,
    FloorReport,
    KeepOutReport,
    MissionReport,
    Point,
    TroubleReport,
    UnreachedArea,
    UnreachedReport,
    ZoneReport,
)
from fasaco_edge.wire.documents.status import (
    BatteryReport,
    DriveReport,
    MapReport,
    PlanCounts,
    PoseReport,
)

if TYPE_CHECKING:
    from fasaco_edge.mission.core.mission import Mission
    from fasaco_edge.mission.work.progress import RoomProgress, ZoneProgress
    from fasaco_edge.planners.cost import CoverageCost

PASSED = "passed, or in narrow strips, and not known to be swept"
BESIDE = "beside the path, and not worth the way"
ON_PATH, LATER = "on the path", ("to come", "not planned yet")


def map_report(mission: Mission | None) -> MapReport | None:
    """Return the map's part; None before there is a map."""
    if mission is None or mission.grid is None:
        return None
    geometry = mission.grid.geometry
    return MapReport(
        rows=geometry.rows,
        cols=geometry.cols,
        resolution_m=geometry.resolution,
        revision=mission.map.map_revision,
        stamp_ns=mission.grid.stamp_ns,
        frame=mission.grid.frame,
        lattice_deg=round(mission.rotation.deg, 3),
    )


def pose_report(mission: Mission | None) -> PoseReport | None:
    """Return the robot's pose; None before there is one."""
    if mission is None or mission.pose is None:
        return None
    pose = mission.pose.pose
    return PoseReport(x=round(pose.x, 3), y=round(pose.y, 3), yaw=round(pose.yaw, 4))


def battery_report(mission: Mission | None, now: float) -> BatteryReport | None:
    """Return the battery's part; None without a battery topic."""
    if mission is None or not mission.charging.gauge.power:
        return None
    charging, gauge = mission.charging, mission.charging.gauge
    drain = gauge.drain_per_s
    is_charging = mission.order_state.errand == "charge"
    return BatteryReport(
        rounded(gauge.level),
        gauge.power,
        round(gauge.silent_s(now), 1),
        rounded(None if drain is None else 3600.0 * drain),
        rounded(charging.turns_back_at if charging.policy else None),
        rounded(charging.goes_on_at if charging.policy and is_charging else None),
    )


def drive_report(mission: Mission | None, cost: CoverageCost) -> DriveReport:
    """Return the measured driving, with the planned duration of a quarter-turn."""
    planned_s = round(cost.quarter_turn_s, 3)
    if mission is None:
        return DriveReport(planned_s)
    times = mission.drive.times
    return DriveReport(
        planned_s,
        rounded(times.speed_m_s),
        rounded(times.quarter_turn_s),
        rounded(times.half_turn_s),
        times.turns,
    )


def coverage_report(mission: Mission | None) -> CoverageReport | None:
    """Return the coverage in cells and square metres; None before there is a map."""
    coverage = mission.coverage() if mission else None
    if coverage is None:
        return None
    return CoverageReport(
        coverable=coverage.coverable,
        covered=coverage.covered,
        recovered=coverage.recovered,
        remaining=coverage.remaining,
        unreachable=coverage.unreachable,
        covered_m2=round(coverage.covered_m2, 3),
        to_cover_m2=round(coverage.to_cover_m2, 3),
        free_out_of_reach_m2=round(coverage.free_out_of_reach_m2, 3),
        fraction=round(coverage.fraction, 4),
    )


def floor_report(mission: Mission | None) -> FloorReport | None:
    """Return the swept floor and the floor left; None without a mission."""
    if mission is None:
        return None
    swept_m2, to_sweep = round(mission.covered.floor.swept_m2, 3), mission.line.left.areas
    if to_sweep is None:
        return FloorReport(swept_m2)
    # Before the first path no floor is planned; on the way home the line is set aside.
    order = mission.order_state
    is_planned = mission.route.revision > 0 or order.stage is Stage.OVER
    is_aside = bool(order.errand) or (order.paused and not to_sweep.ahead_m2)
    to_come, unplanned = LATER
    comes_later = (is_aside and order.is_open) or mission.orders.scope.is_part
    beside = to_come if comes_later else BESIDE
    beside = beside if is_planned else unplanned
    left = _largest_first(
        (to_sweep.ahead_m2, ON_PATH),
        (to_sweep.left_m2, beside),
        (to_sweep.passed_m2, PASSED),
    )
    beyond = _largest_first(*((m2, reason) for reason, m2 in to_sweep.beyond_m2.items()))
    possible_m2 = to_sweep.possible_m2
    if possible_m2 is not None:
        possible_m2 = round(max(possible_m2, to_sweep.asked_m2), 3)
    return FloorReport(swept_m2, round(to_sweep.asked_m2, 3), left, beyond, possible_m2)


def _largest_first(*parts: tuple[float, str]) -> tuple[FloorLeft, ...]:
    """Return the floor left by reason [m2], without empty reasons."""
    left = (FloorLeft(round(m2, 3), reason) for m2, reason in parts)
    return tuple(sorted((part for part in left if part.m2), key=lambda part: -part.m2))


def plan_counts(mission: Mission | None) -> PlanCounts:
    if mission is None:
        return PlanCounts()
    route = mission.route
    counts = (route.requests.plans, route.unchanged, route.outdated, route.requests.attempts)
    return PlanCounts(*counts, planning=route.requests.is_planning)


def trouble_reports(mission: Mission, now: float) -> tuple[TroubleReport, ...]:
    """Return the troubles of a mission at ``now`` [s]."""
    return tuple(
        TroubleReport(each.code, each.text, each.do, round(max(now - each.since, 0.0), 1))
        for each in mission.troubles
    )


def rounded(value: float | None) -> float | None:
    """Return a value rounded to three digits."""
    return None if value is None else round(value, 3)


def mission_report(
    mission: Mission | None, order_state: OrderState, configured: int = 0
) -> MissionReport:
    """Return the order and its progress; ``configured``: number of configured keep-outs."""
    order, zone = order_state.order, order_state.current_zone
    home = mission.orders.goal() if mission else order_state.home
    keep_outs = tuple(_keep_outs(order_state))
    return MissionReport(
        ordered=None if order is None else ("itself" if order_state.automatic else "command"),
        stage=None if order is None else str(order_state.stage),
        paused=order_state.paused,
        zone=None if zone is None or zone.polygon is None else zone.name,
        pass_number=None if zone is None else order_state.pass_number,
        passes=None if zone is None else zone.passes,
        pass_kind=(zone.kind(order_state.pass_number).name or None) if zone else None,
        zones=tuple(_zones(mission, order_state)),
        keep_out=len(keep_outs) + configured,
        return_home=bool(order and order.return_home),
        home=None if home is None or mission is None else _place(mission, home),
        tries=order_state.tries,
        unreached=_unreached(mission),
        keep_outs=keep_outs,
        waits_for_room=order_state.waits_for or None,
        left_out=() if order is None else left_out(order.zones),
        time_left_s=rounded(mission.time_limit.left_s) if mission else None,
        first_from=mission.orders.scope.worth.least or None if mission else None,
        last_order=order_document(order_state.last) if order_state.last else None,
    )


def _keep_outs(order_state: OrderState) -> Iterator[KeepOutReport]:
    """Yield the keep-outs of the operator, then of the order, in the map frame."""
    for keep_out in order_state.keep_out:
        yield KeepOutReport(keep_out.name, _corners(keep_out.polygon))
    if order_state.order is not None:
        for polygon in order_state.order.as_given.keep_out:
            yield KeepOutReport(polygon=_corners(polygon), by="order")


@lru_cache(maxsize=256)
def _corners(polygon: Polygon) -> tuple[tuple[float, float], ...]:
    return tuple((round(x, 3), round(y, 3)) for x, y in polygon)


def _zones(mission: Mission | None, order_state: OrderState) -> Iterator[ZoneReport]:
    order = (mission.order_state if mission else order_state).order
    given = order.as_given.zones if order else ()
    zones = [(zone, _corners(zone.polygon)) for zone in given if zone.polygon]
    if mission is None:
        for zone, corners in zones:
            yield ZoneReport(zone.name, zone.passes, polygon=corners)
        return
    for done, (_, corners) in zip(zone_progress(mission), zones, strict=True):
        counts = done.newest_pass, done.cells, done.covered
        yield ZoneReport(done.name, done.passes, *counts, polygon=corners)


def _unreached(mission: Mission | None) -> UnreachedReport:
    if mission is None or mission.lattice is None:
        return UnreachedReport()
    found, cell_m = mission.orders.uncovered.found(), mission.lattice.cell_m
    areas = tuple(
        UnreachedArea(
            area.cells,
            round(area.cells * cell_m**2, 3),
            *_centre(mission, area.cell, cell_m),
            reason=area.reason,
        )
        for area in found.areas
    )
    m2 = round(found.cells * cell_m**2, 3)
    return UnreachedReport(found.cells, m2, areas, found.areas_left_out)


def _place(mission: Mission, cell: tuple[int, int]) -> Point | None:
    lattice = mission.lattice
    return None if lattice is None else Point(*_centre(mission, cell, lattice.cell_m))


def _centre(mission: Mission, cell: tuple[int, int], cell_m: float) -> tuple[float, float]:
    x, y = mission.rotation.centre(cell, cell_m)
    return round(x, 3), round(y, 3)


def zone_progress(mission: Mission) -> list[ZoneProgress]:
    """Return the progress of each zone of the order."""
    # Imports kernels, which a daemon without a mission does not load.
    from fasaco_edge.mission.work import progress  # noqa: PLC0415

    return progress.zone_progress(mission.order_state, mission.map.area, mission.covered)


def ahead_s(mission: Mission) -> float:
    """Return the time of the path ahead [s]: of its line, or without a line of its walk."""
    line = mission.line.ahead()
    if line is None:
        return mission.orders.scope.walk_s(mission.route.path.ahead)
    return line.seconds


def room_progress(mission: Mission) -> dict[int, RoomProgress]:
    """Return the progress in each room, by its number."""
    from fasaco_edge.mission.work import progress  # noqa: PLC0415

    area, ahead = mission.map.area, mission.route.path.ahead
    rooms = None if area is None else mission.room_cells.on(area.lattice)
    to_go_s: dict[int, float] = {}
    if area is not None and rooms is not None:
        to_go_s = progress.seconds_in(rooms, area.lattice.window, ahead, ahead_s(mission))
    deg = mission.rotation.deg
    return progress.room_progress(mission.rooms, deg, area, mission.covered, to_go_s)


def unswept(mission: Mission) -> OccupancyGrid | None:
    """Return why floor is not swept, in the map frame, see ``Unswept``; None if unknown."""
    found, grid = mission.line.unswept(), mission.grid
    if found is None or grid is None:
        return None
    geometry = mission.rotation.geometry(found[0])
    return OccupancyGrid(geometry, found[1].view(np.int8), grid.frame, grid.stamp_ns)
