"""The loop: take, decode, step, perform."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING, Any

from fasaco_edge.bus.mailbox import Mailbox
from fasaco_edge.daemon.config import DaemonConfig
from fasaco_edge.daemon.inbox import Inbox, Received
from fasaco_edge.daemon.loading import Loader
from fasaco_edge.daemon.outbox import Outbox
from fasaco_edge.daemon.status import StatusBoard, plan_figures
from fasaco_edge.daemon.supervisor import RecorderSupervisor
from fasaco_edge.errors import FasacoError, PatchWithoutBase
from fasaco_edge.mission.events import (
    Decision,
    Event,
    MapReceived,
    PathUpdate,
    PlanReady,
    PoseReceived,
)
from fasaco_edge.planners.observation import ColonySnapshot
from fasaco_edge.wire.coverage import coverage_grid

if TYPE_CHECKING:
    from fasaco_edge.daemon.worker import PlanningWorker
    from fasaco_edge.mission.mission import Mission

TICK_S = 0.1
COVERAGE_PERIOD_S = 0.5


class Loop:
    """Joins the bus to the mission; everything but planning happens on its thread."""

    def __init__(
        self,
        config: DaemonConfig,
        mailbox: Mailbox[object],
        inbox: Inbox,
        outbox: Outbox,
        recorder: RecorderSupervisor | None,
    ) -> None:
        self._config = config
        self._mailbox = mailbox
        self._inbox = inbox
        self._outbox = outbox
        self._recorder = recorder
        self._status = StatusBoard(config)
        self._loader: Loader | None = None
        self._mission: Mission | None = None
        self._worker: PlanningWorker | None = None
        self._held: list[Event] = []
        self._map_arrived: float | None = None
        # Arrival of the oldest map that no plan was asked for yet, and of the one
        # that the plan under way was asked for.
        self._unanswered_map: float | None = None
        self._asked_map: float | None = None
        self._coverage_at = float("-inf")
        self._coverage_key: tuple[int, int] = (0, 0)

    def run(self, stop: threading.Event) -> None:
        """Turn until ``stop`` is set."""
        while not stop.is_set():
            items = self._mailbox.take(TICK_S)
            started = time.monotonic()
            events, faults = self._inbox.decode(items, self._mailbox.take_lost("map_update"))
            self._status.faults.count(faults)
            self._note(items)
            mission = self._mission or self._load(events)
            if mission is not None:
                self._turn(mission, [*self._held, *events, *_plans(items)], started)
            self._publish_status(started)

    def _turn(self, mission: Mission, events: list[Event], started: float) -> None:
        """Step the mission and do what it decides."""
        self._held.clear()
        maps = mission.map_revision
        decision = mission.step(events, started)
        if mission.map_revision > maps:
            self._status.ingest_s = time.monotonic() - started
            if decision.plan is not None or mission.wants_plan:
                self._unanswered_map = self._unanswered_map or self._map_arrived
        try:
            self._perform(mission, decision)
            self._publish_coverage(mission, started)
        except FasacoError as error:
            # What cannot be said in the protocol's limits costs this message alone.
            self._status.faults.count([error])

    def announce(self) -> None:
        """Publish a first status, so that who asks gets one from the beginning."""
        self._publish_status(time.monotonic())

    def close(self, timeout_s: float) -> None:
        """End the planning thread."""
        if self._worker is not None:
            self._worker.close(timeout_s)

    def _note(self, items: list[tuple[str, object]]) -> None:
        """Take what is not the mission's: snapshots, the recorder's word, failures."""
        self._map_arrived = None
        for kind, item in items:
            if isinstance(item, ColonySnapshot):
                self._publish_snapshot(item)
            elif isinstance(item, BaseException):
                raise item
            elif isinstance(item, PlanReady):
                self._status.plan_s = item.seconds
            elif kind in ("map", "map_update") and isinstance(item, Received):
                self._map_arrived = item.at

    def _load(self, events: list[Event]) -> Mission | None:
        """Hold events until the kernels are there; the first map sends for them."""
        for event in events:
            self._hold(event)
        if self._loader is None:
            if any(isinstance(event, MapReceived) for event in events):
                self._loader = Loader(self._config, self._mailbox, self._outbox.is_watched)
            return None
        loaded = self._loader.poll()
        if loaded is not None:
            self._mission, self._worker = loaded
        events.clear()
        return self._mission

    def _hold(self, event: Event) -> None:
        """Keep the newest map with the updates after it, and the newest pose."""
        match event:
            case MapReceived():
                self._held = [held for held in self._held if isinstance(held, PoseReceived)]
            case PoseReceived():
                self._held = [held for held in self._held if not isinstance(held, PoseReceived)]
            case _ if not any(isinstance(held, MapReceived) for held in self._held):
                why = "map update refused: there is no map yet"
                self._status.faults.count([PatchWithoutBase(why)])
                return
        self._held.append(event)

    def _perform(self, mission: Mission, decision: Decision) -> None:
        self._status.faults.count(decision.faults)
        if decision.plan is not None and self._worker is not None:
            self._asked_map, self._unanswered_map = self._unanswered_map, None
            self._worker.submit(decision.plan)
        if decision.path is not None:
            if decision.plan is None and decision.path.plan is None and self._worker is not None:
                self._worker.interrupt()  # the robot had to stop: its plan is for another map
            self._publish_path(mission, decision.path)

    def _publish_path(self, mission: Mission, update: PathUpdate) -> None:
        assert mission.grid is not None
        assert mission.lattice is not None
        plan = update.plan
        about: dict[str, Any] = {
            "revision": update.revision,
            "map_stamp_ns": mission.grid.stamp_ns,
            "map_revision": mission.map_revision,
            "reason": update.reason,
            "steps": max(len(update.cells) - 1, 0),
            **plan_figures(plan),
            "plan_ms": round(1e3 * update.plan_s, 3),
        }
        xy = mission.lattice.centres(update.cells)
        self._outbox.path(xy, mission.grid.frame, mission.grid.stamp_ns, about)
        self._status.path = update
        if plan is not None and self._asked_map is not None:
            self._status.map_to_path_s = time.monotonic() - self._asked_map

    def _publish_coverage(self, mission: Mission, now: float) -> None:
        key = (mission.ledger.total, mission.map_revision)
        if key == self._coverage_key or now - self._coverage_at < COVERAGE_PERIOD_S:
            return
        if mission.lattice is None or mission.grid is None:
            return
        self._coverage_at, self._coverage_key = now, key
        lattice = mission.lattice
        visits = mission.ledger.visits(lattice.window)
        grid = mission.grid
        self._outbox.coverage(
            coverage_grid(
                lattice.window, lattice.cell_m, lattice.states, visits, grid.frame, grid.stamp_ns
            )
        )

    def _publish_snapshot(self, snapshot: ColonySnapshot) -> None:
        mission = self._mission
        frame = mission.grid.frame if mission and mission.grid else "map"
        self._outbox.pheromone(snapshot, frame)

    def _publish_status(self, now: float) -> None:
        if self._recorder is not None:
            self._status.recorder = self._recorder.poll(now)
        loading = self._loader.stage if self._loader and not self._mission else ""
        document = self._status.due(self._mission, loading, now)
        if document is not None:
            self._outbox.status(document)


def _plans(items: list[tuple[str, object]]) -> list[Event]:
    return [item for _, item in items if isinstance(item, PlanReady)]
