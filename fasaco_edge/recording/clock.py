"""The time of a recording."""

from __future__ import annotations

import time

from fasaco_edge.bus.arrival import Arrival
from fasaco_edge.bus.session import Sample


class RunClock:
    """UTC [ns] that never steps: a clock set during a run must not tear its timeline."""

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        """Return the time [ns] since the epoch, as the clock saw it when the run began."""
        return self._offset_ns + time.monotonic_ns()

    def arrival(self, topic: str, sample: Sample) -> Arrival:
        """Return a sample that has just come."""
        at_ns = time.monotonic_ns()
        return Arrival(topic, sample, at_ns, self._offset_ns + at_ns)
