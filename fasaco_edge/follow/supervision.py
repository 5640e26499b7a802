"""Supervision of a follower's inputs: a daemon that plans, its path, and the robot's pose.

It has no clock and no session: the caller passes the monotonic time.
"""

from __future__ import annotations

import enum
import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from fasaco_edge.errors import FasacoError, MalformedMessage
from fasaco_edge.grid.geometry import Point, Pose2D, StampedPose
from fasaco_edge.wire.messages.path_points import PathPoints
from fasaco_edge.wire.messages.poses import Link

_Result = TypeVar("_Result")

# Timeout of a transform between map and robot [s]; transforms may be older than poses.
LINK_S = 2.0


class FollowerState(enum.Enum):
    """State of the robot, with reasons to stand."""

    DRIVING = "driving"
    DRIVEN = "the path is driven"
    NO_PATH = "no path"
    EMPTY_PATH = "stopped by an empty path"
    BAD_PATH = "path refused"
    PATH_ELSEWHERE = "path elsewhere"
    OFF_PATH = "off the path"
    OBSTACLE = "obstacle ahead"
    NO_SCAN = "no scan"
    BAD_SCAN = "scan refused"
    NOT_MOVING = "does not move as commanded"
    NO_POSE = "no pose"
    OLD_POSE = "pose too old"
    BAD_POSE = "pose refused"
    POSE_JUMPED = "pose jumped"
    WRONG_FRAME = "wrong frame"
    LOOKS = "looks for other followers"
    SECOND = "another follower drives"
    NO_RIGHT = "no right to drive"
    NO_DAEMON = "no daemon"
    SILENT_DAEMON = "daemon silent"
    STANDS = "Nav2's controller stands"
    NO_NAV2 = "no answer from Nav2"
    REFUSED = "refused by Nav2"
    GIVEN_UP = "given up by Nav2"
    CANCELED = "canceled by another program"


Reason = tuple[FollowerState, str]
"""Why a robot stands: its state, and details in words."""


@dataclass(frozen=True, slots=True)
class Patience:
    """Timeouts of a follower's inputs.

    Attributes:
        pose_s: timeout of the newest pose, by its arrival [s].
        link_s: timeout of each other transform between map and robot, by its arrival [s]:
            localisers publish the pose of the odometry frame less often than odometry comes.
        status_s: timeout of the daemon's heartbeat [s].
    """

    pose_s: float = 0.5
    link_s: float = LINK_S
    status_s: float = 2.5


