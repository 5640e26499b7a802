"""The turn log: inputs and decisions of each cycle of the loop, published for the recorder.

It is complete from the first cycle, which a replay needs, or not published at all. Samples that
arrived before the first subscriber are embedded in the log. A replay compares its own decisions in
the same form (``DecisionFilter``).
"""

from __future__ import annotations

import logging
import time
import zlib
from collections.abc import Sequence
from typing import TYPE_CHECKING

from fasaco_edge import __version__
from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.bus.publisher import Publisher
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.ledger.codec import encode_ledger
from fasaco_edge.daemon.loop.answers import config_document
from fasaco_edge.daemon.loop.inbox import MAPS, CycleInput, Received
from fasaco_edge.kernels.folder import sources_digest
from fasaco_edge.mission.coverage.ledger import LedgerSnapshot
from fasaco_edge.mission.events import CommandReceived, Decision, PlanBroken, PlanReady
from fasaco_edge.mission.orders.commands import command_document
from fasaco_edge.samples import SampleEncoder
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.documents.turns import (
    Cycle,
    Decided,
    EarlySample,
    LogStart,
    PlanTaken,
    TakenSample,
    TurnBatch,
)
from fasaco_edge.wire.topics import FLEET

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from fasaco_edge.mission.core.mission import Mission


LOG = logging.getLogger(__name__)

PERIOD_S = 0.5
# Limit on the cycles in which the log waits for a recorder, which takes some seconds to start.
WAITING_TURNS = 2048
# Limits on the embedded samples from before the first subscriber, as they are and deflated [bytes]:
# more would delay the loop.
EMBEDDED_BYTES, DEFLATED_BYTES = 8_000_000, 500_000
# Longest pose or battery message that is embedded instead of referred to by checksum; limit on all
# of these together while the log waits for a recorder [bytes].
POSE_BYTES, POSES_BYTES = 1024, 500_000
# Longest map that is embedded, as a busy link may drop it; copying a longer map delays the loop
# [bytes].
MAP_BYTES = 100_000
# Size from which a batch is published at once [bytes].
FULL_BYTES = 4_000_000
# Time until a new subscriber surely receives all samples itself [s].
MARGIN_S = 0.2
POSE = "pose"
EMBEDDED = (POSE, "battery")
NO_SUBSCRIBER = "it has no subscriber"


