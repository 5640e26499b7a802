"""Supervision of a follower's inputs: a daemon that plans, its path, and the robot's pose.

No clock, no session: the caller passes the monotonic time.
"""

from __future__ import annotations

import enum
import math
from abc import abstractmethod
from dataclasses import dataclass

from fasaco_edge.errors import FasacoError, MalformedMessage
from fasaco_edge.grid.geometry import Point, Pose2D, StampedPose
from fasaco_edge.wire.messages.path_points import PathPoints
from fasaco_edge.wire.messages.poses import Link

# Links of poses from transforms may be older than poses [s].
LINK_S = 2.0


class State(enum.Enum):
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
    DOCK = "left to the docking server"
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


@dataclass(frozen=True, slots=True)
class Patience:
    """Timeouts of a follower's inputs.

    Attributes:
        pose_s: of the newest pose, by its arrival [s].
        link_s: of each other transform between map and robot, by its arrival [s]: localisers
            publish the origin of odometry less often than odometry itself is published.
        status_s: of the daemon's heartbeat [s].
    """

    pose_s: float = 0.5
    link_s: float = LINK_S
    status_s: float = 2.5


USUAL = Patience()


class Supervision:
    """Decides whether path, pose and daemon let the robot drive; base class of followers.

    Args:
        patience: timeouts of pose and status.

    Attributes:
        state: of the robot.
        detail: figures of the state, in words.
        ahead: places of what the robot stands before [m], the nearest first; () for none.
    """

    def __init__(self, patience: Patience) -> None:
        self.ahead: tuple[Point, ...] = ()
        self.state, self.detail = State.NO_DAEMON, ""
        self._patience = patience
        self._held = ""
        self._standby: tuple[State, str] | None = None
        self._newest: Pose2D | None = None
        self._frame, self._stamp_ns = "", 0
        self._repeats = False
        self._link: Link | None = None
        self._pose_fault: FasacoError | None = None
        self._path_frame, self._path_most_m_s = "", math.inf
        self._path_state = State.NO_PATH
        self._path_detail = ""
        self._planner = ""
        self._path_of = ""
        self._statuses, self._status_at = 0, -math.inf

    def take_pose(self, stamped: StampedPose, now: float) -> None:
        """Take in a pose on arrival; one with the previous stamp is not new."""
        self._repeats = stamped.stamp_ns != 0 and stamped.stamp_ns == self._stamp_ns
        if self._repeats and stamped.frame == self._frame:
            return
        self._pose_fault = None
        self._frame, self._stamp_ns = stamped.frame, stamped.stamp_ns
        self._newest = stamped.pose
        self._moved_to(stamped.pose, now)

    def heard_link(self, link: Link) -> None:
        """Note the oldest transform between map and robot, by arrival."""
        self._link = link

    def refuse_pose(self, error: FasacoError) -> None:
        """Stop for a malformed pose, until the next one."""
        self._pose_fault = error

    def take_path(self, payload: bytes, most_m_s: float = math.inf) -> None:
        """Follow another path of the planner; an empty or malformed one stops the robot.

        ``most_m_s``: the speed to follow it at, if that is below the robot's [m/s].
        """
        self._path_of, self._path_most_m_s = self._planner, most_m_s
        try:
            points = PathPoints(payload)
        except MalformedMessage as error:
            self._have_none(State.BAD_PATH, str(error))
            return
        if not points.left:
            self._have_none(State.EMPTY_PATH)
            return
        self._path_frame = points.frame
        self._have(points)

    def take_unnamed_path(self, payload: bytes) -> None:
        """Stop for a path of an unknown daemon: it may be the planner's, and is never driven."""
        self.take_path(payload)
        if self._has_path:
            self._have_none(
                State.BAD_PATH, "it does not name its daemon: is that an older release?"
            )

    def take_planner(self, planner: str) -> None:
        """Note which daemon plans, "" for none; a path of the previous one is dropped."""
        if planner == self._planner:
            return
        self._planner, self._statuses, self._status_at = planner, 0, -math.inf
        if planner and planner != self._path_of:
            self._have_none(State.NO_PATH)
            self._path_of = ""

    def hold(self, why: str) -> None:
        """Make the robot stand, for a reason; "" lets it drive."""
        self._held = why

    def stand_by(self, why: tuple[State, str] | None) -> None:
        """Leave the robot alone, for a reason with figures; None ends that."""
        self._standby = why

    @property
    def newest_pose(self) -> Pose2D | None:
        """The newest pose; None before there is one."""
        return self._newest

    @property
    def path_frame(self) -> str:
        """Name of the frame of the path."""
        return self._path_frame

    @property
    def has_path(self) -> bool:
        """Whether there is a path to follow."""
        return self._has_path

    def heard_status(self, now: float) -> None:
        """Note a heartbeat of the planner: a status, except the first one, which may be cached."""
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

    @property
    @abstractmethod
    def _has_path(self) -> bool:
        """Whether there is a path to follow."""

    @property
    @abstractmethod
    def _pose_at(self) -> float | None:
        """Arrival of the newest accepted pose [s]; None before there is one."""

    def _jump(self) -> str:
        """Return the jump of the newest pose as text; "" if it is accepted."""
        return ""

    def _have_none(self, state: State, detail: str = "") -> None:
        """Drop the path; withdraw it from the follower, too."""
        self._withdraw()
        self._path_state, self._path_detail = state, detail

    def _trouble(self, now: float) -> tuple[State, str]:
        """Return the state: why the robot must stand, with figures, or that it may drive."""
        if self._standby is not None:
            return self._standby
        if not self._planner:
            return State.NO_DAEMON, "no daemon plans for this robot"
        if (silent_s := now - self._status_at) > self._patience.status_s:
            sent_any = silent_s < math.inf
            return State.SILENT_DAEMON, f"for {silent_s:.1f} s" if sent_any else "no status yet"
        if not self._has_path:
            return self._path_state, self._path_detail
        if self._held:
            return State.DOCK, self._held
        return self._trouble_of_poses(now) or (State.DRIVING, "")

    def _trouble_of_poses(self, now: float) -> tuple[State, str] | None:
        if self._pose_fault is not None:
            return State.BAD_POSE, str(self._pose_fault)
        pose_at = self._pose_at
        if pose_at is None:
            return State.NO_POSE, "none has come"
        if jump := self._jump():
            return State.POSE_JUMPED, jump
        if age := self._age(pose_at, now):
            return State.OLD_POSE, age
        if self._frame != self._path_frame:
            return State.WRONG_FRAME, f"pose in {self._frame!r}, path in {self._path_frame!r}"
        return None

    def _age(self, pose_at: float, now: float) -> str:
        """Return the age of pose or link as text if too old; else ""."""
        if (age_s := now - pose_at) > self._patience.pose_s:
            why = ", and is repeated with the same stamp" if self._repeats else ""
            return f"{age_s:.2f} s{why}"
        if self._link and (age_s := now - self._link.came_at) > self._patience.link_s:
            transform = self._link.transform
            return f"{age_s:.2f} s: transform of {transform.child!r} in {transform.frame!r}"
        return ""
