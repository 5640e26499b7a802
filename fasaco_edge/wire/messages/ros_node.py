"""Messages of the daemon's ROS 2 node alone: commands as services, its status as diagnostics.

The services are std_srvs/srv/Trigger, the status is a diagnostic_msgs/DiagnosticArray. Sources:
rmw_zenoh_cpp at commit 5347477 (``rmw_service_data.cpp``: a response carries the number and the gid
of its request), std_srvs of Jazzy. A type without members takes one byte in CDR.
"""

from __future__ import annotations

from typing import Final, Literal

from fasaco_edge.states import row_of
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.messages.cdr import CdrReader, CdrWriter, clipped, write_header
from fasaco_edge.wire.ros_keys import TRIGGER, attachment, attachment_of
from fasaco_edge.wire.schemas import DIAGNOSTIC_ARRAY

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


OK, WARN, ERROR, STALE = range(4)
"""Levels of diagnostics; a daemon that does not plan is STALE."""
IN_ORDER: Final = ("starting", "recording", "stopping")
"""The states of a recorder that are OK."""


def level_of(status: Status) -> int:
    """Return the diagnostic level of a status: ``OK``, ``WARN``, ``ERROR`` or ``STALE``."""
    if status.claim.stand != "plans":
        return STALE
    level = row_of(status.state).level
    recorder = status.recorder
    is_recorded = recorder is None or recorder.state in IN_ORDER
    is_faulty = status.troubles or status.ledger.fault or not is_recorded
    return max(level, WARN) if is_faulty else level


def message_of(status: Status) -> str:
    """Return state, reason and troubles of a status in a line."""
    parts = [f"{status.state}: {status.reason}"]
    # The reason of a degraded mission is one of the troubles.
    parts += [each.text for each in status.troubles if each.text != status.reason]
    return "; ".join(parts)


def values_of(status: Status) -> dict[str, str]:
    """Return the figures of a status by their names."""
    values = {"state": status.state, "reason": status.reason}
    if status.coverage is not None:
        values["covered"] = f"{status.coverage.fraction:.4f}"
        values["cells left"] = str(status.coverage.remaining)
    if status.floor is not None:
        values["swept [m2]"] = f"{status.floor.swept_m2:.1f}"
    if status.path is not None:
        values["steps to drive"] = str(status.path.remaining_steps)
    if status.battery is not None and status.battery.level is not None:
        values["battery"] = f"{status.battery.level:.3f}"
    values["refused messages"] = str(status.errors.total)
    if status.errors.last:
        values["last refused"] = status.errors.last
    if status.ledger.fault:
        values["ledger"] = status.ledger.fault
    if status.recorder is not None:
        values["recorder"] = status.recorder.state
    for trouble in status.troubles:
        since = f"for {trouble.since_s:.0f} s"
        values[f"trouble {trouble.code}"] = f"{trouble.text} ({since}): {trouble.do}"
    return values


def encode_diagnostics(status: Status, node: str, stamp_ns: int) -> bytes:
    """Return a status as a diagnostic_msgs/DiagnosticArray of the node ``node``, at a time [ns]."""
    writer = CdrWriter(DIAGNOSTIC_ARRAY)
    write_header(writer, "", stamp_ns)
    writer.uint32(1, "length of status")
    writer.octets(bytes((level_of(status),)))
    values = values_of(status)
    for name, text in (
        ("name", f"{node}: mission"),
        ("message", message_of(status)),
        ("hardware_id", status.robot),
    ):
        writer.string(clipped(text), name)
    writer.uint32(len(values), "length of values")
    for key, value in values.items():
        writer.string(key, "key")
        writer.string(clipped(value), "value")
    return writer.payload()