class TurnLog:
    """Publishes the log in batches.

    The first batch contains the ledger and the file of rooms that the daemon began with, if any.
    """

    def __init__(
        self,
        publisher: Publisher,
        config: DaemonConfig,
        restored: LedgerSnapshot | None,
        rooms: bytes = b"",
    ) -> None:
        self._publisher = publisher
        self._config = config
        self._restored, self._rooms = restored, rooms
        self._is_open = True
        self._embed_until = float("inf")
        self._published_at = float("-inf")
        self._first, self._times = 1, list[float]()
        self._turns: list[Cycle] = []
        self._embed_room, self._deflated_room = EMBEDDED_BYTES, DEFLATED_BYTES
        self._samples = SampleEncoder(run=0)
        # Cycles before the mission: time, number, inputs.
        self._early: list[tuple[float, Cycle, Sequence[Received]]] = []
        self._news = DecisionFilter()
        self._has_begun = self._kernels_named = False

    def note(
        self,
        now: float,
        batch: CycleInput,
        commands: Sequence[CommandReceived],
        decision: Decision,
        mission: Mission | None,
    ) -> None:
        """Add a cycle at ``now`` [s, monotonic]; it is published some cycles later."""
        if not self._is_open:
            return
        if self._is_waiting and self._publisher.has_listeners():
            self._embed_until = time.monotonic() + MARGIN_S
        if any(isinstance(plan, PlanBroken) for plan in batch.plans):
            self.end("a plan failed, which no replay can repeat")
            return
        # Fleet messages before the first mission are dropped.
        samples = [
            self._taken(received)
            for received in batch.samples
            if mission is not None or received.kind != FLEET.name
        ]
        plans = [plan for plan in batch.plans if isinstance(plan, PlanReady)]
        decided = self._news.of(decision, mission)
        is_empty = not (samples or plans or commands or batch.updates_lost or decided)
        if is_empty and mission is None:
            return
        self._times.append(now)
        if not is_empty or (mission is not None and not self._has_begun):
            self._turns.append(
                Cycle(
                    number=self._first + len(self._times) - 1,
                    is_begun=mission is not None,
                    samples=samples,
                    patches_lost=batch.updates_lost,
                    commands=[(asked.number, command_document(asked.asked)) for asked in commands],
                    plan=_plan_taken(plans[-1]) if plans else None,
                    decided=decided,
                )
            )
        self._has_begun = mission is not None
        self._forget_early(batch.samples)
        is_full = self._samples.waiting_bytes > FULL_BYTES
        if is_full or now - self._published_at >= PERIOD_S:
            self._published_at = now
            self.publish()

    def publish(self) -> None:
        """Publish the batch, if there is a subscriber."""
        if not self._is_open or not self._times:
            return
        if self._is_waiting:
            if len(self._times) > WAITING_TURNS or self._samples.waiting_bytes > POSES_BYTES:
                self.end(NO_SUBSCRIBER)
            return
        if not self._publisher.has_listeners():
            self.end(NO_SUBSCRIBER)
            return
        start, kernels = None, ""
        if self._first == 1:
            ledger = encode_ledger(self._restored) if self._restored else b""
            start = LogStart(__version__, config_document(self._config), ledger, self._rooms)
        if self._has_begun and not self._kernels_named:
            self._kernels_named, kernels = True, kernels_name()
        batch = TurnBatch(
            first=self._first,
            times=self._times,
            turns=self._turns,
            beginning=start,
            told=self._samples.take(),
            kernels=kernels,
        )
        self._publisher.put(encode_json(batch))
        self._first, self._times, self._turns = self._first + len(self._times), [], []

    @property
    def _is_waiting(self) -> bool:
        return self._embed_until == float("inf")

    def end(self, why: str) -> None:
        """End the log, as later cycles could not be replayed."""
        if not self._is_open:
            return
        LOG.info("the turn log ends: %s", why)
        self._is_open = False
        self._times, self._turns, self._restored, self._rooms = [], [], None, b""
        self._samples = SampleEncoder(run=0)

    def _taken(self, received: Received) -> TakenSample:
        kind, sample, at = received.kind, received.sample, received.at
        if kind == FLEET.name or (kind in EMBEDDED and len(sample.payload) <= POSE_BYTES):
            self._samples.add(Arrival(kind, sample, 0, 0))
            return TakenSample(kind, 0)
        if kind == "map" and len(sample.payload) <= MAP_BYTES and at >= self._embed_until:
            self._samples.add(Arrival(kind, sample, 0, 0))
            return TakenSample(kind, 0, at)
        embedded = self._embedded(sample) if at < self._embed_until else None
        return TakenSample(kind, zlib.crc32(sample.payload), at if kind in MAPS else 0.0, embedded)

    def _embedded(self, sample: Sample) -> EarlySample | None:
        """Return the sample itself, deflated; None without room for it."""
        if len(sample.payload) > self._embed_room:
            return None
        self._embed_room -= len(sample.payload)
        deflated = zlib.compress(sample.payload, 1)
        if len(deflated) > self._deflated_room:
            return None
        self._deflated_room -= len(deflated)
        return EarlySample(sample.key, sample.schema, deflated)

    def _forget_early(self, received: Sequence[Received]) -> None:
        """Keep only the newest pose and charge while nothing else has arrived."""
        if not self._is_waiting or self._has_begun or not all(map(_is_embedded, self._turns)):
            self._early = []
            return
        if not self._turns or not received:
            return
        early = [*self._early, (self._times[-1], self._turns[-1], received)]
        newest = {one.topic: at for at, (_, turn, _) in enumerate(early) for one in turn.samples}
        self._early = [early[at] for at in sorted(set(newest.values()))]
        self._times = [time for time, _, _ in self._early]
        self._turns = [
            Cycle(self._first + number, turn.is_begun, turn.samples)
            for number, (_, turn, _) in enumerate(self._early)
        ]
        self._samples = SampleEncoder(run=0)
        for _, _, samples in self._early:
            for one in samples:
                if len(one.sample.payload) <= POSE_BYTES:
                    self._samples.add(Arrival(one.kind, one.sample, 0, 0))


def _plan_taken(ready: PlanReady) -> PlanTaken:
    work = ready.path.work
    return PlanTaken(
        ready.number,
        ready.seconds,
        list(ready.stops),
        (work.ants, work.perturbations, work.proposals),
        cells_checksum(ready.path.cells),
    )


def _is_embedded(turn: Cycle) -> bool:
    return (
        not turn.commands
        and not turn.patches_lost
        and all(s.topic in EMBEDDED for s in turn.samples)
    )


class DecisionFilter:
    """Selects the cycles with a decision or a change of state."""

    def __init__(self) -> None:
        self._state = ("", "")

    def of(self, decision: Decision, mission: Mission | None) -> Decided | None:
        """Return the entry for the next cycle; None without a decision or change of state."""
        state = (str(mission.state), mission.reason) if mission else ("", "")
        decided = decided_of(decision, *state)
        is_news = state != self._state or decided != Decided(*state)
        self._state = state
        return decided if is_news else None


def decided_of(decision: Decision, state: str, reason: str) -> Decided:
    """Return a decision in the form of the log."""
    plan, path = decision.plan, decision.path
    return Decided(
        state=state,
        reason=reason,
        asked=None if plan is None else (plan.number, plan.reason),
        path=None if path is None else (path.revision, path.reason, cells_checksum(path.cells)),
        faults=[fault.code for fault in decision.faults],
        answers=[
            (answer.number, answer.error.code if answer.error else "")
            for answer in decision.answers
        ],
    )


def cells_checksum(cells: NDArray[np.int32]) -> int:
    """Return the CRC-32 of cells, int32 (n, 2), on any machine."""
    return zlib.crc32(cells.astype("<i4").tobytes())


def kernels_name() -> str:
    """Return the name of the kernels in use; kernels of one name compute the same."""
    return f"kernels-{sources_digest()}"