class Supervision:
    """Decides whether path, pose and daemon let the robot drive; base class of followers.

    Attributes:
        state: state of the robot.
        detail: details of the state, in words.
        ahead: points of the obstacle in front of the robot [m], the nearest first; else ().
        newest_pose: the newest pose; None before the first one.
        link: the oldest transform between map and robot, by arrival; None without transforms.
        pose_fault: fault of the newest pose; None if it is valid.
        has_path: whether there is a path to follow.
        path_frame: name of the frame of the newest path.
        standby: why the follower must not command the robot, with details; None if it may.
    """

    def __init__(self, patience: Patience) -> None:
        self.ahead: tuple[Point, ...] = ()
        self.state, self.detail = FollowerState.NO_DAEMON, ""
        self.standby: Reason | None = None
        self.newest_pose: Pose2D | None = None
        self.link: Link | None = None
        self.pose_fault: FasacoError | None = None
        self.has_path, self.path_frame = False, ""
        self._patience = patience
        self._pose_at = -math.inf
        self._frame, self._stamp_ns, self._repeats = "", 0, False
        self._path_most_m_s = math.inf
        self._no_path: Reason = FollowerState.NO_PATH, ""
        self._planner = self._path_of = ""
        self._statuses, self._status_at = 0, -math.inf

    def take_pose(self, stamped: StampedPose, now: float) -> None:
        """Take in a pose on arrival; a pose with the previous stamp is ignored."""
        self._repeats = stamped.stamp_ns != 0 and stamped.stamp_ns == self._stamp_ns
        if self._repeats and stamped.frame == self._frame:
            return
        self._frame, self._stamp_ns, self.pose_fault = stamped.frame, stamped.stamp_ns, None
        self._moved_to(stamped.pose, now)
        self.newest_pose, self._pose_at = stamped.pose, now

    def take_path(self, payload: bytes, most_m_s: float = math.inf) -> None:
        """Follow another path of the planner; an empty or malformed path stops the robot.

        ``most_m_s``: largest speed on this path [m/s].
        """
        self._path_of, self._path_most_m_s = self._planner, most_m_s
        try:
            points = PathPoints(payload)
        except MalformedMessage as error:
            self._have_none(FollowerState.BAD_PATH, str(error))
            return
        if not points.left:
            self._have_none(FollowerState.EMPTY_PATH, "`fasaco-edge mission status` says why")
            return
        self.has_path, self.path_frame = True, points.frame
        self._have(points)

    def take_planner(self, planner: str) -> None:
        """Note which daemon plans, "" without one; a path of the previous daemon is dropped."""
        if planner == self._planner:
            return
        self._planner, self._statuses, self._status_at = planner, 0, -math.inf
        if planner and planner != self._path_of:
            self._have_none(FollowerState.NO_PATH)
            self._path_of = ""

    def take_heartbeat(self, now: float) -> None:
        """Take in that a status of the planner arrived; the first may be old and is ignored."""
        self._statuses += 1
        if self._statuses > 1:
            self._status_at = now

    @abstractmethod
    def _moved_to(self, pose: Pose2D, now: float) -> None:
        """Take in the robot's pose."""

    @abstractmethod
    def _have(self, points: PathPoints) -> None:
        """Follow these points."""

    @abstractmethod
    def _withdraw(self) -> None:
        """Follow nothing."""

    def _have_none(self, state: FollowerState, detail: str = "") -> None:
        self.has_path, self._no_path = False, (state, detail)
        self._withdraw()

    def _supervised(self, drive: Callable[[float], _Result], now: float) -> _Result | None:
        """Return the result of ``drive`` if the robot may drive, else None."""
        self.ahead = ()
        self.state, self.detail = self._trouble(now) or (FollowerState.DRIVING, "")
        if self.state is not FollowerState.DRIVING:
            return None
        try:
            return drive(now)
        except MalformedMessage as error:
            # The rest of the path is malformed.
            self._have_none(FollowerState.BAD_PATH, str(error))
            self.state, self.detail = self._no_path
            return None

    def _trouble(self, now: float) -> Reason | None:
        """Return why the robot must stand, with details; None if it may drive."""
        if self.standby is not None:
            return self.standby
        if not self._planner:
            return FollowerState.NO_DAEMON, "no daemon plans for this robot"
        if (silent_s := now - self._status_at) > self._patience.status_s:
            sent_any = silent_s < math.inf
            return (
                FollowerState.SILENT_DAEMON,
                f"for {silent_s:.1f} s" if sent_any else "no status yet",
            )
        if not self.has_path:
            return self._no_path
        return self._trouble_of_poses(now)

    def _trouble_of_poses(self, now: float) -> Reason | None:
        if self.pose_fault is not None:
            return FollowerState.BAD_POSE, str(self.pose_fault)
        if self.newest_pose is None:
            return FollowerState.NO_POSE, "none has come"
        if (age_s := now - self._pose_at) > self._patience.pose_s:
            why = ", and is repeated with the same stamp" if self._repeats else ""
            return FollowerState.OLD_POSE, f"{age_s:.2f} s{why}"
        if self.link and (age_s := now - self.link.came_at) > self._patience.link_s:
            link = self.link.transform
            return (
                FollowerState.OLD_POSE,
                f"{age_s:.2f} s: transform of {link.child!r} in {link.frame!r}",
            )
        if self._frame != self.path_frame:
            return (
                FollowerState.WRONG_FRAME,
                f"pose in {self._frame!r}, path in {self.path_frame!r}",
            )
        return None
