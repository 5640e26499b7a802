"""What is recorded, for viewers that come and go: they join at rerun+http://HOST:PORT/proxy.

Served, never sent: to a viewer that is not there rerun's memory would grow without bound.
"""

from __future__ import annotations

import socket

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.recording import entities
from fasaco_edge.recording.sdk import rr

# What a viewer that joins late is shown; older data go first.
MEMORY_LIMIT = "25MB"


def serve_live(recording_id: str, host: str, port: int) -> rr.RecordingStream:
    """Return a stream that serves what is logged to it at ``host``:``port``.

    Raises:
        BadConfiguration: there is no such address here, or somebody else listens there.
    """
    _try_address(host, port)
    stream = rr.RecordingStream(entities.APPLICATION, recording_id=recording_id)
    stream.set_log_time_enabled(False)
    stream.set_sinks(rr.GrpcServerSink(host, port, server_memory_limit=MEMORY_LIMIT))
    return stream


def _try_address(host: str, port: int) -> None:
    """Listen there for a moment: rerun says nothing where it cannot."""
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        with socket.socket(family, socket.SOCK_STREAM) as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            trial.bind((host, port))
    except OSError as error:
        raise BadConfiguration(f"cannot serve at {host}:{port}: {error}") from error
