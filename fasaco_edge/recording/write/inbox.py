"""The queue between Zenoh's threads and the writer thread, and the clock of a recording.

The queue's size bounds the recorder's memory: a sample as large as the queue is held in up to ten
copies by Zenoh, the drawing, the inputs and Rerun, and allocators keep some freed memory. With the
largest maps that fit, however often they are sent, it takes at most

    BASE_BYTES + COPIES * capacity

``MemoryHigh=`` of its unit is this sum for ``QUEUE_BYTES``, ``MemoryMax=`` a tenth more (a test
checks the unit); under another limit the queue is smaller. Measured for a minute each, x86-64,
random maps at 10 Hz, each followed by a map update of full size: idle 136 MB, 25 million pixels
488, 31 million 622.
"""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.wire.topic_types import NEWEST
from fasaco_edge.wire.topics import TOPICS


class RunClock:
    """Monotonic UTC [ns]: setting the clock during a run must not break its timeline."""

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        """Return the time since the epoch [ns], by the clock's setting when the run began."""
        return self._offset_ns + time.monotonic_ns()

    def arrival(self, topic: str, sample: Sample) -> Arrival:
        """Return a sample with its time of arrival, now."""
        at_ns = time.monotonic_ns()
        return Arrival(topic, sample, at_ns, self._offset_ns + at_ns)


MB = 1_000_000
BASE_BYTES = 145 * MB
COPIES = 15
# Queue size without a memory limit [bytes]: maps of up to 32 million pixels.
QUEUE_BYTES = 32 * MB
# Least queue size: small maps and other samples.
LEAST_QUEUE_BYTES = 4 * MB


def afforded_bytes(limit: int | None) -> int:
    """Return the queue size under a memory limit [bytes]; None is no limit."""
    if limit is None:
        return QUEUE_BYTES
    return min(max((limit - BASE_BYTES) // COPIES, LEAST_QUEUE_BYTES), QUEUE_BYTES)


# With this many waiting samples the writer is behind: some ten seconds of poses.
BEHIND_SAMPLES = 1024

# Samples superseded by a newer one when the writer is behind; a full map also supersedes updates.
SUPERSEDED = {
    topic.name: frozenset({topic.name}) for topic in TOPICS if topic.queues.recorder == NEWEST
}
SUPERSEDED["map"] |= {"map_update"}


class Inbox:
    """Samples in order of arrival, at most ``capacity_bytes`` of them.

    Once the writer is behind, a sample replaces the older ones that it supersedes; once the
    capacity is used up, samples are dropped. Both are counted as lost.
    """

    def __init__(self, capacity_bytes: int, stamp: Callable[[str, Sample], Arrival]) -> None:
        self._stamp = stamp
        self._changed = threading.Condition()
        self._waiting: deque[Arrival] = deque()
        self._capacity = capacity_bytes
        self._bytes = 0
        self._lost: Counter[str] = Counter()

    def post(self, topic: str, sample: Sample) -> None:
        """Add a sample; safe from any thread, never waits for the writer."""
        size = sample.size
        with self._changed:
            # Stamped here, so that samples of several threads have increasing times.
            arrival = self._stamp(topic, sample)
            if len(self._waiting) >= BEHIND_SAMPLES or 2 * (self._bytes + size) > self._capacity:
                self._drop(SUPERSEDED.get(arrival.topic, frozenset()))
            if self._bytes + size > self._capacity:
                self._lost[arrival.topic] += 1
                return
            self._waiting.append(arrival)
            self._bytes += size
            self._changed.notify()

    def take(self, timeout_s: float) -> list[Arrival]:
        """Return all waiting samples; wait up to ``timeout_s`` [s] for the first."""
        with self._changed:
            if not self._waiting:
                self._changed.wait(timeout_s)
            arrivals = list(self._waiting)
            self._waiting.clear()
            self._bytes = 0
            return arrivals

    @property
    def lost(self) -> Counter[str]:
        """Number of samples of each topic that never reached the writer."""
        with self._changed:
            return self._lost.copy()

    def _drop(self, topics: frozenset[str]) -> None:
        self._lost.update(arrival.topic for arrival in self._waiting if arrival.topic in topics)
        kept = deque(arrival for arrival in self._waiting if arrival.topic not in topics)
        self._bytes = sum(arrival.sample.size for arrival in kept)
        self._waiting = kept
