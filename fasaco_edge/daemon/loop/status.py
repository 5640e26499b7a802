"""The daemon's status: one JSON document, published on change and once a second.

``mission_reports`` makes the mission's parts of it.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import TYPE_CHECKING

from msgspec.structs import replace

from fasaco_edge import __version__
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.counters import CycleTimes, FaultCounter
from fasaco_edge.daemon.fleet_wing import report_of
from fasaco_edge.daemon.loop.answers import config_document
from fasaco_edge.daemon.loop.mission_reports import (
    ahead_s,
    battery_report,
    coverage_report,
    drive_report,
    floor_report,
    map_report,
    mission_report,
    plan_counts,
    pose_report,
    trouble_reports,
)
from fasaco_edge.host.processes import resident_mb, thread_count
from fasaco_edge.wire.documents.path_documents import PathReport
from fasaco_edge.wire.documents.replies import Reply, TroubleReport
from fasaco_edge.wire.documents.status import (
    ClaimReport,
    Latencies,
    LedgerReport,
    Status,
    SupervisedRecorder,
)

if TYPE_CHECKING:
    from fasaco_edge.daemon.loop.mission_runner import MissionRunner
    from fasaco_edge.mission.core.mission import Mission
    from fasaco_edge.mission.core.path_exit import PublishedPath

HEARTBEAT_S = 1.0
# Time after which a mission that has not begun is a trouble [s].
BEGUN_S = 30.0
# Kind of the samples that a state or a trouble lacks.
LACKING = {
    "waiting for map": "map",
    "waiting for pose": "pose",
    "no_map": "map",
    "no_pose": "pose",
    "no_battery": "battery",
}
# What to do about troubles that are not the mission's.
TO_DO = {
    "two_publishers": "stop one of the two",
    "no_effect": "check their unit, sign and origin; a map that still grows may reach them",
}
# Least time between two messages [s]; closer changes are sent as one.
LEAST_INTERVAL_S = 0.05


class StatusBoard:
    """Collects the content of a status, and decides when one is due.

    Attributes:
        claim: id of this daemon and whether it plans, as in the status.
        yield_reason: reason why another daemon plans instead; "" if this one plans.
        conflicts: texts on inputs with two publishers.
        refused: why the newest sample of a kind was refused, by kind.
    """

    def __init__(self, config: DaemonConfig) -> None:
        self.faults = FaultCounter()
        self.turns = CycleTimes()
        self.ingest_s: float | None = None
        self.plan_s: float | None = None
        self.map_to_path_s: float | None = None
        self.recorder: SupervisedRecorder | None = None
        self.ledger = LedgerReport()
        self.waits = "no map yet"
        self.claim = ClaimReport()
        self.yield_reason = ""
        self.conflicts: list[str] = []
        self.refused: Mapping[str, str] = {}
        self._config = config
        self.show(config)
        self._started = time.monotonic()
        self._sent_at = float("-inf")
        self._sent_key: tuple[object, ...] = ()
        # Since when there is neither a mission nor its loading [s]; else None.
        self._unbegun_at: float | None = None
        self._since: dict[str, float] = {}

    def show(self, config: DaemonConfig) -> None:
        """Show this configuration as the one in force."""
        self._shown_config = config_document(config)
        self._cost = config.robot.cost()
        self._configured_keep_outs = len(config.mission.keep_out) + bool(
            config.mission.keep_out_mask
        )

    def due(self, runner: MissionRunner, now: float) -> Status | None:
        """Return the status if it changed or a second has passed, else None.

        A daemon that waits for another daemon sends no heartbeat.
        """
        mission, order_state = runner.mission, runner.order_state
        state, reason = self._state(runner)
        recorder = self.recorder and self.recorder.state
        path = runner.paths.newest
        revision = path and path.revision
        claim = self.claim.stand
        troubles = self._troubles(runner, now)
        faults = (*(each.code for each in troubles), self.ledger.fault)
        key = (state, reason, revision, recorder, faults, order_state, claim)
        # A new fault sends no message of its own, as the heartbeat has the count of faults.
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
            map=map_report(mission),
            pose=pose_report(mission),
            coverage=coverage_report(mission),
            floor=floor_report(mission),
            path=path_report(path, mission),
            plan=plan_counts(mission),
            latency_ms=Latencies(_ms(self.ingest_s), _ms(self.plan_s), _ms(self.map_to_path_s)),
            loop_ms=self.turns.report(),
            drive=drive_report(mission, self._cost),
            battery=battery_report(mission, now),
            errors=self.faults.counts(),
            ledger=self.ledger,
            recorder=self.recorder,
            rss_mb=resident_mb(),
            cpu_s=round(time.process_time(), 3),
            threads=thread_count(),
            config=self._shown_config,
            mission=mission_report(mission, order_state, self._configured_keep_outs),
            fleet=report_of(self._config, mission, now),
            troubles=troubles,
        )

    def reply(self, runner: MissionRunner, now: float) -> Reply:
        """Return the reply to a command."""
        state, reason = self._state(runner)
        return Reply(
            robot=self._config.robot.name,
            state=state,
            reason=reason,
            coverage=coverage_report(runner.mission),
            floor=floor_report(runner.mission),
            mission=mission_report(runner.mission, runner.order_state, self._configured_keep_outs),
            troubles=self._troubles(runner, now),
        )

    def _state(self, runner: MissionRunner) -> tuple[str, str]:
        if self.yield_reason:
            return "blocked", self.yield_reason
        if (mission := runner.mission) is not None:
            return str(mission.state), self._why(mission.state, mission.reason)
        order_state, loading = runner.order_state, runner.loading
        if order_state.paused:
            return "paused", order_state.why_paused
        if order_state.order is None:
            return "idle", order_state.why
        return ("loading", loading) if loading else ("waiting for map", self._why_not_begun)

    @property
    def _why_not_begun(self) -> str:
        return self._why("waiting for map", self.waits)

    def _why(self, lacks: str, text: str) -> str:
        """Return why a state or trouble lasts; also why the newest input it lacks was refused."""
        kind = LACKING.get(lacks, "")
        why = self.refused.get(kind)
        return f"{text}; the newest {kind} was refused: {why}" if why else text

    def _troubles(self, runner: MissionRunner, now: float) -> tuple[TroubleReport, ...]:
        """Return all troubles; only those of the mission itself make it degraded."""
        own = self._of_mission(runner, now)
        if self.yield_reason:
            return own
        idle = runner.mission.idle_places(now) if runner.mission else ""
        texts = {"two_publishers": "; ".join(self.conflicts), "no_effect": idle}
        # Time at which each trouble began [s].
        self._since = {code: self._since.get(code, now) for code, text in texts.items() if text}
        return own + tuple(
            TroubleReport(code, texts[code], TO_DO[code], round(now - since, 1))
            for code, since in self._since.items()
        )

    def _of_mission(self, runner: MissionRunner, now: float) -> tuple[TroubleReport, ...]:
        is_unbegun = runner.mission is None and not runner.loading and not self.yield_reason
        if not is_unbegun or runner.order_state.order is None:
            self._unbegun_at = None
            # The mission of a daemon that yields takes no more inputs.
            ran = None if self.yield_reason else runner.mission
            reports = trouble_reports(ran, now) if ran is not None else ()
            return tuple(replace(each, text=self._why(each.code, each.text)) for each in reports)
        self._unbegun_at = now if self._unbegun_at is None else self._unbegun_at
        since_s = round(now - self._unbegun_at - BEGUN_S, 1)
        text, to_do = (
            f"the mission cannot begin: {self._why_not_begun}",
            "publish what it waits for",
        )
        return (TroubleReport("not_begun", text, to_do, since_s),) if since_s >= 0.0 else ()


def path_report(path: PublishedPath | None, mission: Mission | None) -> PathReport | None:
    """Return the path's part of the status; None before the first path of a mission."""
    if path is None or not path.revision or mission is None:
        return None
    line = mission.line.ahead()
    gap = None if line is None else line.gap
    return replace(
        PathReport.of(path.plan),
        revision=path.revision,
        steps=path.steps,
        # The mission may hold back a longer path until the robot comes near its change.
        remaining_steps=min(max(len(mission.route.path.ahead) - 1, 0), path.steps),
        line_s=round(ahead_s(mission), 1),
        line_gap=None if gap is None else round(gap, 4),
        reason=path.reason,
    )


def _ms(seconds: float | None) -> float | None:
    return None if seconds is None else round(1e3 * seconds, 3)
