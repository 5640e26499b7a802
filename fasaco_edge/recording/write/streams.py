"""Rerun's streams: their initial data, and their leaks (rerun 0.41).

A stream that is no longer referenced keeps two threads and half a megabyte until ``sweep``. Each
blueprint that is sent leaves a stream that references itself: a leak, unless disconnected.

A live stream is served, never sent: without a viewer at the other end rerun's memory would grow
without bound. Viewers join at rerun+http://HOST:PORT/proxy.
"""

from __future__ import annotations

import socket

import numpy as np
import rerun_bindings as bindings

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.recording import entities
from fasaco_edge.recording.sdk import rr, rrb

# Limit on the data kept for a viewer that joins late; the oldest are dropped first.
MEMORY_LIMIT = "25MB"


class LatchedState:
    """Initial data of each part: static data, newest latched data, properties, layout, times.

    Attributes:
        wall_ns: the time of the next log call [ns].
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
        """Keep data in force from now on; ``missed``: they were not written."""
        self._latched[entity] = archetype
        if missed:
            self._missed_ns[entity] = self.wall_ns

    def begin(self, stream: rr.RecordingStream) -> None:
        """Begin a part with all data in force."""
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
        """Write latched data, missed ones at their time of arrival."""
        for entity, archetype in self._latched.items():
            # Data that arrived while nothing was written are in force since then.
            self._set_times(stream, self._missed_ns.get(entity, self.wall_ns))
            stream.log(entity, archetype)
        self._missed_ns.clear()
        self.set_times(stream)

    def set_times(self, stream: rr.RecordingStream) -> None:
        """Set the times of the next log calls."""
        self._set_times(stream, self.wall_ns)

    def _set_times(self, stream: rr.RecordingStream, wall_ns: int) -> None:
        stream.set_time(entities.WALL_CLOCK, timestamp=np.datetime64(wall_ns, "ns"))
        for timeline, number in self.sequences.items():
            stream.set_time(timeline, sequence=number)


def serve_live(recording_id: str, host: str, port: int) -> rr.RecordingStream:
    """Return a stream that serves its data at ``host``:``port``.

    Raises:
        BadConfiguration: there is no such address here, or another program listens there.
    """
    _try_address(host, port)
    stream = rr.RecordingStream(entities.APPLICATION, recording_id=recording_id)
    stream.set_log_time_enabled(False)
    stream.set_sinks(rr.GrpcServerSink(host, port, server_memory_limit=MEMORY_LIMIT))
    return stream


def _try_address(host: str, port: int) -> None:
    """Listen there for a moment: rerun does not report failure to listen."""
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        with socket.socket(family, socket.SOCK_STREAM) as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            trial.bind((host, port))
    except OSError as error:
        raise BadConfiguration(
            f"cannot serve at {host}:{port}: {error}",
            hint="give an address of this computer, and a port that no program listens at",
        ) from error


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
    """Free unreferenced streams; flushes all streams, so none may hang."""
    bindings.flush_and_cleanup_orphaned_recordings()
