"""Rerun's streams: what each begins with, and what one leaves behind (rerun 0.41).

A stream that is no longer referenced keeps two threads and half a megabyte until it is swept up.
Each blueprint that is sent leaves a stream that references itself: a leak, unless disconnected.

A live stream is served, never sent: to a viewer that is not there rerun's memory would grow
without bound. Viewers join at rerun+http://HOST:PORT/proxy.
"""

from __future__ import annotations

import socket

import numpy as np
import rerun_bindings as bindings

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.recording import entities
from fasaco_edge.recording.sdk import rr, rrb

# What a viewer that joins late is shown at most; the oldest data go first.
MEMORY_LIMIT = "25MB"


class LatchedState:
    """What each part begins with: static data, newest latched data, properties, layout, times.

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
        stream.set_time(entities.WALL_CLOCK, timestamp=np.datetime64(wall_ns, "ns"))
        for timeline, number in self.sequences.items():
            stream.set_time(timeline, sequence=number)


def serve_live(recording_id: str, host: str, port: int) -> rr.RecordingStream:
    """Return a stream that serves what is logged to it at ``host``:``port``.

    Raises:
        BadConfiguration: there is no such address here, or another program listens there.
    """
    _try_address(host, port)
    stream = rr.RecordingStream(entities.APPLICATION, recording_id=recording_id)
    stream.set_log_time_enabled(False)
    stream.set_sinks(rr.GrpcServerSink(host, port, server_memory_limit=MEMORY_LIMIT))
    return stream


def _try_address(host: str, port: int) -> None:
    """Listen there for a moment: rerun does not report where it cannot."""
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        with socket.socket(family, socket.SOCK_STREAM) as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            trial.bind((host, port))
    except OSError as error:
        raise BadConfiguration(f"cannot serve at {host}:{port}: {error}") from error


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
    """Free streams that are not referenced; flushes all there are, so none may hang."""
    bindings.flush_and_cleanup_orphaned_recordings()
