"""A mission once more: the samples of a recording through the very same inbox and mission.

Time is what the samples tell, and planning is counted in work, so that the same samples give
the same decisions, bit for bit, on any machine. When the daemon took what into which step, and
how much work its plans had time for, a recording does not tell in full. Each sample gets a
step of its own, and between them are steps as the daemon's clock makes them; a plan that was
recorded gets the work it had then, and comes when it came then. So where a mission went its
usual way, the decisions are those of then.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from fasaco_edge.bus.arrival import Arrival, digest
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.ledger.writer import LedgerKeeper
from fasaco_edge.daemon.loop.batch import Received, make_mailbox, take_batch
from fasaco_edge.daemon.loop.inbox import Inbox
from fasaco_edge.daemon.loop.loop import TICK_S
from fasaco_edge.daemon.startup import Startup
from fasaco_edge.errors import FasacoError
from fasaco_edge.mission.core.events import CommandReceived, Decision, Event, PathUpdate
from fasaco_edge.mission.orders.order import read_command
from fasaco_edge.replay.stand_ins import NoDisk, RecordedRun, ReplayPlanner, SilentBus, load_mission
from fasaco_edge.wire.json_text import decode_json

# How long the mission goes on after the last sample [s]: plans come, patience ends.
TAIL_S = 3.0
# Samples this close together are taken in one step: the daemon's loop needs about as long to
# wake up.
TOGETHER_NS = 1_000_000
COMMAND = "command"


@dataclass(frozen=True, slots=True)
class ReplayStep:
    """A step of the mission.

    Attributes:
        at_s: when, since the first sample [s].
        state, reason: of the mission after it.
        changed: whether the state is another than before.
        decision: what it decided.
        refused: samples in it that were not what they should be.
        as_recorded: of a path, whether it leads over the very points of the one recorded
            under its revision; None where none was.
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


class Replay:
    """Plays samples to a mission.

    Args:
        config: of the daemon to be.
        run: what is known of the daemon that was.
        work: proposals of each plan; None for what was recorded.

    Attributes:
        mission: the mission, to be looked at between steps.
        plans: who plans.
    """

    def __init__(
        self, config: DaemonConfig, run: RecordedRun | None = None, work: int | None = None
    ) -> None:
        self._run = run or RecordedRun()
        self._mailbox = make_mailbox(config.map.max_pixels, map_spacing_s=0.0)
        bus = SilentBus()
        self._inbox = Inbox(
            bus, config.keys(), self._mailbox, config.poses(), config.map.max_pixels
        )
        self._heard = {*bus.heard, COMMAND}
        self.mission, loader, planner = load_mission(config, self._mailbox)
        self.plans = ReplayPlanner(planner, self._run, config.planner.budget_s, work)
        keeping = LedgerKeeper(
            NoDisk(), config.robot.tool_width_m, autostart=config.mission.autostart
        )
        self._startup = Startup(keeping, lambda: loader)
        self._is_begun = False
        self._commands = 0
        self._state = ""
        self._began = self._now = 0.0
        self._base_ns = 0

    def steps(self, samples: Iterable[Arrival]) -> Iterator[ReplayStep]:
        """Yield each step of the mission; samples of other topics than it hears are ignored."""
        first: Arrival | None = None
        together: list[Arrival] = []
        for arrival in samples:
            if first is None:
                first, self._base_ns = arrival, arrival.at_ns - arrival.wall_ns
                self._began = self._now = 1e-9 * arrival.at_ns
            if arrival.topic not in self._heard:
                continue
            if together and arrival.wall_ns - together[0].wall_ns > TOGETHER_NS:
                yield from self._take(together)
                together = []
            together.append(arrival)
        if together:
            yield from self._take(together)
        yield from self._wait(self._now + TAIL_S)

    def _take(self, arrivals: list[Arrival]) -> Iterator[ReplayStep]:
        """Take samples in one step, after those that come before it."""
        # By the wall clock, which goes on where the machine was started again.
        now = max(1e-9 * (arrivals[0].wall_ns + self._base_ns), self._now)
        yield from self._wait(now)
        yield from self._turn(now, arrivals)

    def _wait(self, until: float) -> Iterator[ReplayStep]:
        """Take the steps that come without a sample."""
        while True:
            due = self.plans.due
            tick = self._now + TICK_S
            now = tick if due is None else min(tick, max(due, self._now))
            if now >= until:
                return
            yield from self._turn(now)

    def _turn(self, now: float, arrivals: Sequence[Arrival] = ()) -> Iterator[ReplayStep]:
        self._now = now
        for arrival in arrivals:
            if arrival.topic != COMMAND:
                self._mailbox.post(arrival.topic, Received(arrival.topic, arrival.sample, now))
        events, refused = self._inbox.decode(take_batch(self._mailbox, 0.0))
        commands = self._read_commands(arrivals, refused)
        if not self._is_begun:
            refused += self._startup.take(events)
            self._is_begun = self._is_ready() and self._startup.loaded() is not None
            events = self._startup.held
        if self._is_begun:
            yield self._step([*events, *commands, *self.plans.take(now)], tuple(refused))
            return
        self._startup.answer(commands)
        if refused:
            yield ReplayStep(now - self._began, "loading", "", False, Decision(), tuple(refused))

    def _is_ready(self) -> bool:
        """Tell whether the recorded daemon had begun its mission by now."""
        ready_ns = self._run.ready_ns
        return ready_ns is None or self._now >= 1e-9 * ready_ns

    def _read_commands(
        self, arrivals: Sequence[Arrival], refused: list[FasacoError]
    ) -> list[CommandReceived]:
        """Return the commands that the recorded daemon had taken; what is none is refused."""
        commands = []
        for arrival in arrivals:
            if arrival.topic != COMMAND:
                continue
            try:
                name, order = read_command(decode_json(arrival.sample.payload))
            except FasacoError as error:
                refused.append(error)
                continue
            self._commands += 1
            commands.append(CommandReceived(self._commands, name, order))
        return commands

    def _step(self, events: list[Event], refused: tuple[FasacoError, ...]) -> ReplayStep:
        mission = self.mission
        decision = mission.step(events, self._now)
        if decision.plan is not None:
            self.plans.ask(decision.plan, mission.route.revision + 1, self._now)
        before, self._state = self._state, str(mission.state)
        return ReplayStep(
            at_s=self._now - self._began,
            state=self._state,
            reason=mission.reason,
            changed=self._state != before,
            decision=decision,
            refused=refused,
            as_recorded=None if decision.path is None else self._as_recorded(decision.path),
        )

    def _as_recorded(self, update: PathUpdate) -> bool | None:
        recorded = self._run.paths.get(update.revision)
        mission = self.mission
        if recorded is None or mission.lattice is None:
            return None
        return digest(mission.lattice.centres(update.cells).tobytes()) == recorded.digest
