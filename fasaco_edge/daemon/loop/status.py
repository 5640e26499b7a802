"""What the daemon says about itself: one JSON document, on change and once a second."""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from fasaco_edge import __version__
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.faults import log_fault
from fasaco_edge.daemon.loop.answers import config_document
from fasaco_edge.daemon.loop.mission_report import mission_report
from fasaco_edge.daemon.loop.watchdog import CycleTimes
from fasaco_edge.errors import FasacoError
from fasaco_edge.host.processes import resident_mb, thread_count
from fasaco_edge.mission.orders.order_state import OrderState

if TYPE_CHECKING:
    from fasaco_edge.grid.geometry import Window
    from fasaco_edge.mission.core.events import PathUpdate
    from fasaco_edge.mission.core.mission import Mission
    from fasaco_edge.planners.path import CoveragePath

LOG = logging.getLogger(__name__)

HEARTBEAT_S = 1.0
# Changes closer together than this go out as one.
LEAST_INTERVAL_S = 0.05


# Of the plan as it was made; the path may have been driven in part since.
PLAN_FIGURES = (
    "planner",
    "seed",
    "ants",
    "kicks",
    "proposals",
    "planned_steps",
    "planned_cost_s",
    "lower_bound_steps",
    "gap",
)


class Faults:
    """Counts what was refused, by code, and logs it."""

    def __init__(self) -> None:
        self._by_code: Counter[str] = Counter()
        self._last = ""

    def count(self, faults: Sequence[FasacoError], *, is_logged: bool = False) -> None:
        """Note refused events, and log them if that is not done already."""
        for fault in faults:
            if not is_logged:
                log_fault(LOG, fault)
            self._by_code[fault.code] += 1
            self._last = str(fault)

    def document(self) -> dict[str, Any]:
        """Return the counts as part of a status."""
        return {
            "total": self._by_code.total(),
            "last": self._last,
            "by_code": dict(self._by_code),
        }


class StatusBoard:
    """Collects what a status says, and knows when one is due.

    Attributes:
        claim: who this daemon is, and whether it plans, as the status has it.
        stands_back: why another daemon plans, and this one does not; "" where it does.
    """

    def __init__(self, config: DaemonConfig) -> None:
        self.faults = Faults()
        self.turns = CycleTimes()
        self.ingest_s: float | None = None
        self.plan_s: float | None = None
        self.map_to_path_s: float | None = None
        self.recorder: dict[str, Any] | None = None
        self.ledger: dict[str, Any] = {}
        self.path: PathUpdate | None = None
        self.waits = "no map yet"
        self.claim: dict[str, str] = {}
        self.stands_back = ""
        self._config = config
        self.show(config)
        self._started = time.monotonic()
        self._sent_at = float("-inf")
        self._sent_key: tuple[Any, ...] = ()

    def show(self, config: DaemonConfig) -> None:
        """Show this configuration as the one in force."""
        self._shown_config = config_document(config)

    def due(
        self, mission: Mission | None, assignment: OrderState, loading: str, now: float
    ) -> dict[str, Any] | None:
        """Return the status if it changed or a second has passed, else None.

        Who waits for another daemon leaves the seconds to that one.
        """
        state, reason = self._state(mission, assignment, loading)
        recorder = (self.recorder or {}).get("state")
        revision = self.path and self.path.revision
        claim = self.claim.get("stand")
        key = (state, reason, revision, recorder, self.ledger.get("fault"), assignment, claim)
        # Many small faults are not worth a message each: the heartbeat counts them.
        heartbeat_s = float("inf") if self.stands_back else HEARTBEAT_S
        wait = LEAST_INTERVAL_S if key != self._sent_key else heartbeat_s
        if now - self._sent_at < wait:
            return None
        self._sent_at, self._sent_key = now, key
        return {
            "robot": self._config.robot.name,
            "version": __version__,
            "state": state,
            "reason": reason,
            "claim": self.claim,
            **self._document(mission, now),
            "mission": mission_report(mission, assignment),
        }

    def report(
        self, mission: Mission | None, assignment: OrderState, loading: str
    ) -> dict[str, Any]:
        """Return what the answer to a command says."""
        state, reason = self._state(mission, assignment, loading)
        return {
            "robot": self._config.robot.name,
            "state": state,
            "reason": reason,
            "coverage": _coverage(mission),
            "mission": mission_report(mission, assignment),
        }

    def _state(
        self, mission: Mission | None, assignment: OrderState, loading: str
    ) -> tuple[str, str]:
        if self.stands_back:
            return "blocked", self.stands_back
        if mission is not None:
            return str(mission.state), mission.reason
        if assignment.order is None:
            return "idle", assignment.why
        if assignment.paused:
            return "paused", "paused by command"
        return ("loading", loading) if loading else ("waiting for map", self.waits)

    def _document(self, mission: Mission | None, now: float) -> dict[str, Any]:
        return {
            "uptime_s": round(now - self._started, 3),
            "map": _map(mission),
            "pose": _pose(mission),
            "coverage": _coverage(mission),
            "path": self._path(mission),
            "plan": {
                "plans": mission.plans if mission else 0,
                "unchanged": mission.unchanged if mission else 0,
                "outdated": mission.outdated if mission else 0,
                "attempts": mission.attempts if mission else 0,
                "planning": bool(mission and mission.planning),
            },
            "latency_ms": {
                "ingest": _ms(self.ingest_s),
                "plan": _ms(self.plan_s),
                "map_to_path": _ms(self.map_to_path_s),
            },
            "loop_ms": self.turns.document(),
            "errors": self.faults.document(),
            "ledger": self.ledger,
            "recorder": self.recorder,
            "rss_mb": resident_mb(),
            "cpu_s": round(time.process_time(), 3),
            "threads": thread_count(),
            "config": self._shown_config,
        }

    def _path(self, mission: Mission | None) -> dict[str, Any] | None:
        update = self.path
        if update is None or mission is None:
            return None
        plan = update.plan
        return {
            "revision": update.revision,
            "steps": max(len(update.cells) - 1, 0),
            "remaining_steps": max(len(mission.path.ahead) - 1, 0),
            "reason": update.reason,
            **plan_figures(plan),
        }


