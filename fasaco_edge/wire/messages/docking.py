"""Goals for Nav2's docking server: the actions nav2_msgs/action/DockRobot and UndockRobot.

Sources: nav2_msgs of Jazzy and Lyrical, opennav_docking_msgs of Humble, with the same members;
results have a message from later releases of Jazzy on. ``docking_server.cpp``: a goal to dock a
docked robot, or to undock an undocked one, ends as aborted, with success and without a code.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.wire.messages.cdr import (
    HEADER_SIZE,
    CdrReader,
    CdrWriter,
    refuse,
    write_header,
    write_pose,
)
from fasaco_edge.wire.messages.follow_path import (
    ABORTED,
    CANCELED,
    LEAST_STRING_BYTES,
    SUCCEEDED,
    UNKNOWN,
)

DOCK: Final = "nav2_msgs/action/DockRobot_SendGoal"
UNDOCK: Final = "nav2_msgs/action/UndockRobot_SendGoal"
DOCK_RESULT: Final = "nav2_msgs/action/DockRobot_GetResult"
UNDOCK_RESULT: Final = "nav2_msgs/action/UndockRobot_GetResult"

ERRORS: Final = {
    901: "dock not in the database",
    902: "dock not valid",
    903: "failed to stage",
    904: "failed to detect the dock",
    905: "failed to control",
    906: "failed to charge",
    907: "timed out",
    999: "unknown error",
}
"""Codes of both actions."""

# Time limits of the server for driving to the dock, and for undocking: its own defaults [s].
STAGING_S, UNDOCKING_S = 1000.0, 30.0

_TIME = struct.Struct("<f")
_CODE = struct.Struct("<H")


@dataclass(frozen=True, slots=True)
class DockEnding:
    """How a goal of the docking server ended.

    Attributes:
        status: as in ``follow_path.Ending``.
        success: the server's value.
        code: one of ``ERRORS``, or 0.
        message: of the server, "" for none.
    """

    status: int
    success: bool
    code: int = 0
    message: str = ""

    @property
    def is_done(self) -> bool:
        """Whether the robot is where the goal asks it to be, even if it was there before."""
        is_there = self.status == ABORTED and self.success and not self.code
        return self.status == SUCCEEDED or is_there


def encode_dock(
    goal_id: bytes, dock: Pose2D, frame: str, dock_id: str = "", dock_type: str = ""
) -> bytes:
    """Return the request of DockRobot's ``send_goal``.

    Args:
        goal_id: unique bytes.
        dock: the robot's pose in the dock, in ``frame``.
        frame: of the pose.
        dock_id: of a dock in the server's database, used in place of the pose; "" for none.
        dock_type: its plugin; "" if the server has only one.
    """
    writer = CdrWriter(DOCK)
    writer.octets(goal_id)
    writer.octets(bytes([bool(dock_id)]))
    writer.string(dock_id, "dock_id")
    write_header(writer, frame, 0)
    write_pose(writer, dock, "dock_pose.pose")
    writer.string(dock_type, "dock_type")
    writer.words(_TIME, ("max_staging_time",), STAGING_S)
    # The server drives to the staging pose only from farther away than its tolerance, 0.5 m.
    writer.octets(b"\1")
    return writer.payload()


def encode_undock(goal_id: bytes, dock_type: str) -> bytes:
    """Return the request of UndockRobot's ``send_goal``."""
    writer = CdrWriter(UNDOCK)
    writer.octets(goal_id)
    writer.string(dock_type, "dock_type")
    writer.words(_TIME, ("max_undocking_time",), UNDOCKING_S)
    return writer.payload()


def decode_dock_ending(payload: bytes) -> DockEnding:
    """Return how a goal of DockRobot ended."""
    return _ending(payload, DOCK_RESULT, has_retries=True)


def decode_undock_ending(payload: bytes) -> DockEnding:
    """Return how a goal of UndockRobot ended."""
    return _ending(payload, UNDOCK_RESULT, has_retries=False)


def _ending(payload: bytes, schema: str, *, has_retries: bool) -> DockEnding:
    reader = CdrReader(payload, schema)
    status = reader.octets(1, "status")[0]
    success = reader.octets(1, "success")[0]
    if success > 1:
        refuse(schema, "success", "0 or 1", success)
    code: int = _CODE.unpack_from(payload, reader.take(2, _CODE.size, "error_code"))[0]
    if has_retries:
        reader.take(2, _CODE.size, "num_retries")
    # The header's last byte counts the padding.
    is_said = reader.remaining - payload[HEADER_SIZE - 1] > LEAST_STRING_BYTES
    message = reader.string("error_msg") if is_said else ""
    reader.end()
    if status not in (UNKNOWN, SUCCEEDED, CANCELED, ABORTED):
        refuse(schema, "status", "the status of an ended goal: 0, 4, 5 or 6", status)
    return DockEnding(status, success == 1, code, message)
