"""Report of a follower to the daemon: what keeps the robot from driving its path, and where.

The follower, a small program without msgspec, has its own writer of the same members.
"""

from __future__ import annotations

from typing import Annotated, Final

import msgspec
from msgspec import Meta

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.wire.documents.json_text import (
    OF_JSON,
    Amount,
    Coordinate,
    Count,
    Text,
    ZenohId,
    allowed,
    decode_document,
)
from fasaco_edge.wire.limits import MAX_BLOCKED_POINTS

REASONS: Final = ("obstacle", "stuck", "elsewhere")


class Blocked(msgspec.Struct, frozen=True, kw_only=True):
    """What keeps the robot from driving its path.

    Attributes:
        daemon: Zenoh id of the daemon that published the path.
        revision: revision of the path; 0 if unknown.
        reason: obstacle: something is ahead that the map does not show; stuck: the robot does not
            move as commanded, or its controller has given up; elsewhere: it cannot join the path.
        detail: the reason in words.
        held_s: how long the robot has been kept from driving [s].
        frame: frame of the places.
        x, y: where the robot is [m].
        points: places x, y of what is ahead [m], the nearest first; none for elsewhere.
    """

    daemon: ZenohId
    revision: Count
    reason: Annotated[str, allowed(enum=REASONS)]
    detail: Text
    held_s: Amount
    frame: Text
    x: Coordinate
    y: Coordinate
    points: Annotated[
        tuple[tuple[Coordinate, Coordinate], ...], Meta(max_length=MAX_BLOCKED_POINTS)
    ]


def decode_blocked(payload: bytes) -> Blocked:
    """Return the report in ``payload``.

    Raises:
        MalformedMessage: the payload is not a report, or its reason is unknown.
    """
    report = decode_document(payload, Blocked)
    if report.reason not in REASONS:
        expected = ", ".join(REASONS)
        text = f"blocked: reason must be one of {expected}, got {report.reason!r}"
        raise MalformedMessage(text, hint=OF_JSON)
    return report
