"""Goals for Nav2: the actions FollowPath of its controller, DockRobot and UndockRobot.

Sources: nav2_msgs of Humble, Iron, Jazzy and Lyrical (FollowPath.action), action_msgs of Jazzy. A
type without members takes one byte in CDR. Of docking: nav2_msgs of Jazzy and Lyrical,
opennav_docking_msgs of Humble, with the same members; results have a message from later releases of
Jazzy on. ``docking_server.cpp``: a goal to dock a docked robot, or to undock an undocked one, ends
as aborted, with success and without a code.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from fasaco_edge.grid.geometry import Point, Pose2D
from fasaco_edge.wire.limits import MAX_PATH_POSES
from fasaco_edge.wire.messages.cdr import (
    HEADER_SIZE,
    CdrReader,
    CdrWriter,
    refuse,
    write_header,
    write_pose,
)

SEND_GOAL: Final = "nav2_msgs/action/FollowPath_SendGoal"
GET_RESULT: Final = "nav2_msgs/action/FollowPath_GetResult"
CANCEL_GOAL: Final = "action_msgs/srv/CancelGoal"

GOAL_ID_BYTES = 16
UNKNOWN, SUCCEEDED, CANCELED, ABORTED = 0, 4, 5, 6
"""Statuses of action_msgs/GoalStatus that a result may have."""
TAKEN, REJECTED, NO_SUCH_GOAL, ENDED_BEFORE = 0, 1, 2, 3
"""Result of a request to cancel."""

ERRORS: Final = {
    100: "unknown error",
    101: "invalid controller",
    102: "transform error",
    103: "invalid path",
    104: "patience exceeded",
    105: "failed to make progress",
    106: "no valid control",
    107: "controller timed out",
}
"""Codes of FollowPath."""

_STAMP = struct.Struct("<iI")
_ERROR = struct.Struct("<H")
# An empty string has its length and a NUL, and is longer than padding.
LEAST_STRING_BYTES = 4


@dataclass(frozen=True, slots=True)
class Ending:
    """How a goal ended.

    Attributes:
        status: ``UNKNOWN``, ``SUCCEEDED``, ``CANCELED`` or ``ABORTED``.
        code: one of ``ERRORS``, or 0; Humble has none.
        message: of the server, "" for none; only from Jazzy on.
    """

    status: int
    code: int = 0
    message: str = ""


def encode_goal(
    goal_id: bytes,
    points: Sequence[Point],
    frame: str,
    stamp_ns: int,
    plugins: Sequence[str],
    end_yaw: float | None = None,
    *,
    is_back: bool = False,
) -> bytes:
    """Return the request of ``send_goal``.

    Args:
        goal_id: ``GOAL_ID_BYTES`` unique bytes.
        points: of the path [m], at least two; each pose faces the next one, or away from it.
        frame: of the points.
        stamp_ns: of the path [ns]; 0 for the newest transform.
        plugins: as many names as the server's release has, see ``ros_keys.RELEASES``.
        end_yaw: heading of the last pose [rad]; None for the previous pose's heading.
        is_back: whether poses face away from the next one: the robot drives backward.
    """
    writer = CdrWriter(SEND_GOAL)
    writer.octets(goal_id)
    write_header(writer, frame, stamp_ns)
    if not 2 <= len(points) <= MAX_PATH_POSES:
        refuse(SEND_GOAL, "length of poses", f"2..{MAX_PATH_POSES}", len(points))
    writer.uint32(len(points), "length of poses")
    yaw = 0.0
    for index, (x, y) in enumerate(points):
        if index + 1 < len(points):
            to = points[index + 1]
            yaw = math.atan2(to[1] - y, to[0] - x)
            yaw = math.remainder(yaw + math.pi, math.tau) if is_back else yaw
        elif end_yaw is not None:
            yaw = end_yaw
        write_header(writer, frame, stamp_ns)
        write_pose(writer, Pose2D(x, y, yaw), f"poses[{index}].pose")
    for name in plugins:
        writer.string(name, "name of a plugin")
    return writer.payload()


def decode_accepted(payload: bytes) -> bool:
    """Return whether a goal was accepted, by the response of ``send_goal``."""
    reader = CdrReader(payload, SEND_GOAL)
    accepted = _truth(reader.octets(1, "accepted")[0])
    reader.words(_STAMP, ("stamp.sec", "stamp.nanosec"))
    reader.end()
    return accepted


def encode_goal_id(goal_id: bytes) -> bytes:
    """Return the request of ``get_result``."""
    writer = CdrWriter(GET_RESULT)
    writer.octets(goal_id)
    return writer.payload()


def decode_ending(payload: bytes) -> Ending:
    """Return how a goal ended, by the response of ``get_result`` of any release."""
    reader = CdrReader(payload, GET_RESULT)
    status = reader.octets(1, "status")[0]
    reader.octets(1, "result")
    code, message = 0, ""
    # Humble's result ends here; the header's last byte counts its padding.
    padding = payload[HEADER_SIZE - 1]
    if reader.remaining - padding >= _ERROR.size:
        code = _ERROR.unpack_from(payload, reader.take(2, _ERROR.size, "error_code"))[0]
    if reader.remaining - padding > LEAST_STRING_BYTES:
        message = reader.string("error_msg")
    reader.end()
    if status not in (UNKNOWN, SUCCEEDED, CANCELED, ABORTED):
        refuse(GET_RESULT, "status", "the status of an ended goal: 0, 4, 5 or 6", status)
    return Ending(status, code, message)


def encode_cancel(goal_id: bytes) -> bytes:
    """Return the request of ``cancel_goal`` for one goal."""
    writer = CdrWriter(CANCEL_GOAL)
    writer.octets(goal_id)
    writer.words(_STAMP, ("stamp.sec", "stamp.nanosec"), 0, 0)
    return writer.payload()


def decode_cancel(payload: bytes) -> int:
    """Return the result of a request to cancel."""
    reader = CdrReader(payload, CANCEL_GOAL)
    code = reader.octets(1, "return_code")[0]
    for index in range(reader.length("goals_canceling", GOAL_ID_BYTES + _STAMP.size)):
        reader.octets(GOAL_ID_BYTES, f"goals_canceling[{index}].goal_id")
        reader.words(_STAMP, ("stamp.sec", "stamp.nanosec"))
    reader.end()
    return code


def _truth(value: int) -> bool:
    if value > 1:
        refuse(SEND_GOAL, "accepted", "0 or 1", value)
    return value == 1


DOCK: Final = "nav2_msgs/action/DockRobot_SendGoal"
UNDOCK: Final = "nav2_msgs/action/UndockRobot_SendGoal"
DOCK_RESULT: Final = "nav2_msgs/action/DockRobot_GetResult"
UNDOCK_RESULT: Final = "nav2_msgs/action/UndockRobot_GetResult"

DOCK_ERRORS: Final = {
    901: "dock not in the database",
    902: "dock not valid",
    903: "failed to stage",
    904: "failed to detect the dock",
    905: "failed to control",
    906: "failed to charge",
    907: "timed out",
    999: "unknown error",
}
"""Codes of DockRobot and UndockRobot."""

# Time limits of the server for driving to the dock, and for undocking: its own defaults [s].
STAGING_S, UNDOCKING_S = 1000.0, 30.0

_TIME = struct.Struct("<f")
_CODE = struct.Struct("<H")


@dataclass(frozen=True, slots=True)
class DockEnding:
    """How a goal of the docking server ended.

    Attributes:
        status: as in ``Ending``.
        success: the server's value.
        code: one of ``DOCK_ERRORS``, or 0.
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
