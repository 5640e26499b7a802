"""Goals for Nav2: the action FollowPath of its controller.

Sources: nav2_msgs of Humble, Iron, Jazzy and Lyrical (FollowPath.action), action_msgs of Jazzy. A
type without members takes one byte in CDR.
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
from fasaco_edge.wire.ros_keys import CANCEL_GOAL

SEND_GOAL: Final = "nav2_msgs/action/FollowPath_SendGoal"
GET_RESULT: Final = "nav2_msgs/action/FollowPath_GetResult"

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
        message: message of the server, "" for none; only from Jazzy on.
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
        points: points of the path [m], at least two; each pose faces the next, or away from it.
        frame: frame of the points.
        stamp_ns: stamp of the path [ns]; 0 for the newest transform.
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
