"""Record of each cycle of a daemon's loop, from its turn log, and the samples it took."""

from __future__ import annotations

import zlib
from collections import defaultdict, deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from fasaco_edge.bus.arrival import Arrival
from fasaco_edge.bus.session import Sample
from fasaco_edge.errors import MalformedMessage
from fasaco_edge.wire.topics import TURNS
from fasaco_edge.wire.turns import EarlySample, LogStart, TakenSample, decode_turns

# A sample that waits longer than this was taken by nobody [ns].
KEPT_NS = 60_000_000_000
# The log comes twice a second: for so long after it nothing else should come [ns].
SILENT_NS = 5_000_000_000
# Of samples that nobody took so many are kept, of each topic.
STRANGE = 4


@dataclass(frozen=True, slots=True)
class CycleRecord:
    """What the turn log of a recording holds in all.

    Attributes:
        beginning: what the daemon began with.
        kernels: names its compiled kernels; "" where the mission did not begin.
        turns: how many follow each other without a gap, from the first.
        gap: what is missing after them; "" for nothing.
        taken: topic and checksum of every sample it took.
    """

    beginning: LogStart
    kernels: str = ""
    turns: int = 0
    gap: str = ""
    taken: frozenset[tuple[str, int]] = field(default_factory=frozenset)


def read_turns(samples: Iterable[Arrival]) -> CycleRecord | None:
    """Return what the turn log says; None where there is none, or not from the beginning."""
    beginning: LogStart | None = None
    kernels, turns, gap = "", 0, ""
    taken: set[tuple[str, int]] = set()
    told_ns = heard_ns = 0
    for arrival in samples:
        if arrival.topic != TURNS.name:
            heard_ns = arrival.wall_ns
            continue
        told_ns = arrival.wall_ns
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
            gap = "another daemon began"
            break
        if batch.first != turns + 1:
            gap = f"turns {turns + 1} to {batch.first - 1} are not in the recording"
            break
        turns += len(batch.times)
        kernels = kernels or batch.kernels
        taken.update((s.topic, s.checksum) for turn in batch.turns for s in turn.samples)
    if beginning is None:
        return None
    if heard_ns - told_ns > SILENT_NS:
        gap = gap or f"the log ends {1e-9 * (heard_ns - told_ns):.1f} s before the recording"
    return CycleRecord(beginning, kernels, turns, gap, frozenset(taken))


class UntakenSamples:
    """Recorded samples until the cycle that took them."""

    def __init__(self, taken: frozenset[tuple[str, int]]) -> None:
        self._taken = taken
        self._samples: dict[tuple[str, int], Arrival] = {}
        # Those that no cycle took as they are.
        self._strange: dict[str, deque[Sample]] = defaultdict(lambda: deque(maxlen=STRANGE))

    def add(self, arrival: Arrival) -> None:
        """Keep a sample."""
        key = arrival.topic, zlib.crc32(arrival.sample.payload)
        if key not in self._taken:
            self._strange[arrival.topic].append(arrival.sample)
            return
        self._samples.pop(key, None)
        self._samples[key] = arrival
        # The oldest come first.
        while (oldest := next(iter(self._samples))) != key:
            if arrival.wall_ns - self._samples[oldest].wall_ns < KEPT_NS:
                break
            del self._samples[oldest]

    def find(self, taken: TakenSample) -> tuple[Sample | None, bool]:
        """Return the sample, and whether it is the one.

        In place of one that is not there comes one that nobody took.
        """
        arrival = self._samples.get((taken.topic, taken.checksum))
        if arrival is not None:
            return arrival.sample, True
        strange = self._strange[taken.topic]
        return (strange.popleft() if strange else None), False


def inflated_sample(told: EarlySample) -> Sample:
    """Return a sample that is in the turn log itself.

    Raises:
        MalformedMessage: it cannot be inflated.
    """
    try:
        return Sample(told.key, zlib.decompress(told.deflated), told.schema)
    except zlib.error as error:
        raise MalformedMessage(f"turn log: sample of {told.key}: {error}") from error
