"""The mission's commands as ROS 2 services: std_srvs/srv/Trigger, requests in, responses out.

Sources: rmw_zenoh_cpp at commit 5347477 (``rmw_service_data.cpp``: a response carries the number
and the gid of its request), std_srvs of Jazzy. A type without members takes one byte in CDR.
"""

from __future__ import annotations

from typing import Final, Literal

from fasaco_edge.wire.messages.cdr import CdrReader, CdrWriter, clipped
from fasaco_edge.wire.ros_keys import TRIGGER, attachment, attachment_of

Triggered = Literal["start", "pause", "resume", "home", "cancel"]
TRIGGERED: Final[tuple[Triggered, ...]] = ("start", "pause", "resume", "home", "cancel")
"""Commands without parameters; ``start`` covers everything reachable."""


def check_request(payload: bytes) -> None:
    """Check the request of a Trigger."""
    reader = CdrReader(payload, TRIGGER)
    reader.octets(1, "request")
    reader.end()


def encode_response(message: str, *, success: bool) -> bytes:
    """Return the response of a Trigger."""
    writer = CdrWriter(TRIGGER)
    writer.octets(bytes((success,)))
    writer.string(clipped(message), "message")
    return writer.payload()


def response_attachment(request: bytes, time_ns: int) -> bytes:
    """Return rmw_zenoh's attachment of a response, at a time [ns]; b"" for other clients.

    ``request``: the attachment of the request.
    """
    parts = attachment_of(request)
    return attachment(parts[0], time_ns, parts[1]) if parts else b""
