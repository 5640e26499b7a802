"""The recording process of robots and fleets: clock, queue of samples, loop.

The queue's capacity bounds the recorder's memory. Zenoh, the drawing, the inputs and Rerun hold up
to ten copies of a sample, and allocators keep some freed memory. With the largest maps that fit
into the queue, at any publishing rate, the recorder takes at most

    BASE_BYTES + COPIES * capacity

``MemoryHigh=`` of the recorder's systemd unit is this sum for ``QUEUE_BYTES``, ``MemoryMax=`` is
10 % more (a test checks the unit). Under a lower limit the queue is smaller. Measured on x86-64
for a minute each, with random maps at 10 Hz, each followed by an update of the whole map: idle
136 MB; 25 million pixels 488 MB; 31 million pixels 622 MB.
"""

from __future__ import annotations

import os
import threading
import time
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.host.processes import MB, release_unused, return_soon, stop_event
from fasaco_edge.recording.read.torn import repair_folder
from fasaco_edge.recording.sdk import rrb
from fasaco_edge.recording.write.quota import DiskBudget, cannot_record, next_run
from fasaco_edge.recording.write.writer import RecordingWriter
from fasaco_edge.wire.topic_types import NEWEST
from fasaco_edge.wire.topics import TOPICS

TAKE_TIMEOUT_S = 0.1
EXIT_STALLED = 1


class RunClock:
    """Monotonic UTC [ns]: the timeline continues if the system clock is set during a run.

    Attributes:
        began_ns, began: beginning of the run: since the epoch [ns], and as a date, UTC.
    """

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.monotonic_ns()
        self.began_ns = self.now_ns()
        self.began = datetime.fromtimestamp(self.began_ns / 1e9, UTC)

    def now_ns(self) -> int:
        """Return the time since the epoch [ns]; later settings of the system clock are ignored."""
        return self._offset_ns + time.monotonic_ns()

    def arrival(self, topic: str, sample: Sample) -> Arrival:
        """Return a sample with its time of arrival, now."""
        at_ns = time.monotonic_ns()
        return Arrival(topic, sample, at_ns, self._offset_ns + at_ns)


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


# Number of waiting samples at which the writer is behind: about ten seconds of poses.
BEHIND_SAMPLES = 1024

# For each topic: while the writer is behind, a new sample replaces waiting samples of these topics.
# A map replaces map updates, too.
SUPERSEDED = {
    topic.name: frozenset({topic.name}) for topic in TOPICS if topic.queues.recorder == NEWEST
}
SUPERSEDED["map"] |= {"map_update"}


class SampleQueue:
    """A queue of samples in order of arrival, of at most ``capacity_bytes``.

    While the writer is behind, a sample replaces older samples (``SUPERSEDED``). While the queue is
    full, new samples are dropped. Replaced and dropped samples count as lost.
    """

    def __init__(self, capacity_bytes: int, stamp: Callable[[str, Sample], Arrival]) -> None:
        self._stamp = stamp
        self._changed = threading.Condition()
        self._waiting: deque[Arrival] = deque()
        self._capacity = capacity_bytes
        self._bytes = 0
        self._lost: Counter[str] = Counter()

    def post(self, topic: str, sample: Sample) -> None:
        """Add a sample; thread-safe, never waits for the writer."""
        size = sample.size
        with self._changed:
            # The lock is held: samples of several threads get increasing times.
            arrival = self._stamp(topic, sample)
            if len(self._waiting) >= BEHIND_SAMPLES or 2 * (self._bytes + size) > self._capacity:
                topics = SUPERSEDED.get(arrival.topic, frozenset())
                self._lost.update(one.topic for one in self._waiting if one.topic in topics)
                self._waiting = deque(one for one in self._waiting if one.topic not in topics)
                self._bytes = sum(one.sample.size for one in self._waiting)
            if self._bytes + size > self._capacity:
                self._lost[arrival.topic] += 1
                return
            self._waiting.append(arrival)
            self._bytes += size
            self._changed.notify()

    def take(self, timeout_s: float) -> list[Arrival]:
        """Return all waiting samples; wait up to ``timeout_s`` [s] for the first one."""
        with self._changed:
            if not self._waiting:
                self._changed.wait(timeout_s)
            arrivals = list(self._waiting)
            self._waiting.clear()
            self._bytes = 0
            return arrivals

    @property
    def lost(self) -> Counter[str]:
        """Number of lost samples of each topic."""
        with self._changed:
            return self._lost.copy()


class BusRecorder(ABC):
    """The connection of the bus to a writer."""

    writer: RecordingWriter

    @abstractmethod
    def note(self, line: str) -> None:
        """Log a fault in the recording."""

    @abstractmethod
    def listen(self) -> None:
        """Subscribe to all recorded topics."""

    @abstractmethod
    def step(self, timeout_s: float) -> None:
        """Record samples that arrive within ``timeout_s`` [s], and drawings that are due."""

    @abstractmethod
    def end(self) -> bool:
        """Write waiting samples and the footer; False if the disk fails."""


def begin_recording(
    budget: DiskBudget, name: str, blueprint: rrb.Blueprint
) -> tuple[RecordingWriter, RunClock]:
    """Begin a recording of the robot or fleet ``name``; return its writer and its clock."""
    clock = RunClock()
    run = next_run(budget.folder, name, clock.began)
    writer = RecordingWriter(run, budget, blueprint)
    writer.at(clock.began_ns)
    return writer, clock


def record(
    folder: Path, bus_settings: BusSettings, recorder_on: Callable[[Bus], BusRecorder]
) -> int:
    """Record until SIGTERM or SIGINT; return the process's exit code.

    If the disk fails, the process exits here (``os._exit``): Rerun would block a normal exit.

    Args:
        folder: folder of the recordings; torn recordings are repaired first.
        bus_settings: settings of the bus session.
        recorder_on: returns the recorder on a bus.

    Raises:
        BusUnavailable: nothing listens at the endpoints.
        BadConfiguration: the folder cannot be made or written to.
    """
    return_soon()
    try:
        repairs = repair_folder(folder)
    except OSError as error:
        raise cannot_record(folder, error) from error
    with stop_event() as stop, open_bus(bus_settings) as bus:
        recorder = recorder_on(bus)
        for repair in repairs:
            recorder.note(str(repair))
        recorder.listen()
        release_unused()
        while not stop.is_set():
            recorder.step(TAKE_TIMEOUT_S)
        code = 0 if recorder.end() else EXIT_STALLED
    if recorder.writer.hangs:
        # All recoverable data are saved.
        os._exit(code)
    return code
