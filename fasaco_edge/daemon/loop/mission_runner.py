"""The mission runner: owner of the mission and its planning thread, from startup to replacement."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from fasaco_edge.bus.mailbox import Mailbox
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.claim import ClaimState
from fasaco_edge.daemon.ledger.writer import LedgerKeeper
from fasaco_edge.daemon.startup import Loader, Startup, map_and_pose_of
from fasaco_edge.errors import FasacoError
from fasaco_edge.mission.core.events import Answer, CommandReceived, Event
from fasaco_edge.mission.orders.order_state import OrderState

if TYPE_CHECKING:
    from fasaco_edge.daemon.loop.worker import PlanningWorker
    from fasaco_edge.mission.core.events import PlanRequest
    from fasaco_edge.mission.core.mission import Mission


class MissionRunner:
    """Starts a mission once there is a map, and replaces it by one that goes on from the ledger.

    Attributes:
        config: the configuration in force.
        mission: the mission; None during startup.
        worker: its planning thread; None during startup.
    """

    def __init__(
        self, config: DaemonConfig, keeper: LedgerKeeper, mailbox: Mailbox[object]
    ) -> None:
        self.config = config
        self.mission: Mission | None = None
        self.worker: PlanningWorker | None = None
        self._keeper = keeper
        self._mailbox = mailbox
        self._startup = Startup(keeper, self._load)

    def _load(self) -> Loader:
        return Loader(self.config, self._mailbox)

    @property
    def assignment(self) -> OrderState:
        """What the mission does, or will do."""
        return self.mission.order_state if self.mission else self._startup.assignment

    @property
    def loading(self) -> str:
        """What startup is loading; "" for nothing."""
        return "" if self.mission else self._startup.stage

    def start(
        self, events: list[Event], claim: ClaimState
    ) -> tuple[Mission | None, list[Event], list[FasacoError]]:
        """Return the mission, once it is loaded and this daemon plans, and the events for it.

        Until then events are held; a new mission gets all of those. The faults are of events
        that are of no use.
        """
        if self.mission is not None:
            return self.mission, events, []
        faults = self._startup.take(events)
        if not claim.is_waiting:
            self._startup.load()
        if claim is ClaimState.PLANS and (loaded := self._startup.loaded()) is not None:
            self.mission, self.worker = loaded
        return self.mission, self._startup.held, faults

    def answer(self, commands: Sequence[CommandReceived], rival: str) -> tuple[Answer, ...]:
        """Take commands during startup; ``rival``: why another daemon takes them, or ""."""
        return tuple(self._startup.answer(commands, rival))

    def held(self) -> Sequence[Event]:
        """Return the events that tell another mission map and pose."""
        return map_and_pose_of(self.mission) if self.mission else self._startup.held

    def restart(self, config: DaemonConfig, held: Sequence[Event]) -> None:
        """Go back to startup, with these events; coverage and order go on from the ledger."""
        if self.mission is not None and self.worker is not None:
            self.worker.disown()
            self._keeper.take_back(self.mission)
        else:
            self._keeper.first = self._startup.assignment
            self._startup.end()
        self.config = config
        self.mission = self.worker = None
        self._startup = Startup(self._keeper, self._load, held)

    def submit(self, request: PlanRequest) -> None:
        """Have a plan made."""
        assert self.worker is not None
        self.worker.submit(request)

    def interrupt(self) -> None:
        """End the search under way, if there is one."""
        if self.worker is not None:
            self.worker.interrupt()

    def close(self, timeout_s: float) -> None:
        """End the planning thread."""
        if self.worker is not None:
            self.worker.close(timeout_s)
