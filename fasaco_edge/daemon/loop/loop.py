"""The loop: take, decode, step, perform."""

from __future__ import annotations

import gc
import logging
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from fasaco_edge.bus.mailbox import Mailbox
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.counters import MapLatency
from fasaco_edge.daemon.ledger.rooms_file import RoomsKeeper
from fasaco_edge.daemon.ledger.writer import LedgerKeeper
from fasaco_edge.daemon.loop.answers import Commands
from fasaco_edge.daemon.loop.inbox import MAPS, CycleInput, Inbox, take_batch
from fasaco_edge.daemon.loop.mission_runner import MissionRunner
from fasaco_edge.daemon.loop.outbox import Outbox
from fasaco_edge.daemon.loop.periodic import OF_MISSION, RoomsPublisher
from fasaco_edge.daemon.loop.status import StatusBoard
from fasaco_edge.daemon.loop.turn_log import TurnLog
from fasaco_edge.daemon.name_claim import NameClaim
from fasaco_edge.daemon.notify import Watchdog
from fasaco_edge.daemon.reload import Reload
from fasaco_edge.daemon.supervisor import RecorderSupervisor
from fasaco_edge.errors import FasacoError, MissionBroke, PatchWithoutBase
from fasaco_edge.mission.events import Answer, CommandReceived, Decision, Event, PlanReady

if TYPE_CHECKING:
    from fasaco_edge.daemon.fleet_wing import PeriodicMessage
    from fasaco_edge.daemon.metrics import MetricsServer

LOG = logging.getLogger(__name__)

# Longest wait of a cycle for samples [s]: with a mission, and before the first map.
TICK_S, IDLE_TICK_S = 0.1, 0.5
# The frame of messages published before the first map.
DEFAULT_FRAME = "map"
# A mission that fails again within this time [s] failed because of its map.
SOON_S = 60.0


@dataclass(frozen=True, slots=True)
class Ports:
    """The loop's ports on the bus, and services on its computer; None for those not requested."""

    mailbox: Mailbox[object]
    inbox: Inbox
    commands: Commands
    outbox: Outbox
    turns: TurnLog
    claim: NameClaim
    watchdog: Watchdog
    reload: Reload
    fleet: PeriodicMessage | None = None
    recorder: RecorderSupervisor | None = None
    metrics: MetricsServer | None = None


