"""The robot's battery: charge and power supply status of sensor_msgs/BatteryState."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import Final, Literal

from fasaco_edge.wire.messages.cdr import CdrReader, CdrWriter, read_header, refuse, write_header
from fasaco_edge.wire.schemas import BATTERY_STATE

Power = Literal["unknown", "charging", "discharging", "not charging", "full"]
POWERS: Final[tuple[Power, ...]] = (
    *("unknown", "charging", "discharging"),
    *("not charging", "full"),
)
"""Power supply statuses, by their numbers in power_supply_status."""

_FLOATS = struct.Struct("<7f")
_NAMES = (
    *("voltage", "temperature", "current", "charge", "capacity"),
    *("design_capacity", "percentage"),
)
_NO_CELLS = struct.Struct("<2I")
_CELLS = ("cell_voltage", "cell_temperature")


@dataclass(frozen=True, slots=True)
class BatteryState:
    """The state of a battery.

    Attributes:
        level: charge, from 0 to 1; None if unknown.
        power: power supply status.
        frame: name of the frame.
        stamp_ns: time [ns].
    """

    level: float | None
    power: Power = "unknown"
    frame: str = ""
    stamp_ns: int = 0


def encode_battery(state: BatteryState) -> bytes:
    """Return ``state`` as a sensor_msgs/BatteryState; other fields are NaN, for unknown."""
    writer = CdrWriter(BATTERY_STATE)
    write_header(writer, state.frame, state.stamp_ns)
    level = math.nan if state.level is None else state.level
    _check(level)
    writer.words(_FLOATS, _NAMES, *(math.nan,) * 6, level)
    # Health and technology are not known; the battery is present.
    writer.octets(bytes((POWERS.index(state.power), 0, 0, 1)))
    writer.words(_NO_CELLS, _CELLS, 0, 0)
    writer.string("", "location")
    writer.string("", "serial_number")
    return writer.payload()


def decode_battery(payload: bytes) -> BatteryState:
    """Return the battery's state in a sensor_msgs/BatteryState."""
    reader = CdrReader(payload, BATTERY_STATE)
    frame, stamp_ns = read_header(reader)
    level: float = reader.words(_FLOATS, _NAMES)[-1]
    _check(level)
    power = reader.octets(4, "power_supply_status")[0]
    if power >= len(POWERS):
        refuse(BATTERY_STATE, "power_supply_status", f"below {len(POWERS)}", power)
    for name in _CELLS:
        reader.take(4, 4 * reader.length(name, 4), name)
    for name in ("location", "serial_number"):
        reader.string(name)
    reader.end()
    return BatteryState(None if math.isnan(level) else level, POWERS[power], frame, stamp_ns)


def _check(level: float) -> None:
    if not (math.isnan(level) or 0.0 <= level <= 1.0):
        expected = "in 0..1, or NaN where it is not known"
        hint = "publish the charge as a share, 0 to 1: divide a driver's percentage by 100"
        refuse(BATTERY_STATE, "percentage", expected, level, hint)
