"""Messages of the robot's base, for a small program: laser scans in, velocities out.

A scan is ranges and angles of sensor_msgs/LaserScan. By REP 117, a range may be infinite (nothing
in reach), minus infinite (too near to measure) or NaN (the measurement failed): such a message is
valid. Intensities are not used. A velocity is a geometry_msgs/Twist, or a TwistStamped.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.wire.limits import MAX_SCAN_BEAMS, MAX_SCAN_SPAN_RAD
from fasaco_edge.wire.messages.cdr import CdrReader, CdrWriter, read_header, refuse, write_header
from fasaco_edge.wire.schemas import LASER_SCAN, TWIST, TWIST_SCHEMAS, TWIST_STAMPED

_FLOATS = struct.Struct("<7f")
_NAMES = (
    *("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time"),
    *("range_min", "range_max"),
)
# Indices of the numbers that are used.
_FIRST, _STEP, _LEAST, _MOST = 0, 2, 5, 6
_IN_RADIANS = "publish angles in radians, not in degrees"


@dataclass(frozen=True, slots=True)
class LaserScan:
    """A scan.

    Attributes:
        first_rad: direction of the first beam in the sensor's frame, counter-clockwise [rad].
        step_rad: from one beam to the next [rad]; negative for a scan that turns clockwise.
        least_m, most_m: shortest and longest range that the sensor measures [m].
        ranges: ranges of the beams, in order [m]; a value outside ``least_m`` to ``most_m`` is no
            range.
        frame: name of the sensor's frame.
        stamp_ns: time of the first beam [ns].
    """

    first_rad: float
    step_rad: float
    least_m: float
    most_m: float
    ranges: tuple[float, ...]
    frame: str = ""
    stamp_ns: int = 0


def encode_scan(scan: LaserScan) -> bytes:
    """Return ``scan`` as a sensor_msgs/LaserScan, without times of beams and intensities."""
    writer = CdrWriter(LASER_SCAN)
    write_header(writer, scan.frame, scan.stamp_ns)
    count = len(scan.ranges)
    last_rad = scan.first_rad + scan.step_rad * max(count - 1, 0)
    floats = (scan.first_rad, last_rad, scan.step_rad, 0.0, 0.0, scan.least_m, scan.most_m)
    _check(floats, count)
    writer.words(_FLOATS, _NAMES, *floats)
    writer.uint32(count, "length of ranges")
    writer.words(struct.Struct(f"<{count}f"), ("ranges",) * count, *scan.ranges)
    writer.uint32(0, "length of intensities")
    return writer.payload()


def decode_scan(payload: bytes) -> LaserScan:
    """Return the scan in a sensor_msgs/LaserScan.

    Raises:
        MalformedMessage: it is not such a message, has no beams or more than ``MAX_SCAN_BEAMS``, or
            its angles or its limits of ranges are invalid.
    """
    reader = CdrReader(payload, LASER_SCAN)
    frame, stamp_ns = read_header(reader)
    floats = reader.words(_FLOATS, _NAMES)
    count = reader.length("ranges", 4)
    _check(floats, count)
    start = reader.take(4, 4 * count, "ranges")
    ranges = struct.unpack_from(f"<{count}f", payload, start)
    reader.take(4, 4 * reader.length("intensities", 4), "intensities")
    reader.end()
    return LaserScan(
        floats[_FIRST], floats[_STEP], floats[_LEAST], floats[_MOST], ranges, frame, stamp_ns
    )


def _check(floats: tuple[float, ...], count: int) -> None:
    for index in (_FIRST, _STEP, _LEAST, _MOST):
        if not math.isfinite(floats[index]):
            refuse(LASER_SCAN, _NAMES[index], "a finite number", floats[index])
    if not 1 <= count <= MAX_SCAN_BEAMS:
        refuse(LASER_SCAN, "length of ranges", f"1..{MAX_SCAN_BEAMS}", count)
    if abs(floats[_FIRST]) > MAX_SCAN_SPAN_RAD:
        expected = f"within {MAX_SCAN_SPAN_RAD:g} of 0"
        refuse(LASER_SCAN, "angle_min", expected, floats[_FIRST], _IN_RADIANS)
    span = abs(floats[_STEP]) * (count - 1)
    if span > MAX_SCAN_SPAN_RAD or (count > 1 and floats[_STEP] == 0.0):
        expected = f"not 0, and at most {MAX_SCAN_SPAN_RAD:g} over all beams"
        refuse(LASER_SCAN, "angle_increment", expected, floats[_STEP], _IN_RADIANS)
    if not 0.0 <= floats[_LEAST] < floats[_MOST]:
        expected = f"at least 0 and below range_max, {floats[_MOST]:g}"
        refuse(LASER_SCAN, "range_min", expected, floats[_LEAST])


_TWIST = struct.Struct("<6d")
_TWIST_NAMES = tuple(f"{part}.{axis}" for part in ("linear", "angular") for axis in "xyz")


@dataclass(frozen=True, slots=True)
class Velocity:
    """Velocity of a differential-drive base; the other four numbers of a twist are 0.

    Attributes:
        speed_m_s: forward [m/s].
        turn_rad_s: counter-clockwise [rad/s].
        frame: frame of a TwistStamped, the robot's own; "" for a Twist.
        stamp_ns: stamp of a TwistStamped [ns]; 0 for a Twist.
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
    _check_numbers(numbers, schema)
    writer.doubles(_TWIST, *numbers)
    return writer.payload()


def decode_velocity(payload: bytes, schema: str = TWIST) -> Velocity:
    """Return the velocity in a message of type ``schema``, one of ``TWIST_SCHEMAS``."""
    _check_schema(schema)
    reader = CdrReader(payload, schema)
    frame, stamp_ns = read_header(reader) if schema == TWIST_STAMPED else ("", 0)
    numbers = reader.doubles(_TWIST, "twist")
    reader.end()
    _check_numbers(numbers, schema)
    return Velocity(numbers[0], numbers[5], frame, stamp_ns)


def _check_schema(schema: str) -> None:
    if schema not in TWIST_SCHEMAS:
        known = " or ".join(TWIST_SCHEMAS)
        raise MalformedMessage(
            f"a velocity must come as {known}, got {schema!r}",
            hint="publish one of these types, and name it in the encoding",
        )


def _check_numbers(numbers: tuple[float, ...], schema: str) -> None:
    before = "twist." if schema == TWIST_STAMPED else ""
    for name, value in zip(_TWIST_NAMES, numbers, strict=True):
        if not math.isfinite(value):
            refuse(schema, before + name, "a finite number", value)
