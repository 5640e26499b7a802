"""What holds at a moment of a recording: each part begins with it, so that it can be read alone.

One file of a recording, from its first byte to its footer.

What rerun's streams leave behind in a process that outlives many of them (rerun 0.41).

A stream that nobody holds any more keeps two threads and half a megabyte until it is swept up.
Of each blueprint that is sent another stream stays that holds itself: for ever, if nobody
disconnects it.
"""

from __future__ import annotations

import enum
import fcntl
import logging
import os
import re
import stat
import threading
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import rerun_bindings as bindings

from fasaco_edge.host.files import open_own
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.repair import repair_recording, scan_recording
from fasaco_edge.recording.sdk import rr, rrb


class LatchedState:
    """Static data, the newest of what is latched, name, properties, layout and times.

    Attributes:
        wall_ns: the time of what is logged next [ns].
    """

    def __init__(self, name: str, blueprint: rrb.Blueprint) -> None:
        self.wall_ns = 0
        self.blueprint = blueprint
        self.name = name
        self.properties: dict[str, str] = {}
        self.static: dict[str, tuple[rr.AsComponents, ...]] = {}
        self.sequences: dict[str, int] = {}
        self._latched: dict[str, rr.AsComponents] = {}
        self._missed_ns: dict[str, int] = {}

    def latch(self, entity: str, archetype: rr.AsComponents, *, missed: bool) -> None:
        """Keep what is in force from now on; ``missed``: it was not written."""
        self._latched[entity] = archetype
        if missed:
            self._missed_ns[entity] = self.wall_ns

    def begin(self, stream: rr.RecordingStream) -> None:
        """Begin a part with all that holds."""
        send_blueprint(stream, self.blueprint)
        self.send_description(stream)
        for entity, archetypes in self.static.items():
            stream.log(entity, *archetypes, static=True)
        self.send_latched(stream)

    def send_description(self, stream: rr.RecordingStream) -> None:
        """Write name and properties."""
        stream.send_recording_name(self.name)
        if self.properties:
            stream.send_property(entities.APPLICATION, rr.AnyValues(**self.properties))

    def send_latched(self, stream: rr.RecordingStream) -> None:
        """Write what is latched, what was missed at the time it came."""
        for entity, archetype in self._latched.items():
            # What came while nothing was written is in force since then.
            self._set_times(stream, self._missed_ns.get(entity, self.wall_ns))
            stream.log(entity, archetype)
        self._missed_ns.clear()
        self.set_times(stream)

    def set_times(self, stream: rr.RecordingStream) -> None:
        """Set the times of what is logged next."""
        self._set_times(stream, self.wall_ns)

    def _set_times(self, stream: rr.RecordingStream, wall_ns: int) -> None:
        stream.set_time(entities.WALL, timestamp=np.datetime64(wall_ns, "ns"))
        for timeline, number in self.sequences.items():
            stream.set_time(timeline, sequence=number)


LOG = logging.getLogger(__name__)

# Rows gather until the writer flushes, or at most this long [s].
FLUSH_TICK_S = 10.0
# How long the disk may take for the first message of a part.
BEGIN_TIMEOUT_S = 10.0


class Flush(enum.Enum):
    """What became of what was logged."""

    DONE = "done"
    """It is handed to the disk."""
    STALLED = "stalled"
    """It takes longer than one was ready to wait."""
    BROKEN = "broken"
    """Rerun's writer has given up on the file, for good."""


