"""The daemon's status: one JSON document, published on change and once a second.

Also reports the order and its progress, in a status and in the answer to a command.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from msgspec.structs import replace

from fasaco_edge import __version__
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.figures import CycleTimes, Faults
from fasaco_edge.daemon.loop.answers import config_document
from fasaco_edge.host.processes import resident_mb, thread_count
from fasaco_edge.mission.orders.order_state import OrderState
from fasaco_edge.wire.documents.path_documents import PathReport
from fasaco_edge.wire.documents.replies import (
    CoverageReport,
    FloorLeft,
    FloorReport,
    MissionReport,
    Point,
    Reply,
    UnreachedArea,
    UnreachedReport,
    ZoneReport,
)
from fasaco_edge.wire.documents.status import (
    BatteryReport,
    ClaimReport,
    DriveReport,
    FleetReport,
    Latencies,
    LedgerReport,
    MapReport,
    MemberReport,
    PlanCounts,
    PoseReport,
    Status,
    SupervisedRecorder,
)

if TYPE_CHECKING:
    from fasaco_edge.daemon.loop.mission_runner import MissionRunner
    from fasaco_edge.mission.core.events import PathUpdate
    from fasaco_edge.mission.core.mission import Mission

HEARTBEAT_S = 1.0
# Changes closer together than this go out as one.
LEAST_INTERVAL_S = 0.05


class StatusBoard:
    """Collects what a status holds, and knows when one is due.

    Attributes:
        claim: who this daemon is, and whether it plans, as the status has it.
        yield_reason: why another daemon plans, and this one does not; "" where it does.
    """

    def __init__(self, config: DaemonConfig) -> None:
        self.faults = Faults()
        self.turns = CycleTimes()
        self.ingest_s: float | None = None
        self.plan_s: float | None = None
        self.map_to_path_s: float | None = None
        self.recorder: SupervisedRecorder | None = None
        self.ledger = LedgerReport()
        self.path: PathUpdate | None = None
        self.waits = "no map yet"
        self.claim = ClaimReport()
        self.yield_reason = ""
        self._config = config
        self.show(config)
        self._started = time.monotonic()
        self._sent_at = float("-inf")
        self._sent_key: tuple[object, ...] = ()

    def show(self, config: DaemonConfig) -> None:
        """Show this configuration as the one in force."""
        self._shown_config = config_document(config)
        self._cost = config.robot.cost()
        self._standing = len(config.mission.keep_out) + bool(config.mission.keep_out_mask)

    def due(self, runner: MissionRunner, now: float) -> Status | None:
        """Return the status if it changed or a second has passed, else None.

        A daemon that waits for another one leaves the heartbeat to that one.
        """
        mission, order_state = runner.mission, runner.order_state
        state, reason = self._state(runner)
        recorder = self.recorder and self.recorder.state
        revision = self.path and self.path.revision
        claim = self.claim.stand
        key = (state, reason, revision, recorder, self.ledger.fault, order_state, claim)
        # Many small faults are not worth a message each: the heartbeat counts them.
        heartbeat_s = float("inf") if self.yield_reason else HEARTBEAT_S
        wait = LEAST_INTERVAL_S if key != self._sent_key else heartbeat_s
        if now - self._sent_at < wait:
            return None
        self._sent_at, self._sent_key = now, key
        return Status(
            robot=self._config.robot.name,
            version=__version__,
            state=state,
            reason=reason,
            claim=self.claim,
            uptime_s=round(now - self._started, 3),
            map=_map(mission),
            pose=_pose(mission),
            coverage=_coverage(mission),
            floor=floor_report(mission),
            path=self._path(mission),
            plan=_plans(mission),
            latency_ms=Latencies(_ms(self.ingest_s), _ms(self.plan_s), _ms(self.map_to_path_s)),
            loop_ms=self.turns.report(),
            drive=self._drive(mission),
            battery=_battery(mission, now),
            errors=self.faults.counts(),
            ledger=self.ledger,
            recorder=self.recorder,
            rss_mb=resident_mb(),
            cpu_s=round(time.process_time(), 3),
            threads=thread_count(),
            config=self._shown_config,
            mission=mission_report(mission, order_state, self._standing),
            fleet=self._fleet(mission, now),
        )

    def reply(self, runner: MissionRunner) -> Reply:
        """Return the answer to a command."""
        state, reason = self._state(runner)
        return Reply(
            robot=self._config.robot.name,
            state=state,
            reason=reason,
            coverage=_coverage(runner.mission),
            floor=floor_report(runner.mission),
            mission=mission_report(runner.mission, runner.order_state, self._standing),
        )

    def _state(self, runner: MissionRunner) -> tuple[str, str]:
        if self.yield_reason:
            return "blocked", self.yield_reason
        if (mission := runner.mission) is not None:
            return str(mission.state), mission.reason
        order_state, loading = runner.order_state, runner.loading
        if order_state.paused:
            return "paused", order_state.why_paused
        if order_state.order is None:
            return "idle", order_state.why
        return ("loading", loading) if loading else ("waiting for map", self.waits)

    def _fleet(self, mission: Mission | None, now: float) -> FleetReport | None:
        fleet = self._config.fleet
        if not fleet:
            return None
        if mission is None:
            return FleetReport(fleet.name)
        members = tuple(
            MemberReport(
                name,
                member.told.state,
                round(max(now - member.heard_at, 0.0), 1),
                member.absence(now) or None,
                mission.shared.cells_of(name),
            )
            for name, member in sorted(mission.fleet.members.items())
        )
        return FleetReport(fleet.name, mission.fleet.number, mission.fleet.part_cells(), members)

    def _drive(self, mission: Mission | None) -> DriveReport:
        planned_s = round(self._cost.quarter_turn_s, 3)
        if mission is None:
            return DriveReport(planned_s)
        times = mission.drive_times()
        return DriveReport(
            planned_s,
            _rounded(times.speed_m_s),
            _rounded(times.quarter_turn_s),
            _rounded(times.half_turn_s),
            times.turns,
        )

    def _path(self, mission: Mission | None) -> PathReport | None:
        update = self.path
        if update is None or mission is None:
            return None
        return replace(
            PathReport.of(update.plan),
            revision=update.revision,
            steps=max(len(update.cells) - 1, 0),
            remaining_steps=max(len(mission.route.path.ahead) - 1, 0),
            reason=update.reason,
        )


def _map(mission: Mission | None) -> MapReport | None:
    if mission is None or mission.grid is None:
        return None
    geometry = mission.grid.geometry
    return MapReport(
        rows=geometry.rows,
        cols=geometry.cols,
        resolution_m=geometry.resolution,
        revision=mission.map_revision,
        stamp_ns=mission.grid.stamp_ns,
        frame=mission.grid.frame,
        lattice_deg=round(mission.turn.deg, 3),
    )


def _pose(mission: Mission | None) -> PoseReport | None:
    if mission is None or mission.pose is None:
        return None
    pose = mission.pose.pose
    return PoseReport(x=round(pose.x, 3), y=round(pose.y, 3), yaw=round(pose.yaw, 4))


def _battery(mission: Mission | None, now: float) -> BatteryReport | None:
    if mission is None or not mission.charging.gauge.power:
        return None
    charging, gauge = mission.charging, mission.charging.gauge
    drain = gauge.drain_per_s
    is_charging = mission.order_state.errand == "charge"
    return BatteryReport(
        _rounded(gauge.level),
        gauge.power,
        round(gauge.silent_s(now), 1),
        _rounded(None if drain is None else 3600.0 * drain),
        _rounded(charging.turns_back_at if charging.policy else None),
        _rounded(charging.goes_on_at if charging.policy and is_charging else None),
    )


def _coverage(mission: Mission | None) -> CoverageReport | None:
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
    """Return this part of the status."""
    if mission is None:
        return None
    swept_m2, to_sweep = round(mission.floor.swept_m2, 3), mission.floor_to_sweep()
    if to_sweep is None:
        return FloorReport(swept_m2)
    # Before the first path nothing has been weighed.
    is_planned = mission.route.revision > 0
    beside = "beside the path, and not worth the way" if is_planned else "not planned yet"
    left = _largest_first((to_sweep.ahead_m2, "on the path"), (to_sweep.left_m2, beside))
    beyond = _largest_first(*((m2, reason) for reason, m2 in to_sweep.beyond_m2.items()))
    return FloorReport(swept_m2, round(to_sweep.asked_m2, 3), left, beyond)


def _largest_first(*parts: tuple[float, str]) -> tuple[FloorLeft, ...]:
    """Return floor left for some reasons [m2], without those that are of none."""
    told = (FloorLeft(round(m2, 3), reason) for m2, reason in parts)
    return tuple(sorted((part for part in told if part.m2), key=lambda part: -part.m2))


def _plans(mission: Mission | None) -> PlanCounts:
    if mission is None:
        return PlanCounts()
    route = mission.route
    counts = (route.plans, route.unchanged, route.outdated, route.attempts)
    return PlanCounts(*counts, planning=route.is_planning)


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 3)


def _ms(seconds: float | None) -> float | None:
    return None if seconds is None else round(1e3 * seconds, 3)


def mission_report(
    mission: Mission | None, order_state: OrderState, standing: int = 0
) -> MissionReport:
    """Return this part of the status; ``standing`` is how many keep-out zones hold for all."""
    order, zone = order_state.order, order_state.current_zone
    home = mission.home if mission else order_state.home
    return MissionReport(
        ordered=None if order is None else ("itself" if order_state.automatic else "command"),
        stage=None if order is None else str(order_state.stage),
        paused=order_state.paused,
        zone=None if zone is None or zone.polygon is None else zone.name,
        pass_number=None if zone is None else order_state.pass_number,
        passes=None if zone is None else zone.passes,
        zones=_zones(mission, order_state),
        keep_out=(0 if order is None else len(order.keep_out)) + standing,
        return_home=bool(order and order.return_home),
        home=None if home is None or mission is None else _place(mission, home),
        tries=order_state.tries,
        unreached=_unreached(mission),
    )


def _zones(mission: Mission | None, order_state: OrderState) -> tuple[ZoneReport, ...]:
    if mission is None:
        zones = order_state.order.zones if order_state.order else ()
        return tuple(
            ZoneReport(zone.name, zone.passes) for zone in zones if zone.polygon is not None
        )
    return tuple(
        ZoneReport(zone.name, zone.passes, zone.begun, zone.cells, zone.covered)
        for zone in mission.zone_progress()
    )


def _unreached(mission: Mission | None) -> UnreachedReport:
    if mission is None or mission.lattice is None:
        return UnreachedReport()
    found, cell_m = mission.unreached(), mission.lattice.cell_m
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
    x, y = mission.turn.centre(cell, cell_m)
    return round(x, 3), round(y, 3)
