"""Replay by cycles of the recorded daemon's loop: the same decisions, bit for bit.

The turn log has the inputs of each cycle of the daemon's loop, with times. Plans stop at the same
stop checks as in the recording. The replay ends at the first cycle with a different decision.
"""

from __future__ import annotations

import zlib
from collections import defaultdict, deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.ledger.codec import decode_ledger
from fasaco_edge.daemon.ledger.rooms_file import decode_rooms
from fasaco_edge.daemon.loop.inbox import CycleInput, Received
from fasaco_edge.daemon.loop.turn_log import (
    EMBEDDED,
    POSE_BYTES,
    DecisionFilter,
    cells_checksum,
    kernels_name,
)
from fasaco_edge.errors import MalformedMessage
from fasaco_edge.mission.events import CommandReceived, PlanReady, PlanRequest
from fasaco_edge.mission.orders.commands import read_recorded
from fasaco_edge.planners.planner import StopAt, ignore
from fasaco_edge.replay.mission_drive import MissionDrive, ReplayStep
from fasaco_edge.samples import SampleDecoder
from fasaco_edge.wire.documents.turns import (
    Cycle,
    Decided,
    EarlySample,
    LogStart,
    PlanTaken,
    TakenSample,
    TurnBatch,
    decode_turns,
)
from fasaco_edge.wire.limits import MAX_MESSAGE_BYTES
from fasaco_edge.wire.topics import TURNS

# Longest time from a sample to the cycle that takes it [ns].
KEPT_NS = 60_000_000_000
# Longest time that a recording may go on after the end of its log, which comes twice a second [ns].
SILENT_NS = 5_000_000_000


@dataclass(frozen=True, slots=True)
class CycleRecord:
    """Content of the turn log of a recording.

    Attributes:
        beginning: initial state of the daemon.
        kernels: name of the daemon's compiled kernels; "" if the mission did not begin.
        turns: number of cycles up to the first gap.
        gap: what is missing after them, or "".
        taken: topic and checksum of every sample that the daemon took.
        began_ns: time of the first cycle, by the recorder's clock [ns].
    """

    beginning: LogStart
    kernels: str = ""
    turns: int = 0
    gap: str = ""
    taken: frozenset[tuple[str, int]] = field(default_factory=frozenset)
    began_ns: int = 0


def read_turns(samples: Iterable[Arrival]) -> CycleRecord | None:
    """Return the content of the turn log; None if the log, or its beginning, is missing."""
    beginning: LogStart | None = None
    kernels, turns, gap = "", 0, ""
    taken: set[tuple[str, int]] = set()
    log_ns = sample_ns = first_ns = began_ns = 0
    for arrival in samples:
        if arrival.topic != TURNS.name:
            sample_ns = arrival.wall_ns
            continue
        log_ns = arrival.wall_ns
        try:
            batch = decode_turns(arrival.sample.payload)
        except MalformedMessage as error:
            gap = gap or str(error)
            break
        if beginning is None:
            beginning = batch.beginning
            if beginning is None:
                return None
        elif batch.beginning is not None:
            gap = "another daemon started"
            break
        if batch.first != turns + 1:
            gap = f"turns {turns + 1} to {batch.first - 1} are not in the recording"
            break
        if batch.times:
            # Each batch comes just after its last cycle: the batch with the least delay counts.
            first_ns = first_ns or round(1e9 * batch.times[0])
            since_ns = log_ns - round(1e9 * batch.times[-1]) + first_ns
            began_ns = min(began_ns or since_ns, since_ns)
        turns += len(batch.times)
        kernels = kernels or batch.kernels
        taken.update((s.topic, s.checksum) for turn in batch.turns for s in turn.samples)
    if beginning is None:
        return None
    if sample_ns - log_ns > SILENT_NS:
        gap = gap or f"the log ends {1e-9 * (sample_ns - log_ns):.1f} s before the recording"
    return CycleRecord(beginning, kernels, turns, gap, frozenset(taken), began_ns)


def inflated_sample(early: EarlySample) -> Sample:
    """Return a sample that the turn log itself contains.

    Raises:
        MalformedMessage: the sample cannot be inflated, or is longer than any message.
    """
    inflater = zlib.decompressobj()
    try:
        payload = inflater.decompress(early.deflated, MAX_MESSAGE_BYTES)
    except zlib.error as error:
        raise MalformedMessage(f"turn log: sample of {early.key}: {error}") from error
    if inflater.unconsumed_tail or not inflater.eof:
        raise MalformedMessage(
            f"turn log: sample of {early.key}: torn, or more than {MAX_MESSAGE_BYTES} bytes"
        )
    return Sample(early.key, payload, early.schema)


@dataclass(frozen=True, slots=True)
class Difference:
    """A difference from the recording.

    Attributes:
        turn: number of the cycle.
        at_s: time since the first cycle [s].
        what: name of the value.
        recorded, replayed: its values.
    """

    turn: int
    at_s: float
    what: str
    recorded: object
    replayed: object


