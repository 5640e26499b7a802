"""The writer of a recording in parts; it survives a full or stalled disk.

Each part begins with all static data and the newest latched data, so that it can be read alone. All
parts share one recording id, so that a viewer shows them as one run.
"""

from __future__ import annotations

import enum
import logging
from pathlib import Path

import numpy as np

from fasaco_edge.recording import entities
from fasaco_edge.recording.sdk import rr, rrb
from fasaco_edge.recording.write.part import Flush, RecordingPart, send_blueprint, sweep
from fasaco_edge.recording.write.quota import DiskBudget, cannot_record

LOG = logging.getLogger(__name__)

# Flush period: ``kill -9`` loses the data of this period and of one flush. Each flush begins a
# chunk of more than a kilobyte for each entity.
FLUSH_PERIOD_NS = 900_000_000
# Retry period while nothing can be written.
RETRY_PERIOD_NS = 1_000_000_000
# Each abandoned part leaks threads and memory: the retry period doubles, at most this many times.
MOST_DOUBLINGS = 5
# Limit on the data between two flushes: Rerun's own queue has none.
FLUSH_BYTES = 8_000_000
# Timeout of a flush: memory cards pause, and computers may be slow. Meanwhile samples wait in the
# recorder's queue.
FLUSH_TIMEOUT_S = 4.0
# Timeout of a flush that checks whether a stalled disk works again.
PROBE_TIMEOUT_S = 0.2
# Timeout of the last flush: shorter than a supervisor's timeout for the whole process.
CLOSE_TIMEOUT_S = 4.0


class WriterState(enum.Enum):
    """State of the writer."""

    RECORDING = "recording"
    DISK_FULL = "disk full"
    STALLED = "stalled"


