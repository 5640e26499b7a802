"""Rerun's streams: their initial data, and how their memory is freed (Rerun 0.41).

An unreferenced stream keeps two threads and half a megabyte until ``sweep``. Rerun's function that
sends a blueprint leaves a stream that references itself, a leak; ``send_blueprint`` disconnects it.
"""

from __future__ import annotations

import numpy as np
import rerun_bindings as bindings

from fasaco_edge.recording import entities
from fasaco_edge.recording.sdk import rr, rrb


class LatchedState:
    """Initial data of each part: static data, newest latched data, name, blueprint, times.

    Attributes:
        wall_ns: the time of the next log call [ns].
    """

    def __init__(self, name: str, blueprint: rrb.Blueprint) -> None:
        self.wall_ns = 0
        self.blueprint = blueprint
        self.name = name
        self.static: dict[str, tuple[rr.AsComponents, ...]] = {}
        self.sequences: dict[str, int] = {}
        self._latched: dict[str, rr.AsComponents] = {}
        self._missed_ns: dict[str, int] = {}

    def latch(self, entity: str, archetype: rr.AsComponents, *, missed: bool) -> None:
        """Set the data in force of an entity; ``missed``: whether they could not be written."""
        self._latched[entity] = archetype
        if missed:
            self._missed_ns[entity] = self.wall_ns

    def begin(self, stream: rr.RecordingStream) -> None:
        """Write all data in force to a new part."""
        send_blueprint(stream, self.blueprint)
        stream.send_recording_name(self.name)
        for entity, archetypes in self.static.items():
            stream.log(entity, *archetypes, static=True)
        self.send_latched(stream)

    def send_latched(self, stream: rr.RecordingStream) -> None:
        """Write latched data; those that could not be written before, at their time of arrival."""
        for entity, archetype in self._latched.items():
            self._set_times(stream, self._missed_ns.get(entity, self.wall_ns))
            stream.log(entity, archetype)
        self._missed_ns.clear()
        self.set_times(stream)

    def set_times(self, stream: rr.RecordingStream) -> None:
        """Set the times of the next log calls in a stream."""
        self._set_times(stream, self.wall_ns)

    def _set_times(self, stream: rr.RecordingStream, wall_ns: int) -> None:
        stream.set_time(entities.WALL_CLOCK, timestamp=np.datetime64(wall_ns, "ns"))
        for timeline, number in self.sequences.items():
            stream.set_time(timeline, sequence=number)


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
