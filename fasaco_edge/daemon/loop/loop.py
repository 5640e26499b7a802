"""The loop: take, decode, step, perform."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, cast

from fasaco_edge.bus.mailbox import Mailbox
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.claim import ClaimState, NameClaim
from fasaco_edge.daemon.ledger.writer import LedgerKeeper, LedgerWriter
from fasaco_edge.daemon.loop.commands import Commands
from fasaco_edge.daemon.loop.inbox import Inbox, Received
from fasaco_edge.daemon.loop.outbox import CoveragePublisher, Outbox
from fasaco_edge.daemon.loop.status import StatusBoard, path_attachment
from fasaco_edge.daemon.loop.turn_log import TurnLog, TurnNote
from fasaco_edge.daemon.loop.watchdog import MapLatency, Watchdog
from fasaco_edge.daemon.reload import Reload
from fasaco_edge.daemon.startup import Loader, Startup, map_and_pose_of
from fasaco_edge.daemon.supervisor import RecorderSupervisor
from fasaco_edge.errors import BadConfiguration, FasacoError, MissionBroke, PatchWithoutBase
from fasaco_edge.mission.core.events import (
    Answer,
    CommandReceived,
    Decision,
    Event,
    PathUpdate,
    PlanBroken,
    PlanReady,
)
from fasaco_edge.mission.orders.order_state import OrderState

if TYPE_CHECKING:
    from fasaco_edge.daemon.loop.worker import PlanningWorker, PlanSnapshot
    from fasaco_edge.mission.core.mission import Mission

LOG = logging.getLogger(__name__)

TICK_S = 0.1
# A mission that breaks again within so long broke on the map it has [s].
SOON_S = 60.0


class Loop:
    """Joins the bus to the mission; everything but planning happens on its thread.

    Attributes:
        config: the configuration in force.
    """

    def __init__(
        self,
        config: DaemonConfig,
        mailbox: Mailbox[object],
        inbox: Inbox,
        commands: Commands,
        outbox: Outbox,
        ledger: LedgerWriter,
        recorder: RecorderSupervisor | None,
        turns: TurnLog,
        vitals: Watchdog,
        reload: Reload,
        claim: NameClaim,
    ) -> None:
        self.config = config
        self._mailbox = mailbox
        self._inbox = inbox
        self._commands = commands
        self._outbox = outbox
        self._ledger = ledger
        self._keeping = LedgerKeeper(
            ledger, config.robot.tool_width_m, autostart=config.mission.autostart
        )
        self._beginning = Startup(self._keeping, self._load)
        self._recorder = recorder
        self._turns = turns
        self._vitals = vitals
        self._reload = reload
        self._claim = claim
        self._status = StatusBoard(config)
        self._mission: Mission | None = None
        self._worker: PlanningWorker | None = None
        self._maps = MapLatency()
        self._coverage = CoveragePublisher(outbox)
        self._gate = outbox.gate
        self._broke_at = float("-inf")
        if self._keeping.fault is not None:
            self._status.faults.count([self._keeping.fault])

    def run(self, stop: threading.Event) -> None:
        """Turn until ``stop`` is set."""
        while not stop.is_set():
            if not self._heed_claim(time.monotonic()):
                stop.wait(TICK_S)
                continue
            items = self._mailbox.take(TICK_S)
            taken = time.monotonic()
            if self._reload.asked.is_set() and not self._loading:
                items = self._reload_config(items)
            started = time.monotonic()
            lost = self._mailbox.take_lost("map_update")
            events, faults = self._inbox.decode(items, lost)
            self._refuse(faults)
            self._note(items)
            commands = self._commands.take(items, started)
            mission = self._mission or self._begin(events)
            if mission is not None:
                decision = self._turn(mission, [*events, *commands, *_plans(items)], started)
            else:
                rival = self._status.stands_back
                decision = Decision(answers=tuple(self._beginning.obey(commands, rival)))
            answers = decision.answers
            note = TurnNote(started, items, lost, commands, decision)
            if not self._gate.let_out("turns", partial(self._turns.note, note, self._mission)):
                self._turns.end("a batch could not be published")
            self._outbox.commands(commands, answers)
            self._keeping.keep(self._mission, self._assignment, started)
            self._gate.let_out("status", partial(self._publish_status, started))
            self._commands.note(answers, started)
            if self._commands.are_asked:
                report = self._status.reply(self._mission, self._assignment, self._loading)
                is_kept = self._keeping.is_kept(time.monotonic())
                self._gate.let_out(
                    "@rpc/mission", partial(self._commands.answer, report, is_kept=is_kept)
                )
            ended = time.monotonic()
            self._vitals.beat(self._worker, ended)
            self._status.turns.note(ended - taken)

    @property
    def _assignment(self) -> OrderState:
        return self._mission.order_state if self._mission else self._beginning.assignment

    @property
    def _loading(self) -> str:
        return "" if self._mission else self._beginning.stage

    def _load(self) -> Loader:
        return Loader(self.config, self._mailbox)

    def _reload_config(self, items: list[tuple[str, object]]) -> list[tuple[str, object]]:
        """Read the configuration again; return what of ``items`` still counts then."""
        try:
            config = self._reload.read(self.config)
        except BadConfiguration as error:
            self._status.faults.count([error], is_logged=True)
            self._vitals.remark = f"configuration refused: {error}"
        else:
            self._vitals.remark = ""
            if config != self.config:
                self._go_on_with(config, "the configuration has changed")
                items = [(kind, item) for kind, item in items if kind != "plan"]
        self._reload.done()
        return items

    def _heed_claim(self, now: float) -> bool:
        """Wait while another daemon of this name plans; tell whether to make a cycle."""
        claim, mission = self._claim, self._mission
        if claim.look(now):
            self._status.stands_back = claim.reason if claim.waits else ""
            if claim.waits:
                self._turns.end(claim.reason)
                if mission is not None:
                    self._let_stand(mission, claim.reason)
                    self._outbox.forget()
                    self._go_on_with(self.config, claim.reason)
            claim.show()
        elif claim.hears_of_yielding and mission is not None:
            # The robot may have heard the other last, and that was to stand.
            self._go_on_with(self.config, "another daemon planned, too")
        elif self._status.stands_back:
            self._status.stands_back = claim.reason
        return not claim.doubts(now)

    def _go_on_with(self, config: DaemonConfig, why: str) -> None:
        """Let another mission go on from the ledger, as after a restart."""
        self.config = config
        self._status.show(config)
        held = map_and_pose_of(self._mission) if self._mission is not None else self._beginning.held
        self._begin_again(why, held)

    def _begin_again(self, why: str, held: Sequence[Event]) -> None:
        """Let another mission go on from the ledger, with what is to be heard first."""
        self._turns.end(why)
        if self._mission is not None and self._worker is not None:
            self._worker.disown()
            self._keeping.take_back(self._mission)
        else:
            self._keeping.first = self._beginning.assignment
            self._beginning.end()
        self._mission = self._worker = None
        self._maps = MapLatency()
        self._beginning = Startup(self._keeping, self._load, held)
        self._coverage.forget()

    def _begin(self, events: list[Event]) -> Mission | None:
        """Hold ``events`` until there is a mission; once it is there, they are all that was."""
        self._refuse(self._beginning.take(events))
        if self._claim.waits:
            return None
        self._beginning.load()
        loaded = self._beginning.loaded() if self._claim.stand is ClaimState.PLANS else None
        if loaded is None:
            return None
        self._mission, self._worker = loaded
        self._status.waits = "no map yet"
        events[:] = self._beginning.held
        return self._mission

    def _turn(self, mission: Mission, events: list[Event], started: float) -> Decision:
        """Step the mission, do what it decides, and return that."""
        maps = mission.map_revision
        try:
            decision = mission.step(events, started)
        except Exception as error:
            return self._break_off(mission, events, error)
        if mission.map_revision > maps:
            self._status.ingest_s = time.monotonic() - started
            if decision.plan is not None or mission.wants_plan:
                self._maps.call_for_plan()
        if mission.wants_plan and mission.is_improving and self._worker is not None:
            self._worker.interrupt()  # what is needed comes before what is only better
        self._perform(mission, decision)
        self._gate.let_out("coverage", partial(self._coverage.publish, mission, started))
        return decision

    def _break_off(self, mission: Mission, events: list[Event], error: Exception) -> Decision:
        """Stop the robot, and let another mission go on from the ledger.

        To end here would help nobody: a latched map comes again after a restart. It gets a
        second chance; a mission that breaks soon again goes on without it, with the next one.
        """
        LOG.exception("mission", extra={"event": "mission_broke"})
        fault = MissionBroke(f"the mission broke off: {type(error).__name__}: {error}")
        self._status.faults.count([fault])
        now, broke_at = time.monotonic(), self._broke_at
        self._broke_at = now
        held = map_and_pose_of(mission) if now - broke_at > SOON_S else []
        self._status.waits = f"{fault}: waits for another map"
        self._let_stand(mission, str(fault))
        self._begin_again("the mission broke off", held)
        return Decision(
            answers=tuple(
                Answer(event.number, fault)
                for event in events
                if isinstance(event, CommandReceived)
            )
        )

    def _let_stand(self, mission: Mission, reason: str) -> None:
        """Take back the path of a mission that goes no further."""
        if mission.grid is not None and mission.lattice is not None and len(mission.path.cells):
            stop = PathUpdate(mission.revision + 1, mission.path.cells[:0], reason)
            self._publish_path(mission, stop)

    def announce(self) -> None:
        """Publish a first status, so that who asks gets one from the beginning."""
        self._publish_status(time.monotonic())

    def close(self, timeout_s: float) -> None:
        """Hand over what turn log and ledger hold, and end the planning thread."""
        self._gate.let_out("turns", self._turns.publish)
        self._keeping.keep(self._mission, self._assignment, float("inf"))
        if self._worker is not None:
            self._worker.close(timeout_s)

    def _note(self, items: list[tuple[str, object]]) -> None:
        """Take what is not the mission's: snapshots, the recorder's word, failures."""
        self._maps.arrived = None
        for kind, item in items:
            if kind == "snapshot":
                self._publish_snapshot(cast("PlanSnapshot", item))
            elif isinstance(item, BaseException):
                raise item
            elif isinstance(item, PlanReady):
                if not (self._mission and self._mission.is_improving):
                    self._status.plan_s = item.seconds
            elif kind in ("map", "map_update") and isinstance(item, Received):
                self._maps.arrived = item.at

    def _perform(self, mission: Mission, decision: Decision) -> None:
        self._refuse(decision.faults)
        self._keeping.note_faults(decision.faults)
        if decision.forgotten:
            self._keeping.forget()
        if decision.plan is not None and self._worker is not None:
            self._maps.ask()
            self._worker.submit(decision.plan)
        if decision.path is not None:
            if decision.plan is None and decision.path.plan is None and self._worker is not None:
                self._worker.interrupt()  # the robot had to stop: its plan is for another map
            self._publish_path(mission, decision.path)

    def _refuse(self, faults: Sequence[FasacoError]) -> None:
        """Count what was refused; ask for the map that updates lack."""
        self._status.faults.count(faults)
        if any(isinstance(fault, PatchWithoutBase) for fault in faults):
            self._inbox.ask_for_map(time.monotonic())

    def _publish_path(self, mission: Mission, update: PathUpdate) -> None:
        assert mission.grid is not None
        assert mission.lattice is not None
        xy = mission.lattice.centres(update.cells)
        about = path_attachment(mission, update)
        self._outbox.path(xy, mission.grid.frame, mission.grid.stamp_ns, about)
        self._status.path = update
        if update.plan is not None and (seconds := self._maps.answer()) is not None:
            self._status.map_to_path_s = seconds

    def _publish_snapshot(self, seen: PlanSnapshot) -> None:
        mission = self._mission
        frame = mission.grid.frame if mission and mission.grid else "map"
        self._outbox.pheromone(seen, frame)

    def _publish_status(self, now: float) -> None:
        if self._recorder is not None:
            self._status.recorder = self._recorder.poll(now)
        self._status.claim = self._claim.report()
        self._status.ledger = self._ledger.report(now)
        self._status.faults.count(self._ledger.take_faults(), is_logged=True)
        self._status.faults.count(self._gate.take_faults(), is_logged=True)
        status = self._status.due(self._mission, self._assignment, self._loading, now)
        if status is not None:
            self._outbox.status(status)
            self._vitals.tell(status)


def _plans(items: list[tuple[str, object]]) -> list[Event]:
    return [item for _, item in items if isinstance(item, PlanReady | PlanBroken)]