class CycleReplay:
    """Feeds the cycles of a recording to a mission.

    Args:
        config: configuration of the recorded daemon.
        record: the content of its turn log.

    Attributes:
        mission: the mission, for inspection between steps.
        turns: number of cycles played that ended as recorded.
        plans: number of plans made, including those in spare time.
        difference: the first decision or sample that differs; None without a difference.
        kernels: name of the compiled kernels in use.
        began_ns: time of the first cycle, by the recorder's clock [ns].
    """

    def __init__(self, config: DaemonConfig, record: CycleRecord) -> None:
        self._record, self.began_ns = record, record.began_ns
        ledger, rooms = record.beginning.ledger, record.beginning.rooms
        restored = decode_ledger(ledger, config.cell_m) if ledger else None
        self._drive = MissionDrive(config, restored, decode_rooms(rooms) if rooms else None)
        self.mission = self._drive.mission
        # Recorded samples by topic and checksum, the oldest first.
        self._samples: dict[tuple[str, int], Arrival] = {}
        self._decoder = SampleDecoder()
        self._logged: dict[str, deque[Sample]] = defaultdict(deque)
        self._filter = DecisionFilter()
        self._request: PlanRequest | None = None
        self._at_s = 0.0
        self.turns = self.plans = 0
        self.kernels = kernels_name()
        self.difference: Difference | None = None

    def steps(self, samples: Iterable[Arrival]) -> Iterator[ReplayStep]:
        """Yield each cycle, up to the first that differs from the recording."""
        # A batch is played once the next batch has come, as all its samples have come by then.
        batch: TurnBatch | None = None
        for arrival in samples:
            if arrival.topic in EMBEDDED and len(arrival.sample.payload) <= POSE_BYTES:
                continue  # these samples are in the log
            if arrival.topic != TURNS.name:
                self._keep(arrival)
                continue
            if batch is not None:
                yield from self._play(batch)
            if self.difference is not None or self.turns >= self._record.turns:
                return
            batch = decode_turns(arrival.sample.payload)
        if batch is not None:
            yield from self._play(batch)

    def _play(self, batch: TurnBatch) -> Iterator[ReplayStep]:
        drive = self._drive
        turns = {turn.number: turn for turn in batch.turns}
        for numbered in self._decoder.samples(batch.told) if batch.told else []:
            self._logged[numbered.arrival.topic].append(numbered.arrival.sample)
        for number, now in enumerate(batch.times, batch.first):
            if self.difference is not None or number > self._record.turns:
                return
            self._at_s = 0.0 if drive.began is None else now - drive.began
            step = self._cycle(turns.get(number) or Cycle(number, drive.is_begun), now)
            self.turns += self.difference is None
            yield step

    def _cycle(self, turn: Cycle, now: float) -> ReplayStep:
        drive = self._drive
        commands = [
            CommandReceived(number, *read_recorded(document)) for number, document in turn.commands
        ]
        batch = CycleInput(samples=self._received(turn), updates_lost=turn.patches_lost)
        plans, before = self._plans(turn), drive.state
        step = drive.cycle(now, batch, commands, plans, may_begin=turn.is_begun)
        if step.decision.plan is not None:
            self._request = step.decision.plan
        decided = self._filter.of(step.decision, self.mission if drive.is_begun else None)
        self._compare(turn, decided, before)
        if step.decision.path is None:
            return step
        return replace(step, as_recorded=_facts(turn.decided)["path"] == _facts(decided)["path"])

    def _received(self, turn: Cycle) -> list[Received]:
        found = [(taken, self._find(turn, taken)) for taken in turn.samples]
        return [
            Received(taken.topic, sample, taken.at) for taken, sample in found if sample is not None
        ]

    def _find(self, turn: Cycle, taken: TakenSample) -> Sample | None:
        if taken.told is not None:
            return inflated_sample(taken.told)
        if not taken.checksum and self._logged[taken.topic]:
            return self._logged[taken.topic].popleft()
        arrival = self._samples.get((taken.topic, taken.checksum))
        if arrival is None:
            what = f"{taken.topic} with checksum {taken.checksum:08x}"
            self._differ(turn, what, "taken", "not in the recording")
            return None
        return arrival.sample

    def _keep(self, arrival: Arrival) -> None:
        """Keep a sample for a while if a cycle of the recorded daemon took it."""
        key = arrival.topic, zlib.crc32(arrival.sample.payload)
        if key not in self._record.taken:
            return
        self._samples.pop(key, None)
        self._samples[key] = arrival
        while arrival.wall_ns - next(iter(self._samples.values())).wall_ns >= KEPT_NS:
            del self._samples[next(iter(self._samples))]

    def _plans(self, turn: Cycle) -> list[PlanReady]:
        """Make the plan finished in this cycle again; return a list, empty without a plan."""
        taken, request = turn.plan, self._request
        if taken is None:
            return []
        if request is None or request.number != taken.number:
            asked = None if request is None else request.number
            self._differ(turn, "plan under way", taken.number, asked)
            return []
        self.plans += 1
        path = self._drive.planner.plan(request.problem, StopAt(taken.stops), ignore)
        work = (path.work.ants, path.work.perturbations, path.work.proposals)
        again = PlanTaken(
            taken.number, taken.seconds, taken.stops, work, cells_checksum(path.cells)
        )
        if again != taken:
            self._differ(turn, f"plan {taken.number}", _plan_words(taken), _plan_words(again))
        return [PlanReady(taken.number, path, taken.seconds, tuple(taken.stops))]

    def _compare(self, turn: Cycle, decided: Decided | None, before: str) -> None:
        # A cycle without a decision leaves the state as it was before.
        then, now = (_facts(one or Decided(before, "")) for one in (turn.decided, decided))
        for name, was in then.items():
            if was != now[name]:
                self._differ(turn, name, was, now[name])
                return

    def _differ(self, turn: Cycle, what: str, recorded: object, replayed: object) -> None:
        if self.difference is None:
            self.difference = Difference(turn.number, self._at_s, what, recorded, replayed)


def _facts(decided: Decided | None) -> dict[str, object]:
    """Return the compared parts of a decision: all but the reasons, which releases may reword."""
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
    ants, perturbations, proposals = plan.work
    counts = f"{ants} ants, {perturbations} perturbations, {proposals} proposals"
    return f"{counts}, cells {plan.checksum:08x}"