class Part:
    """A file being written.

    Rerun's logging calls never fail: what became of the data only ``flush`` can tell.

    Attributes:
        refused: why the disk has not taken the first message; then only ``abandon`` is left to do.

    Raises:
        OSError: the file cannot be made.
    """

    def __init__(self, path: Path, recording_id: str) -> None:
        self.path = path
        self.refused = ""
        self._flushed_bytes = 0
        # Held while the part is written, so that no other recorder repairs it.
        self._lock = _locked(path)
        self.stream = rr.RecordingStream(
            entities.APPLICATION,
            recording_id=recording_id,
            batcher_config=rr.ChunkBatcherConfig(flush_tick=FLUSH_TICK_S),
        )
        self.stream.set_log_time_enabled(False)
        self._attach()

    def _attach(self) -> None:
        """Let rerun write to the file.

        Its call waits until the first message is on the disk: for ever, if the disk refuses that or
        stalls (rerun 0.41). So it is made on a thread, which stays behind then.
        """
        errors = list[RuntimeError]()

        def attach() -> None:
            try:
                # Without a blueprint: one given here is written before the call returns, too.
                # By its descriptor: what has that name may be another file by now.
                self.stream.set_sinks(rr.FileSink(f"/proc/self/fd/{self._lock}"))
            except RuntimeError as error:
                errors.append(error)

        thread = threading.Thread(target=attach, name="part-begins", daemon=True)
        thread.start()
        deadline = time.monotonic() + BEGIN_TIMEOUT_S
        while not self.refused:
            thread.join(0.02)
            if not thread.is_alive():
                break
            # The file's header is written before there is a writer.
            if self.size and not self._has_writer():
                self.refused = "its first message cannot be written"
            elif time.monotonic() > deadline:
                self.refused = f"its first message waits for the disk for {BEGIN_TIMEOUT_S:.0f} s"
        if errors:
            os.close(self._lock)
            raise _disk_error(errors[0], self.path) from errors[0]

    @property
    def size(self) -> int:
        """Size of the file so far [bytes]."""
        return os.fstat(self._lock).st_size

    def write_blob(self, blob: bytes, wall_ns: int) -> None:
        """Write bytes at ``wall_ns`` [ns], past what gathers."""
        time = rr.TimeColumn(entities.WALL, timestamp=np.array([wall_ns], "datetime64[ns]"))
        columns = rr.DynamicArchetype.columns(
            archetype=entities.INPUTS_ARCHETYPE,
            components={entities.INPUTS_COMPONENT: rr.components.BlobBatch([blob])},
        )
        rr.send_columns(entities.INPUTS, indexes=[time], columns=columns, recording=self.stream)

    def flush(self, timeout_s: float) -> Flush:
        """Wait up to ``timeout_s`` [s] until all that was logged is handed to the disk."""
        try:
            self.stream.flush(timeout_sec=timeout_s)
        except RuntimeError as error:
            # One type for both, and a writer that died during a flush lets it time out, too
            # (rerun 0.41).
            slow = "timed out" in str(error) and self._has_writer()
            return Flush.STALLED if slow else Flush.BROKEN
        self._flushed_bytes = self.size
        return Flush.DONE

    def close(self) -> None:
        """Write the footer and end the file; call it only after a flush that succeeded.

        What was flushed can be read without a footer, too.
        """
        self.stream.disconnect()
        if not self._has_footer():
            LOG.warning("%s: the disk did not take its end", self.path.name)
        os.close(self._lock)

    def _has_footer(self) -> bool:
        """Tell whether the file was ended; where it could not be, rerun does not say so."""
        try:
            with os.fdopen(os.dup(self._lock), "rb") as file:
                if not stat.S_ISREG(os.fstat(self._lock).st_mode):
                    return True  # what went through a pipe is gone
                scan = scan_recording(file, self._flushed_bytes)
        except OSError:
            return False
        # Behind it stands where it begins.
        return scan is not None and scan.has_footer and scan.torn_bytes > 0

    def abandon(self) -> None:
        """Save of a broken part what can be read: what was flushed, or nothing.

        Behind a frame that the disk took half of, rerun may still have written others, once there
        was room again: nothing tells them from the rest of that frame.
        The stream stays: to disconnect it, or to let go of it, may hang for ever (rerun 0.41).
        """
        os.close(self._lock)
        if not self._flushed_bytes:
            with suppress(OSError):
                self.path.unlink(missing_ok=True)
            return
        self.cut()

    def cut(self) -> None:
        """Cut a broken part again: rerun may write to it long after it has given up on it.

        A disk that refuses even that is asked again with the next call.
        """
        with suppress(OSError):
            if self.path.is_file() and self.path.stat().st_size > self._flushed_bytes:
                with open(self.path, "r+b", opener=open_own) as file:
                    file.truncate(self._flushed_bytes)
                repair_recording(self.path)

    def _has_writer(self) -> bool:
        """Tell whether rerun still holds the file open: its writer closes it when it dies."""
        file = os.fstat(self._lock)
        others = {int(name) for name in os.listdir("/proc/self/fd")} - {self._lock}
        return any(_is_same_file(descriptor, file) for descriptor in others)


def _disk_error(error: RuntimeError, path: Path) -> OSError:
    """Return what the computer said, which rerun tells in words: "... (os error 28)"."""
    number = re.search(r"\(os error (\d+)\)", str(error))
    if number is None:
        return OSError(str(error))
    return OSError(int(number[1]), os.strerror(int(number[1])), str(path))


def _is_same_file(descriptor: int, file: os.stat_result) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), file)
    except OSError:
        return False  # closed since it was listed


def _locked(path: Path) -> int:
    lock = open_own(path, os.O_RDONLY | os.O_NONBLOCK)
    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    return lock


def send_blueprint(stream: rr.RecordingStream, blueprint: rrb.Blueprint) -> None:
    """Send a blueprint as ``rr.send_blueprint`` does, and let go of what it was written with."""
    native = bindings.new_blueprint(
        application_id=entities.APPLICATION,
        make_default=False,
        make_thread_default=False,
        default_enabled=True,
    )
    written = rr.RecordingStream._from_native(native)
    written.set_time("blueprint", sequence=0)
    blueprint._log_to_stream(written)
    storage = written.memory_recording().storage
    bindings.send_blueprint(storage, True, True, recording=stream.to_native())
    written.disconnect()


def sweep() -> None:
    """Free what nobody holds any more; flushes all there are, so none may hang."""
    bindings.flush_and_cleanup_orphaned_recordings()