class Loop:
    """Connects bus and mission; everything but planning runs on its thread."""

    def __init__(
        self, config: DaemonConfig, ports: Ports, keeper: LedgerKeeper, rooms: RoomsKeeper
    ) -> None:
        self._ports = ports
        self._keeper, self._rooms = keeper, rooms
        self._runner = MissionRunner(config, keeper, ports.mailbox, rooms=rooms.book)
        self._status = StatusBoard(config)
        self._status.refused = ports.inbox.refused
        self._latency = MapLatency()
        self._begin_messages()
        self._guard = ports.outbox.guard
        self._failed_at = float("-inf")
        self._has_begun = self._is_warm = False

    @property
    def config(self) -> DaemonConfig:
        """The configuration in force."""
        return self._runner.config

    def run(self, stop: threading.Event) -> None:
        """Run cycles until ``stop`` is set."""
        while not stop.is_set():
            if self._follow_claim(time.monotonic()):
                self._begin_reload()
                self._cycle(take_batch(self._ports.mailbox, self._tick_s()))
            else:
                stop.wait(TICK_S)

    def _tick_s(self) -> float:
        runner = self._runner
        is_idle = runner.mission is None and not runner.loading and self._ports.claim.is_settled
        return IDLE_TICK_S if is_idle else TICK_S

    def _cycle(self, batch: CycleInput) -> None:
        taken = time.monotonic()
        if self._ports.reload.is_read and not self._runner.loading:
            self._reload_config(batch)
        now = time.monotonic()
        has_mission = self._runner.mission is not None
        self._ports.inbox.drop_second_publishers(batch, now)
        self._status.conflicts = self._conflicts(now)
        events, faults = self._ports.inbox.decode(batch, has_mission=has_mission)
        self._count_faults(faults)
        self._note(batch)
        commands = self._ports.commands.take(batch.questions, now)
        decision = self._step(events, commands, batch, now)
        turns, mission = self._ports.turns, self._runner.mission
        noted = partial(turns.note, now, batch, commands, decision, mission)
        if not self._guard.attempt("turns", noted):
            turns.end("a batch could not be published")
        self._ports.outbox.commands(commands, decision.answers)
        self._keeper.keep(mission, now)
        # The ledger's order may name rooms by number, so these must not be lost.
        at_once = any(asked.room is not None or asked.command == "start" for asked in commands)
        self._rooms.keep(now, at_once=at_once)
        self._guard.attempt("status", partial(self._publish_status, now))
        if not self._status.yield_reason:
            self._guard.attempt("rooms", partial(self._rooms_out.publish, mission, now))
        self._answer(decision.answers, now)
        ended = time.monotonic()
        self._ports.watchdog.beat(self._runner.worker, ended)
        self._status.turns.note(ended - taken)

    def announce(self) -> None:
        """Publish a first status, so that queries for it are answered from the start."""
        self._publish_status(time.monotonic())

    def close(self, timeout_s: float) -> None:
        """Withdraw the path, flush turn log and ledger, and end the planning thread."""
        self._runner.paths.withdraw("the daemon ends")
        self._send_path()
        self._guard.attempt("turns", self._ports.turns.publish)
        self._keeper.keep(self._runner.mission, float("inf"))
        self._runner.close(timeout_s)

    # Before the step: claim, configuration, and samples that are only noted.

    def _follow_claim(self, now: float) -> bool:
        """Wait while another daemon of this name plans; return whether to run a cycle."""
        claim, mission = self._ports.claim, self._runner.mission
        if claim.update(now):
            self._status.yield_reason = claim.reason if claim.state.is_waiting else ""
            if claim.state.is_waiting:
                self._ports.turns.end(claim.reason)
                if mission is not None:
                    self._restart(claim.reason)
                    self._ports.outbox.forget()
                self._runner.stand_by()
            else:
                self._void_path("this daemon plans from now on")
            claim.announce()
        elif claim.rival_yielded:
            # The robot may have received the other daemon's path after ours.
            self._void_path("another daemon planned, too")
            if mission is not None:
                self._restart("another daemon planned, too")
        elif self._status.yield_reason:
            self._status.yield_reason = claim.reason
        return not claim.is_uncertain(now)

    def _begin_reload(self) -> None:
        """Start to read the configuration again, if requested.

        Maps wait meanwhile, as reading a keep-out mask uses their share of the memory.
        """
        reload, mailbox = self._ports.reload, self._ports.mailbox
        if reload.mask is not None:
            reload.mask.map_frame = self._runner.map_frame
            reload.mask.choose(time.monotonic())
        if reload.is_wanted and not reload.is_reading and not self._runner.loading:
            mailbox.hold()
            reload.begin(self.config, partial(mailbox.post, "reloaded", None))

    def _reload_config(self, batch: CycleInput) -> None:
        """Apply the configuration that was read; restart the mission if it has changed."""
        reload, watchdog = self._ports.reload, self._ports.watchdog
        self._ports.mailbox.release()
        config, faults = reload.take(self.config)
        self._status.faults.count(faults, is_logged=True)
        watchdog.remark = f"configuration refused: {faults[0]}" if faults else ""
        if config != self.config:
            self._restart("the configuration has changed", config)
            batch.plans.clear()  # plans of the previous mission
        reload.done()

    def _restart(
        self, why: str, config: DaemonConfig | None = None, held: Sequence[Event] | None = None
    ) -> None:
        """Let another mission continue from the ledger, as after a restart of the daemon.

        The turn log ends with ``why``. ``held``: the first events; None for the present map and
        pose.
        """
        self._ports.turns.end(why)
        if config is not None:
            self._status.show(config)
        held = self._runner.newest_inputs() if held is None else held
        self._runner.restart(config or self.config, held, why)
        self._send_path()
        self._latency = MapLatency()
        self._begin_messages()

    def _begin_messages(self) -> None:
        """Begin the periodic messages: all are due."""
        outbox, fleet = self._ports.outbox, self._ports.fleet
        self._rooms_out = RoomsPublisher(outbox, self._rooms.book)
        self._periodic = {name: make(outbox) for name, make in OF_MISSION.items()}
        if fleet is not None:
            self._periodic["fleet"] = fleet

    def _count_faults(self, faults: Sequence[FasacoError]) -> None:
        """Count faults; query the map if updates arrived without it."""
        self._status.faults.count(faults)
        if any(isinstance(fault, PatchWithoutBase) for fault in faults):
            self._ports.inbox.ask_for_map(time.monotonic())

    def _conflicts(self, now: float) -> list[str]:
        """Return which inputs come from two publishers."""
        mask = self._ports.reload.mask
        return self._ports.inbox.conflicts(now) + (mask.conflicts(now) if mask else [])

    def _note(self, batch: CycleInput) -> None:
        mission = self._runner.mission
        for plan in batch.plans:
            if isinstance(plan, PlanReady) and not (
                mission and mission.route.requests.is_improving
            ):
                self._status.plan_s = plan.seconds
        maps = [received.at for received in batch.samples if received.kind in MAPS]
        self._latency.arrived = maps[-1] if maps else None

    # The step, and its consequences.

    def _step(
        self, events: list[Event], commands: list[CommandReceived], batch: CycleInput, now: float
    ) -> Decision:
        """Step the mission and perform its decision; during startup, only hold events."""
        mission, events, faults = self._runner.mission_for(events, self._ports.claim.state)
        self._count_faults(faults)
        if mission is None:
            if self.config.mission.waits_for_mask:
                self._status.waits = "no keep-out mask yet"
            self._send_path()  # sends a stop that could not be sent before
            return Decision(answers=self._runner.answer(commands, self._status.yield_reason))
        self._status.waits = "no map yet"
        if not self._has_begun:
            # Modules, kernels and objects of the first plan stay: scanning them for garbage would
            # delay the loop by 80 ms.
            gc.freeze()
            self._has_begun = True
        maps = mission.map.map_revision
        try:
            decision = self._runner.step(mission, [*events, *commands, *batch.plans], now)
        except Exception as error:
            return self._recover(commands, error)
        if mission.map.map_revision > maps:
            self._status.ingest_s = time.monotonic() - now
            if decision.plan is not None or mission.route.requests.wanted:
                self._latency.call_for_plan()
        if mission.route.requests.wanted and mission.route.requests.is_improving:
            self._runner.interrupt()  # a needed plan comes before an improvement
        self._perform(decision)
        for name, message in self._periodic.items():
            self._guard.attempt(name, partial(message.publish, mission, now))
        return decision

    def _perform(self, decision: Decision) -> None:
        self._count_faults(decision.faults)
        self._keeper.note_faults(decision.faults)
        if decision.forgotten:
            self._keeper.forget()
        if decision.plan is not None:
            self._latency.ask()
            self._runner.submit(decision.plan)
        if decision.path is not None and decision.plan is None and decision.path.plan is None:
            self._runner.interrupt()  # the robot had to stop: the plan is for another map
        self._send_path()

    def _recover(self, commands: Sequence[CommandReceived], error: Exception) -> Decision:
        """Stop the robot, and let another mission continue from the ledger.

        Exiting would not help, as a latched map arrives again after a restart. The new mission gets
        the same map; if it fails again soon, the next one waits for another map.
        """
        LOG.exception("mission", extra={"event": "mission_broke"})
        fault = MissionBroke(f"the mission failed: {type(error).__name__}: {error}")
        self._status.faults.count([fault])
        now, failed_at = time.monotonic(), self._failed_at
        self._failed_at = now
        self._status.waits = f"{fault}: waits for another map"
        held = self._runner.newest_inputs() if now - failed_at > SOON_S else []
        self._restart(str(fault), held=held)
        return Decision(answers=tuple(Answer(asked.number, fault) for asked in commands))

    # Publishing.

    def _void_path(self, reason: str) -> None:
        """Replace the path that followers may have from another daemon by an empty one."""
        self._runner.paths.void(reason, self._runner.map_frame or DEFAULT_FRAME)
        self._send_path()

    def _send_path(self) -> None:
        path = self._runner.paths.send(self._ports.outbox.path)
        if path is None or path.plan is None:
            return
        if (seconds := self._latency.answer()) is not None:
            self._status.map_to_path_s = seconds
        if not self._is_warm:
            gc.freeze()
            self._is_warm = True

    def _answer(self, answers: Sequence[Answer], now: float) -> None:
        """Reply to queries; to commands once the ledger has their changes."""
        commands, runner = self._ports.commands, self._runner
        commands.note(answers, now)
        if commands.has_open_queries:
            report = self._status.reply(runner, now)
            now = time.monotonic()
            is_kept = self._keeper.is_kept(now) and self._rooms.is_kept(now)
            self._guard.attempt("@rpc/mission", partial(commands.answer, report, is_kept=is_kept))

    def _publish_status(self, now: float) -> None:
        status, runner = self._status, self._runner
        if self._ports.recorder is not None:
            status.recorder = self._ports.recorder.poll(now)
        status.claim = self._ports.claim.report()
        status.ledger = self._keeper.report(now)
        status.faults.count(self._keeper.take_faults(), is_logged=True)
        status.faults.count(self._rooms.take_faults(), is_logged=True)
        status.faults.count(self._guard.take_faults(), is_logged=True)
        due = status.due(runner, now)
        if due is not None:
            # First, so that the metrics are never older than the published status.
            if self._ports.metrics is not None:
                self._ports.metrics.show(due)
            self._ports.outbox.status(due)
            self._ports.watchdog.show(due)
