"""Inbox and mission of a daemon without its bus, disk and planning thread."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from fasaco_edge.bus.claim import ClaimState
from fasaco_edge.bus.latched import Subscription
from fasaco_edge.bus.session import Bus
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.fleet_wing import receiver_of
from fasaco_edge.daemon.ledger.writer import LedgerKeeper, NoDisk
from fasaco_edge.daemon.loop.inbox import CycleInput, Inbox, make_mailbox
from fasaco_edge.daemon.loop.loader import Loader
from fasaco_edge.daemon.loop.mission_runner import MissionRunner
from fasaco_edge.errors import FasacoError
from fasaco_edge.mission.coverage.ledger import LedgerSnapshot
from fasaco_edge.mission.events import CommandReceived, Decision, PlanReady
from fasaco_edge.mission.rooms.room_book import RoomBook
from fasaco_edge.planners.registry import planner_of

LOAD_S = 1.0


@dataclass(frozen=True, slots=True)
class ReplayStep:
    """A replayed cycle of the daemon's loop.

    Attributes:
        at_s: time since the first cycle [s].
        state, reason: state of the mission, and its reason; "loading" before there is a mission.
        changed: whether the state has changed.
        decision: the mission's decision.
        refused: errors of malformed samples.
        as_recorded: whether its path has exactly the points of the recorded path of the same
            revision; None if there is no such path.
    """

    at_s: float
    state: str
    reason: str
    changed: bool
    decision: Decision
    refused: tuple[FasacoError, ...] = ()
    as_recorded: bool | None = None

    @property
    def is_news(self) -> bool:
        """Whether anything was decided, refused, or has changed."""
        decision = self.decision
        asked = decision.plan is not None or decision.path is not None
        return self.changed or asked or bool(decision.faults or self.refused)


class MissionDrive:
    """Feeds samples, commands and plans to a mission as the daemon's loop does.

    Args:
        config: configuration of the daemon.
        ledger: the ledger that the mission begins with; None if nothing was covered.
        rooms: the rooms that it begins with; None without rooms.

    Attributes:
        mission: the mission, for inspection between cycles.
        planner: the planner that the daemon would use.
        mailbox: the daemon's mailbox, without rate limits.
        began: time of the first cycle [s].
        state: state of the mission after the last cycle; "" before it has begun.
    """

    def __init__(
        self,
        config: DaemonConfig,
        ledger: LedgerSnapshot | None = None,
        rooms: RoomBook | None = None,
    ) -> None:
        max_pixels, planner = config.map.max_pixels, config.planner
        self.mailbox = make_mailbox(max_pixels, map_spacing_s=0.0, most_poses=math.inf)
        self._inbox = Inbox(
            _NoBus(),
            config.keys(),
            self.mailbox,
            config.poses(),
            max_pixels,
            fleet=receiver_of(config),
        )
        loader = Loader(config, self.mailbox)
        while (loaded := loader.poll()) is None:
            self.mailbox.take(LOAD_S)
        self.mission, worker = loaded
        worker.close(LOAD_S)
        self.planner = planner_of(planner.name, planner.colony(), planner.threads)
        keeper = LedgerKeeper(NoDisk(ledger), config.cell_m, autostart=config.mission.autostart)
        self._runner = MissionRunner(config, keeper, self.mailbox, lambda *_: loader, rooms)
        self.began: float | None = None
        self.state = ""

    @property
    def is_begun(self) -> bool:
        """Whether the mission has begun; events are held until then."""
        return self._runner.mission is not None

    def cycle(
        self,
        now: float,
        batch: CycleInput,
        commands: Sequence[CommandReceived],
        plans: Sequence[PlanReady],
        *,
        may_begin: bool,
    ) -> ReplayStep:
        """Make one cycle.

        Args:
            now: time of the daemon's steady clock [s].
            batch: samples that the loop takes from its mailbox.
            commands, plans: the other inputs of the cycle.
            may_begin: whether the mission may begin, once there is a map.
        """
        self.began = now if self.began is None else self.began
        events, malformed = self._inbox.decode(batch, has_mission=self.is_begun)
        claim = ClaimState.PLANS if may_begin else ClaimState.WAITS
        mission, events, useless = self._runner.mission_for(events, claim)
        refused = (*malformed, *useless)
        at_s = now - self.began
        if mission is None:
            decision = Decision(answers=self._runner.answer(commands, ""))
            return ReplayStep(at_s, "loading", "", False, decision, refused)
        decision = mission.step([*events, *commands, *plans], now)
        before, self.state = self.state, str(mission.state)
        changed = self.state != before
        return ReplayStep(at_s, self.state, mission.reason, changed, decision, refused)


class _NoBus(Bus):
    """A bus without a session: nothing is received."""

    def __init__(self) -> None:
        pass

    def subscribe(self, *_args: object, **_options: object) -> Subscription:
        return Subscription(None)
