"""Messages as anybody may write them: plain CDR without a single check.

The project's own encoders refuse what its decoders would; these do not, so that a value one ulp
beyond a limit gets as far as the daemon.
"""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.wire import schemas

SECOND_NS = 10**9
POSE_SCHEMAS = {
    "PoseStamped": schemas.POSE_STAMPED,
    "PoseWithCovarianceStamped": schemas.POSE_WITH_COVARIANCE_STAMPED,
    "Odometry": schemas.ODOMETRY,
}
# What follows the pose: covariance; and twist with its own.
_BEHIND = {"PoseStamped": 0, "PoseWithCovarianceStamped": 36, "Odometry": 36 + 6 + 36}


class _Writer:
    def __init__(self) -> None:
        self._bytes = bytearray()

    def put(self, layout: str, *values: Any) -> None:
        """Append numbers of one size, aligned to it."""
        size = struct.calcsize("<" + layout[-1])
        self._bytes += bytes(-len(self._bytes) % size)
        self._bytes += struct.pack("<" + layout, *values)

    def text(self, text: str) -> None:
        raw = text.encode() + b"\0"
        self.put("I", len(raw))
        self._bytes += raw

    def header(self, frame: str, stamp_ns: int) -> None:
        seconds, rest = divmod(stamp_ns, SECOND_NS)
        self.put("i", seconds)
        self.put("I", rest)
        self.text(frame)

    def place(self, x: float, y: float, yaw: float) -> None:
        self.put("7d", x, y, 0.0, 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))

    def cells(self, cells: NDArray[np.int8]) -> None:
        self.put("I", cells.size)
        self._bytes += cells.tobytes()

    def payload(self) -> bytes:
        return b"\0\1\0\0" + bytes(self._bytes)


def pose(event: dict[str, Any]) -> bytes:
    """Return a pose of the type that the event names."""
    writer = _Writer()
    writer.header(event["frame"], event["stamp"])
    if event["type"] == "Odometry":
        writer.text("base_link")
    writer.place(event["x"], event["y"], event["yaw"])
    if behind := _BEHIND[event["type"]]:
        writer.put(f"{behind}d", *(0.0,) * behind)
    return writer.payload()


def transform(event: dict[str, Any]) -> bytes:
    """Return a tf2_msgs/TFMessage with one link."""
    writer = _Writer()
    writer.put("I", 1)
    writer.header(event["frame"], event["stamp"])
    writer.text(event["child"])
    writer.place(event["x"], event["y"], event["yaw"])
    return writer.payload()


def occupancy_grid(event: dict[str, Any], pixels: NDArray[np.int8]) -> bytes:
    """Return a nav_msgs/OccupancyGrid."""
    writer = _Writer()
    writer.header(event["frame"], event["stamp"])
    writer.put("i", 0)
    writer.put("I", 0)
    writer.put("f", event["resolution"])
    writer.put("II", pixels.shape[1], pixels.shape[0])
    writer.place(event["x"], event["y"], event["yaw"])
    writer.cells(pixels)
    return writer.payload()


def update(event: dict[str, Any]) -> bytes:
    """Return a map_msgs/OccupancyGridUpdate, all of one value."""
    writer = _Writer()
    writer.header(event["frame"], event["stamp"])
    writer.put("ii", event["col"], event["row"])
    writer.put("II", event["cols"], event["rows"])
    writer.cells(np.full((event["rows"], event["cols"]), event["value"], np.int8))
    return writer.payload()