def path_note(mission: Mission, update: PathUpdate) -> dict[str, Any]:
    """Return what is said of a path beside it."""
    assert mission.grid is not None
    assert mission.lattice is not None
    return {
        "revision": update.revision,
        "map_stamp_ns": mission.grid.stamp_ns,
        "map_revision": mission.map_revision,
        "reason": update.reason,
        "steps": max(len(update.cells) - 1, 0),
        **plan_figures(update.plan),
        "plan_ms": round(1e3 * update.plan_s, 3),
        "changed": changed_document(update.changed, mission.lattice.cell_m),
    }


def plan_figures(plan: CoveragePath | None) -> dict[str, Any]:
    """Return what is known of the plan a path follows; each value is null without one."""
    if plan is None:
        return dict.fromkeys(PLAN_FIGURES)
    values = (
        plan.planner,
        plan.seed,
        plan.work.ants,
        plan.work.kicks,
        plan.work.proposals,
        plan.steps,
        round(plan.cost_s, 3),
        plan.lower_bound_steps or None,
        None if plan.gap is None else round(plan.gap, 6),
    )
    return dict(zip(PLAN_FIGURES, values, strict=True))


def changed_document(window: Window | None, cell_m: float) -> dict[str, float] | None:
    """Return where a window of the lattice lies in the map's frame [m]; None without one."""
    if window is None:
        return None
    edges = (window.col0, window.row0, window.col1, window.row1)
    names = ("x_min", "y_min", "x_max", "y_max")
    return {name: round(edge * cell_m, 3) for name, edge in zip(names, edges, strict=True)}


def _map(mission: Mission | None) -> dict[str, Any] | None:
    if mission is None or mission.grid is None:
        return None
    geometry = mission.grid.geometry
    return {
        "rows": geometry.rows,
        "cols": geometry.cols,
        "resolution_m": geometry.resolution,
        "revision": mission.map_revision,
        "stamp_ns": mission.grid.stamp_ns,
        "frame": mission.grid.frame,
    }


def _pose(mission: Mission | None) -> dict[str, float] | None:
    if mission is None or mission.pose is None:
        return None
    pose = mission.pose.pose
    return {"x": round(pose.x, 3), "y": round(pose.y, 3), "yaw": round(pose.yaw, 4)}


def _coverage(mission: Mission | None) -> dict[str, Any] | None:
    coverage = mission.coverage() if mission else None
    if coverage is None:
        return None
    return {
        "coverable": coverage.coverable,
        "covered": coverage.covered,
        "recovered": coverage.recovered,
        "remaining": coverage.remaining,
        "unreachable": coverage.unreachable,
        "covered_m2": round(coverage.covered_m2, 3),
        "to_cover_m2": round(coverage.to_cover_m2, 3),
        "free_out_of_reach_m2": round(coverage.free_out_of_reach_m2, 3),
        "fraction": round(coverage.fraction, 4),
    }


def _ms(seconds: float | None) -> float | None:
    return None if seconds is None else round(1e3 * seconds, 3)
