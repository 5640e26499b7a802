"""Velocities for the robot's base: geometry_msgs/Twist and TwistStamped."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.wire.messages.cdr import CdrReader, CdrWriter, read_header, refuse, write_header
from fasaco_edge.wire.schemas import TWIST, TWIST_SCHEMAS, TWIST_STAMPED

_TWIST = struct.Struct("<6d")
_NAMES = tuple(f"{part}.{axis}" for part in ("linear", "angular") for axis in "xyz")


@dataclass(frozen=True, slots=True)
class Velocity:
    """Velocity of a differential-drive base; the other four numbers of a twist are 0.

    Attributes:
        speed_m_s: forward [m/s].
        turn_rad_s: counter-clockwise [rad/s].
        frame: of a TwistStamped, the robot's own; "" for a Twist.
        stamp_ns: of a TwistStamped [ns]; 0 for a Twist.
    """

    speed_m_s: float
    turn_rad_s: float
    frame: str = ""
    stamp_ns: int = 0


def encode_velocity(velocity: Velocity, schema: str = TWIST) -> bytes:
    """Return ``velocity`` as a message of type ``schema``, one of ``TWIST_SCHEMAS``."""
    _check_schema(schema)
    writer = CdrWriter(schema)
    if schema == TWIST_STAMPED:
        write_header(writer, velocity.frame, velocity.stamp_ns)
    numbers = (velocity.speed_m_s, 0.0, 0.0, 0.0, 0.0, velocity.turn_rad_s)
    _check(numbers, schema)
    writer.doubles(_TWIST, *numbers)
    return writer.payload()


def decode_velocity(payload: bytes, schema: str = TWIST) -> Velocity:
    """Return the velocity in a message of type ``schema``, one of ``TWIST_SCHEMAS``."""
    _check_schema(schema)
    reader = CdrReader(payload, schema)
    frame, stamp_ns = read_header(reader) if schema == TWIST_STAMPED else ("", 0)
    numbers = reader.doubles(_TWIST, "twist")
    reader.end()
    _check(numbers, schema)
    return Velocity(numbers[0], numbers[5], frame, stamp_ns)


def _check_schema(schema: str) -> None:
    if schema not in TWIST_SCHEMAS:
        known = " or ".join(TWIST_SCHEMAS)
        raise MalformedMessage(
            f"a velocity must come as {known}, got {schema!r}",
            hint="publish one of these types, and name it in the encoding",
        )


def _check(numbers: tuple[float, ...], schema: str) -> None:
    before = "twist." if schema == TWIST_STAMPED else ""
    for name, value in zip(_NAMES, numbers, strict=True):
        if not math.isfinite(value):
            refuse(schema, before + name, "a finite number", value)