class RecordingWriter:
    """Writes to the parts ``<recording_id>-part<n>.rrd`` in a folder; only one thread may call it.

    Rerun keeps times per thread, and logs data of a thread without a time as static.

    Attributes:
        wall_ns: the time of the next log call [ns].
        lost: number of messages that were not written.
        state, reason: whether it writes, and why it does not.

    Raises:
        BadConfiguration: the folder cannot be made or written to.
    """

    def __init__(self, recording_id: str, budget: DiskBudget, blueprint: rrb.Blueprint) -> None:
        self._folder = budget.folder
        self._recording_id = recording_id
        self._budget = budget
        self._name, self._blueprint = recording_id, blueprint
        self._static: dict[str, tuple[rr.AsComponents, ...]] = {}
        self._sequences: dict[str, int] = {}
        # Newest latched data, and the time of those that could not be written [ns].
        self._latched: dict[str, rr.AsComponents] = {}
        self._missed_ns: dict[str, int] = {}
        self.wall_ns = 0
        self._part: RecordingPart | None = None
        self._parts = 0
        self._abandoned: list[RecordingPart] = []
        self._next_flush_ns = 0
        self._part_until_ns: int | None = None
        self._unflushed_messages = 0
        self._unflushed_bytes = 0
        self._part_messages = 0
        self._lost_before = 0
        self.lost = 0
        self.state = WriterState.RECORDING
        self.reason = ""
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            self._begin_part()
        except OSError as error:
            if not self._abandoned:
                raise cannot_record(self._folder, error) from error
            self._enter(WriterState.STALLED, f"no part: {error}")

    @property
    def path(self) -> Path | None:
        """The part being written; None while the disk is full."""
        return self._part.path if self._part else None

    @property
    def hangs(self) -> bool:
        """Whether Rerun would hang when the interpreter exits."""
        return bool(self._abandoned) or self.state is WriterState.STALLED

    @property
    def part_number(self) -> int:
        """Number of the part being written, from 1; 0 while there is none."""
        return self._parts if self._part else 0

    @property
    def size(self) -> int:
        """Size of the part being written [bytes]."""
        return self._part.size if self._part else 0

    def message(self, wall_ns: int) -> None:
        """Begin logging a message received at ``wall_ns``; count it as lost if nothing is written.

        If the part breaks later, its unflushed messages count as lost, too.
        """
        self.at(wall_ns)
        if self.state is WriterState.RECORDING:
            self._unflushed_messages += 1
            self._part_messages += 1
        else:
            self.lost += 1

    def at(self, wall_ns: int) -> None:
        """Set the time [ns] of the next log calls."""
        self.wall_ns = wall_ns
        if (stream := self._stream) is not None:
            self._set_times(stream, wall_ns)

    def sequence(self, timeline: str, number: int) -> None:
        """Set the position on another timeline for the next log calls."""
        self._sequences[timeline] = number
        if (stream := self._stream) is not None:
            self._set_times(stream, self.wall_ns)

    def log(
        self, entity: str, archetype: rr.AsComponents, *, latched: bool = False, size: int = 0
    ) -> None:
        """Log at the time set.

        Args:
            entity, archetype: what to log, and where.
            latched: whether it stays in force until replaced, so that parts begin with it.
            size: its uncompressed size; 0 if small [bytes].
        """
        if latched:
            self._latched[entity] = archetype
        if (stream := self._stream) is not None:
            stream.log(entity, archetype)
        elif latched:
            self._missed_ns[entity] = self.wall_ns
        self._unflushed_bytes += size

    def write_blob(self, blob: bytes, entity: str = entities.INPUTS) -> bool:
        """Write bytes of an entity at the time set, at once; False on failure."""
        if self._part is None or self._stream is None:
            return False
        self._part.write_blob(blob, self.wall_ns, entity)
        self._unflushed_bytes += len(blob)
        return True

    def log_static(self, entity: str, *archetypes: rr.AsComponents) -> None:
        """Log static data of an entity, in place of earlier data."""
        self._static[entity] = archetypes
        if (stream := self._stream) is not None:
            stream.log(entity, *archetypes, static=True)

    def describe(self, name: str) -> None:
        """Name the recording."""
        self._name = name
        if (stream := self._stream) is not None:
            stream.send_recording_name(name)

    def show(self, blueprint: rrb.Blueprint) -> None:
        """Make ``blueprint`` the active blueprint: a viewer takes the last blueprint of a file."""
        self._blueprint = blueprint
        if (stream := self._stream) is not None:
            send_blueprint(stream, blueprint)

    def sync(self, now_ns: int) -> None:
        """Flush when due, and begin, rotate or abandon parts; call it often.

        Args:
            now_ns: monotonic time [ns].
        """
        if now_ns < self._next_flush_ns and self._unflushed_bytes < FLUSH_BYTES:
            return
        for broken in self._abandoned:
            broken.cut()
        if self._part is None:
            self._try_again()
        elif self._is_flushed(self._part):
            self._check_space(self._part, now_ns)
        recording = self.state is WriterState.RECORDING
        retry_ns = RETRY_PERIOD_NS << min(len(self._abandoned), MOST_DOUBLINGS)
        self._next_flush_ns = now_ns + (FLUSH_PERIOD_NS if recording else retry_ns)

    def close(self) -> bool:
        """Close the part properly; False if the disk blocks Rerun's writer."""
        for broken in self._abandoned:
            broken.cut()
        if self._part is None:
            return True
        outcome = self._part.flush(CLOSE_TIMEOUT_S)
        if outcome is Flush.STALLED:
            self._enter(WriterState.STALLED, f"{self._part.path.name} waits for the disk")
            return False
        if outcome is Flush.BROKEN:
            self._give_up(self._part)
        else:
            self._part.close()
        self._part = None
        return True

    @property
    def _stream(self) -> rr.RecordingStream | None:
        """Stream of the part; None while nothing is written."""
        if self._part is None or self.state is not WriterState.RECORDING:
            return None
        return self._part.stream

    def _is_flushed(self, part: RecordingPart) -> bool:
        stalled = self.state is WriterState.STALLED
        outcome = part.flush(PROBE_TIMEOUT_S if stalled else FLUSH_TIMEOUT_S)
        if outcome is Flush.STALLED:
            self._enter(WriterState.STALLED, f"{part.path.name} waits for the disk")
            return False
        if outcome is Flush.BROKEN:
            self._give_up(part)
            return False
        self._unflushed_messages = self._unflushed_bytes = 0
        if stalled:
            self._enter(WriterState.RECORDING, "the disk writes again")
            self._send_latched(part.stream)
        return True

    def _check_space(self, part: RecordingPart, now_ns: int) -> None:
        if self._part_until_ns is None:
            # Once per part is enough, as the quota leaves space for a whole part.
            self._budget.keep_quota()
            self._part_until_ns = now_ns + round(1e9 * self._budget.part_s)
        is_old = self._budget.part_s > 0 and now_ns >= self._part_until_ns
        is_deleted = part.is_deleted
        if is_deleted:
            self.lost += self._part_messages
            LOG.warning(
                "%s was deleted while it was written, with %d samples: the next part begins",
                part.path.name,
                self._part_messages,
                extra={"event": "part_deleted"},
            )
        if self._budget.is_full():
            part.close()
            self._part = None
            floor_mb = self._budget.least_free_bytes / 1e6
            is_there = self._folder.is_dir()
            why = f"less than {floor_mb:.0f} MB are free" if is_there else f"no {self._folder}"
            self._enter(WriterState.DISK_FULL, why)
        elif is_deleted or is_old or part.size >= self._budget.part_bytes:
            try:
                self._begin_part()
            except OSError as error:
                self._part = None
                self._enter(WriterState.DISK_FULL, f"no new part: {error}")
            part.close()
            del part
            if not self._abandoned:
                sweep()

    def _give_up(self, part: RecordingPart) -> None:
        part.abandon()
        self._abandoned.append(part)
        self._part = None
        self.lost += self._unflushed_messages
        self._unflushed_messages = self._unflushed_bytes = 0
        reason = f"{part.path.name} can no longer be written"
        if self._budget.may_begin():
            self._enter(WriterState.STALLED, reason)
        else:
            self._enter(WriterState.DISK_FULL, f"{reason}: no space left")

    def _try_again(self) -> None:
        if not self._budget.may_begin():
            return
        try:
            self._begin_part()
        except OSError as error:
            self._enter(self.state, f"no new part: {error}")
        else:
            self._enter(WriterState.RECORDING, "there is room again")

    def _begin_part(self) -> None:
        number = self._parts + 1
        path = self._folder / f"{self._recording_id}-part{number}.rrd"
        part = RecordingPart(path, self._recording_id)
        self._parts = number
        if part.refused:
            part.abandon()
            self._abandoned.append(part)
            raise OSError(f"{path.name}: {part.refused}")
        self._part, self._part_until_ns, self._part_messages = part, None, 0
        send_blueprint(part.stream, self._blueprint)
        part.stream.send_recording_name(self._name)
        for entity, archetypes in self._static.items():
            part.stream.log(entity, *archetypes, static=True)
        self._send_latched(part.stream)

    def _send_latched(self, stream: rr.RecordingStream) -> None:
        """Write latched data; those that could not be written before, at their time of arrival."""
        for entity, archetype in self._latched.items():
            self._set_times(stream, self._missed_ns.get(entity, self.wall_ns))
            stream.log(entity, archetype)
        self._missed_ns.clear()
        self._set_times(stream, self.wall_ns)

    def _set_times(self, stream: rr.RecordingStream, wall_ns: int) -> None:
        stream.set_time(entities.WALL_CLOCK, timestamp=np.datetime64(wall_ns, "ns"))
        for timeline, number in self._sequences.items():
            stream.set_time(timeline, sequence=number)

    def _enter(self, state: WriterState, reason: str) -> None:
        if state is WriterState.RECORDING:
            reason = f"{reason}; {self.lost - self._lost_before} samples were lost"
            self._lost_before = self.lost
        if state is not self.state:
            level = logging.INFO if state is WriterState.RECORDING else logging.WARNING
            LOG.log(level, "%s: %s", state.value, reason)
        self.state, self.reason = state, reason
