"""Between Zenoh's threads and the one that writes: bounded memory, order of arrival."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass

from fasaco_edge.bus.session import Sample

# So many samples waiting mean that the writer is behind.
BEHIND_SAMPLES = 128

# What a sample makes worthless when the writer is behind. Paths are missing: they are
# small, and each revision counts. A full map also clears the patches of the one before it.
SUPERSEDED: dict[str, frozenset[str]] = {
    "map": frozenset({"map", "map_update"}),
    "pose": frozenset({"pose"}),
    "coverage": frozenset({"coverage"}),
    "pheromone": frozenset({"pheromone"}),
    "status": frozenset({"status"}),
}


@dataclass(frozen=True, slots=True)
class Arrival:
    """A sample, what it is about, and when it came: wall clock [ns]."""

    topic: str
    sample: Sample
    wall_ns: int


class Inbox:
    """Samples in order of arrival, at most ``capacity_bytes`` of them.

    Once the writer is behind, what is newer takes the place of the older of its kind;
    once there is no room, samples are dropped. Both are counted as lost.
    """

    def __init__(self, capacity_bytes: int) -> None:
        self._changed = threading.Condition()
        self._waiting: deque[Arrival] = deque()
        self._capacity = capacity_bytes
        self._bytes = 0
        self._lost = 0

    def post(self, arrival: Arrival) -> None:
        """Leave a sample; safe from any thread, never waits for the writer."""
        size = len(arrival.sample.payload)
        with self._changed:
            if len(self._waiting) >= BEHIND_SAMPLES or 2 * (self._bytes + size) > self._capacity:
                self._forget(SUPERSEDED.get(arrival.topic, frozenset()))
            if self._bytes + size > self._capacity:
                self._lost += 1
                return
            self._waiting.append(arrival)
            self._bytes += size
            self._changed.notify()

    def take(self, timeout_s: float) -> list[Arrival]:
        """Return all samples there are; wait up to ``timeout_s`` [s] for the first."""
        with self._changed:
            if not self._waiting:
                self._changed.wait(timeout_s)
            arrivals = list(self._waiting)
            self._waiting.clear()
            self._bytes = 0
            return arrivals

    @property
    def lost(self) -> int:
        """How many samples never reached the writer."""
        with self._changed:
            return self._lost

    def _forget(self, topics: frozenset[str]) -> None:
        kept = deque(arrival for arrival in self._waiting if arrival.topic not in topics)
        self._lost += len(self._waiting) - len(kept)
        self._bytes = sum(len(arrival.sample.payload) for arrival in kept)
        self._waiting = kept
