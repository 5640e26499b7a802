"""A mission once more, turn by turn as the recorded daemon took them: the same bit for bit.

The turn log says what the daemon took in in each turn, and when that was; plans are stopped
where they were stopped then. The first turn that ends otherwise is the end of the replay.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from fasaco_edge.bus.arrival import Arrival
from fasaco_edge.bus.session import Sample
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.ledger.codec import decode_ledger
from fasaco_edge.daemon.ledger.writer import LedgerKeeper
from fasaco_edge.daemon.loop.inbox import Inbox, Received, make_mailbox
from fasaco_edge.daemon.loop.turn_log import (
    POSE,
    POSE_BYTES,
    DecisionFilter,
    cells_checksum,
    kernels_name,
)
from fasaco_edge.daemon.startup import Startup
from fasaco_edge.errors import FasacoError
from fasaco_edge.mission.core.events import (
    CommandReceived,
    Decision,
    Event,
    PlanReady,
    PlanRequest,
)
from fasaco_edge.mission.orders.order import read_command
from fasaco_edge.planners.planner import ignore
from fasaco_edge.planners.stopping import StopAt
from fasaco_edge.replay.replay import ReplayStep
from fasaco_edge.replay.stand_ins import NoDisk, SilentBus, load_mission
from fasaco_edge.replay.turn_record import TURNS, TurnRecord, Waiting, told_sample
from fasaco_edge.samples.codec import SampleDecoder
from fasaco_edge.wire.turns import Decided, PlanTaken, Taken, Turn, TurnBatch, decode_turns


@dataclass(frozen=True, slots=True)
class Difference:
    """Something that is not as it was recorded.

    Attributes:
        turn: number of the turn.
        at_s: when, since the first turn [s].
        what: what it is.
        recorded, replayed: what it was and is.
    """

    turn: int
    at_s: float
    what: str
    recorded: object
    replayed: object


class TurnReplay:
    """Plays the turns of a recording to a mission.

    Args:
        config: of the daemon that was.
        record: what its turn log holds.

    Attributes:
        mission: the mission, to be looked at between steps.
        turns: how many were played and ended as recorded.
        plans: how many plans were made, those in spare time among them.
        difference: the first decision that is another one; None as long as there is none.
        kernels: names the compiled kernels in use.
        lacking: samples that are not in the recording, or not as the daemon took them.
    """

    def __init__(self, config: DaemonConfig, record: TurnRecord) -> None:
        self._record = record
        max_pixels = config.map.max_pixels
        mailbox = make_mailbox(max_pixels)
        self._inbox = Inbox(SilentBus(), config.keys(), mailbox, config.poses(), max_pixels)
        self.mission, loader, self._planner = load_mission(config, mailbox)
        cell_m, ledger = config.robot.tool_width_m, record.beginning.ledger
        disk = NoDisk(decode_ledger(ledger, cell_m) if ledger else None)
        keeping = LedgerKeeper(disk, cell_m, autostart=config.mission.autostart)
        self._beginning = Startup(keeping, lambda: loader)
        self._is_begun = False
        self._waiting = Waiting(record.taken)
        self._decoder = SampleDecoder()
        self._told: dict[str, deque[Sample]] = defaultdict(deque)
        self._news = DecisionFilter()
        self._request: PlanRequest | None = None
        self._began: float | None = None
        self._at_s = 0.0
        self._state = ""
        self.turns = self.plans = 0
        self.kernels = kernels_name()
        self.difference: Difference | None = None
        self.lacking: list[Difference] = []

    def steps(self, samples: Iterable[Arrival]) -> Iterator[ReplayStep]:
        """Yield each step of the mission, up to the first that ends otherwise than recorded."""
        # A batch is played when the next has come: its samples are all there by then.
        batch: TurnBatch | None = None
        for arrival in samples:
            if arrival.topic == POSE and len(arrival.sample.payload) <= POSE_BYTES:
                continue  # they are in the log
            if arrival.topic != TURNS:
                self._waiting.add(arrival)
                continue
            if batch is not None:
                yield from self._play(batch)
            if self.difference is not None or self.turns >= self._record.turns:
                return
            batch = decode_turns(arrival.sample.payload)
        if batch is not None:
            yield from self._play(batch)

    def _play(self, batch: TurnBatch) -> Iterator[ReplayStep]:
        told = {turn.number: turn for turn in batch.turns}
        for numbered in self._decoder.samples(batch.told) if batch.told else []:
            self._told[numbered.arrival.topic].append(numbered.arrival.sample)
        for number, now in enumerate(batch.times, batch.first):
            if self.difference is not None or number > self._record.turns:
                return
            self._began = now if self._began is None else self._began
            self._at_s = now - self._began
            turn = told.get(number) or Turn(number, self._is_begun)
            step = self._turn(turn, now)
            self.turns += self.difference is None
            if step is not None:
                yield step

    def _turn(self, turn: Turn, now: float) -> ReplayStep | None:
        items = self._items(turn)
        events, refused = self._inbox.decode(items, turn.patches_lost)
        commands = [
            CommandReceived(number, *read_command(document)) for number, document in turn.commands
        ]
        if not self._is_begun:
            refused += self._beginning.take(events)
            self._is_begun = turn.is_begun and self._beginning.loaded() is not None
            events = self._beginning.held
        if not self._is_begun:
            decision = Decision(answers=tuple(self._beginning.obey(commands)))
            self._compare(turn, self._news.of(decision, None))
            if refused:
                return ReplayStep(self._at_s, "loading", "", False, decision, tuple(refused))
            return None
        return self._step(turn, now, [*events, *commands, *self._plans(turn)], refused)

    def _step(
        self, turn: Turn, now: float, events: list[Event], refused: list[FasacoError]
    ) -> ReplayStep:
        mission = self.mission
        decision = mission.step(events, now)
        if decision.plan is not None:
            self._request = decision.plan
        decided = self._news.of(decision, mission)
        self._compare(turn, decided)
        before, self._state = self._state, str(mission.state)
        path = decided.path if decided else None
        return ReplayStep(
            at_s=self._at_s,
            state=self._state,
            reason=mission.reason,
            changed=self._state != before,
            decision=decision,
            refused=tuple(refused),
            as_recorded=None
            if path is None
            else _facts(turn.decided)["path"] == _facts(decided)["path"],
        )

    def _items(self, turn: Turn) -> list[tuple[str, object]]:
        """Return what the daemon took in, as far as it was recorded."""
        found = [(taken, self._find(turn, taken)) for taken in turn.samples]
        return [
            (taken.topic, Received(sample, taken.at))
            for taken, sample in found
            if sample is not None
        ]

    def _find(self, turn: Turn, taken: Taken) -> Sample | None:
        if taken.told is not None:
            return told_sample(taken.told)
        if not taken.checksum and self._told[taken.topic]:
            return self._told[taken.topic].popleft()
        sample, is_it = self._waiting.find(taken)
        if not is_it:
            recorded = "another one" if sample is not None else "missing in the recording"
            what = f"{taken.topic} with checksum {taken.checksum:08x}"
            self.lacking.append(Difference(turn.number, self._at_s, what, "taken", recorded))
        return sample

    def _plans(self, turn: Turn) -> list[PlanReady]:
        """Return the plan that came back in this turn, made once more."""
        taken, request = turn.plan, self._request
        if taken is None:
            return []
        if request is None or request.number != taken.number:
            asked = None if request is None else request.number
            self._differ(turn, "plan under way", taken.number, asked)
            return []
        self.plans += 1
        path = self._planner.plan(request.problem, StopAt(taken.stops), ignore)
        work = (path.work.ants, path.work.perturbations, path.work.proposals)
        again = PlanTaken(
            taken.number, taken.seconds, taken.stops, work, cells_checksum(path.cells)
        )
        if again != taken:
            self._differ(turn, f"plan {taken.number}", _plan_words(taken), _plan_words(again))
        return [PlanReady(taken.number, path, taken.seconds, tuple(taken.stops))]

    def _compare(self, turn: Turn, decided: Decided | None) -> None:
        # A turn without a decision leaves the state as it is.
        then, now = (_facts(one or Decided(self._state, "")) for one in (turn.decided, decided))
        for name, was in then.items():
            if was != now[name]:
                self._differ(turn, name, was, now[name])
                return

    def _differ(self, turn: Turn, what: str, recorded: object, replayed: object) -> None:
        if self.difference is None:
            self.difference = Difference(turn.number, self._at_s, what, recorded, replayed)


def _facts(decided: Decided | None) -> dict[str, object]:
    """Return what is compared of a decision: all but the reasons, which each release may word."""
    if decided is None:
        return {"path": None}
    asked, path = decided.asked, decided.path
    return {
        "state": decided.state,
        "plan asked for": None if asked is None else asked[0],
        "path": None if path is None else (path[0], path[2]),
        "faults": decided.faults,
        "answers": decided.answers,
    }


def _plan_words(plan: PlanTaken) -> str:
    ants, kicks, proposals = plan.work
    return f"{ants} ants, {kicks} kicks, {proposals} proposals, cells {plan.checksum:08x}"
