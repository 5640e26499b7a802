"""One file of a recording, from its first byte to its footer, and Rerun's streams (Rerun 0.41).

An unreferenced stream keeps two threads and half a megabyte until ``sweep``. Rerun's function that
sends a blueprint leaves a stream that references itself, a leak; ``send_blueprint`` disconnects it.
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
from fasaco_edge.recording.read.torn import repair_recording, scan_recording
from fasaco_edge.recording.sdk import rr, rrb

LOG = logging.getLogger(__name__)

# Rerun's own flush period [s]; the writer flushes more often.
FLUSH_TICK_S = 10.0
# Timeout for writing the first message of a part [s].
BEGIN_TIMEOUT_S = 10.0


class Flush(enum.Enum):
    """Result of a flush."""

    DONE = "done"
    """The data are passed to the disk."""
    STALLED = "stalled"
    """Writing takes longer than the timeout."""
    BROKEN = "broken"
    """Rerun's writer has closed the file after an error."""


class RecordingPart:
    """A file being written.

    Rerun's logging calls never fail: only ``flush`` shows whether the data were written.

    Attributes:
        refused: why the first message was not written: only ``abandon`` may follow; "" if it was.

    Raises:
        OSError: the file cannot be created.
    """

    def __init__(self, path: Path, recording_id: str) -> None:
        self.path = path
        self.refused = ""
        self._flushed_bytes = 0
        # The lock keeps other recorders from repairing the part.
        self._lock = open_own(path, os.O_RDONLY | os.O_NONBLOCK)
        fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self.stream = rr.RecordingStream(
            entities.APPLICATION,
            recording_id=recording_id,
            batcher_config=rr.ChunkBatcherConfig(flush_tick=FLUSH_TICK_S),
        )
        self.stream.set_log_time_enabled(False)
        self._attach()

    def _attach(self) -> None:
        """Let Rerun write to the file.

        ``set_sinks`` returns after the first message is written, and never if the disk fails or
        stalls (Rerun 0.41). So a thread calls it, which is abandoned in that case.
        """
        errors = list[RuntimeError]()

        def attach() -> None:
            try:
                # No blueprint: ``set_sinks`` would wait for that, too.
                # The path names the descriptor, as another file may have the name by now.
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
            # If the file has a header and no writer, the writer has died.
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

    @property
    def is_deleted(self) -> bool:
        """Whether the file was unlinked, so that closing it deletes the data."""
        return os.fstat(self._lock).st_nlink == 0

    def write_blob(self, blob: bytes, wall_ns: int, entity: str = entities.INPUTS) -> None:
        """Write bytes of an entity at ``wall_ns`` [ns], without batching."""
        time = rr.TimeColumn(entities.WALL_CLOCK, timestamp=np.array([wall_ns], "datetime64[ns]"))
        columns = rr.DynamicArchetype.columns(
            archetype=entities.INPUTS_ARCHETYPE,
            components={entities.INPUTS_COMPONENT: rr.components.BlobBatch([blob])},
        )
        rr.send_columns(entity, indexes=[time], columns=columns, recording=self.stream)

    def flush(self, timeout_s: float) -> Flush:
        """Wait up to ``timeout_s`` [s] until all logged data are passed to the disk."""
        try:
            self.stream.flush(timeout_sec=timeout_s)
        except RuntimeError as error:
            # A dead writer and a slow disk raise the same exception (Rerun 0.41).
            slow = "timed out" in str(error) and self._has_writer()
            return Flush.STALLED if slow else Flush.BROKEN
        self._flushed_bytes = self.size
        return Flush.DONE

    def close(self) -> None:
        """Write the footer and close the file; call it only after a successful flush."""
        self.stream.disconnect()
        if not self._has_footer():
            LOG.warning("%s: its footer could not be written", self.path.name)
        os.close(self._lock)

    def _has_footer(self) -> bool:
        """Return whether the file has its footer: Rerun does not report a failure."""
        try:
            with os.fdopen(os.dup(self._lock), "rb") as file:
                if not stat.S_ISREG(os.fstat(self._lock).st_mode):
                    return True  # data sent through a pipe cannot be read back
                scan = scan_recording(file, self._flushed_bytes)
        except OSError:
            return False
        # The footer is followed by its offset in the file.
        return scan is not None and scan.has_footer and scan.torn_bytes > 0

    def abandon(self) -> None:
        """Truncate a broken part to its flushed data.

        Frames that Rerun wrote after a partly written frame cannot be distinguished from the rest
        of that frame. The stream stays open: disconnecting or releasing it may hang (Rerun 0.41).
        """
        os.close(self._lock)
        if not self._flushed_bytes:
            with suppress(OSError):
                self.path.unlink(missing_ok=True)
            return
        self.cut()

    def cut(self) -> None:
        """Truncate a broken part again, as Rerun may write to it much later; retry on failure."""
        with suppress(OSError):
            if self.path.is_file() and self.path.stat().st_size > self._flushed_bytes:
                with open(self.path, "r+b", opener=open_own) as file:
                    file.truncate(self._flushed_bytes)
                repair_recording(self.path)

    def _has_writer(self) -> bool:
        """Return whether Rerun's writer is alive: it closes the file when it dies."""
        file = os.fstat(self._lock)
        others = {int(name) for name in os.listdir("/proc/self/fd")} - {self._lock}
        return any(_is_same_file(descriptor, file) for descriptor in others)


def _disk_error(error: RuntimeError, path: Path) -> OSError:
    """Return the system's error from Rerun's text: "... (os error 28)"."""
    number = re.search(r"\(os error (\d+)\)", str(error))
    if number is None:
        return OSError(str(error))
    return OSError(int(number[1]), os.strerror(int(number[1])), str(path))


def _is_same_file(descriptor: int, file: os.stat_result) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), file)
    except OSError:
        return False  # closed since it was listed


def send_blueprint(stream: rr.RecordingStream, blueprint: rrb.Blueprint) -> None:
    """Send a blueprint as ``rr.send_blueprint`` does, and release its stream."""
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
    """Free unreferenced streams. This flushes all streams: call it only if no writer hangs."""
    bindings.flush_and_cleanup_orphaned_recordings()
