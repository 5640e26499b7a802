"""The follower: paths, poses and signs of the daemon in, a command and a state out.

No clock, no session: who calls tells the time, by a clock that never steps.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from fasaco_edge.errors import FasacoError, MalformedMessage
from fasaco_edge.follow.estimate import STAND, Command, Limits, PoseEstimate
from fasaco_edge.follow.grip import Grip
from fasaco_edge.follow.pursuit import Pursuit
from fasaco_edge.follow.route import Joining, Route
from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.wire.messages.path_points import PathPoints
from fasaco_edge.wire.messages.poses import Link

# Commands a second.
RATE_HZ = 20.0
# Zeros are sent for so long after a stop; then something else may drive [s].
ZEROS_S = 1.0
# Further than this from its leg the robot is not on the path any more [m].
OFF_PATH_M = 0.3
# Links of poses that are transforms may be older than poses [s].
LINK_S = 2.0


class State(enum.Enum):
    """What the robot does, and why it stands."""

    DRIVING = "driving"
    DRIVEN = "the path is driven"
    NO_PATH = "no path"
    EMPTY_PATH = "stopped by an empty path"
    BAD_PATH = "path refused"
    PATH_ELSEWHERE = "path elsewhere"
    OFF_PATH = "off the path"
    NOT_MOVING = "does not move as told"
    NO_POSE = "no pose"
    OLD_POSE = "pose too old"
    BAD_POSE = "pose refused"
    POSE_JUMPED = "pose jumped"
    WRONG_FRAME = "wrong frame"
    NO_DAEMON = "no daemon"
    SILENT_DAEMON = "daemon silent"


@dataclass(frozen=True, slots=True)
class Patience:
    """How old what the follower depends on may become.

    Attributes:
        pose_s: the newest pose, by its arrival [s].
        link_s: each other transform between map and robot, by its arrival [s]: localisers say where
            odometry began less often than odometry comes.
        status_s: the newest sign of a daemon that is there [s].
    """

    pose_s: float = 0.5
    link_s: float = LINK_S
    status_s: float = 2.5


class Follower:
    """Follows the newest path while all that it takes is there.

    Args:
        limits: of the base.
        patience: how old pose and status may become.
        moves: whether the base does what the commands say; in a dry run it does not.

    Attributes:
        state: what it does.
        detail: the same in figures, for people.
    """

    def __init__(
        self, limits: Limits, patience: Patience = Patience(), *, moves: bool = True
    ) -> None:
        self.state, self.detail = State.NO_DAEMON, ""
        self._limits = limits
        self._patience = patience
        self._moves = moves
        self._estimate = PoseEstimate(limits)
        self._pursuit = Pursuit(limits, 1.0 / RATE_HZ)
        self._grip = Grip()
        self._frame, self._stamp_ns = "", 0
        self._repeats = False
        self._link: Link | None = None
        self._pose_fault: FasacoError | None = None
        self._route: Route | None = None
        self._path_frame = ""
        self._path_state = State.NO_PATH
        self._path_detail = ""
        # What is driven until a new path is joined.
        self._before: Route | None = None
        self._is_new = False
        self._planner = ""
        self._path_of = ""
        self._status_at = -float("inf")
        self._driven_at = -float("inf")

    def take_pose(self, stamped: StampedPose, now: float) -> None:
        """Take a pose in, as it comes; one with the stamp of the one before is no new one."""
        self._repeats = stamped.stamp_ns != 0 and stamped.stamp_ns == self._stamp_ns
        if self._repeats and stamped.frame == self._frame:
            return
        self._pose_fault = None
        self._frame, self._stamp_ns = stamped.frame, stamped.stamp_ns
        self._estimate.take(stamped.pose, now)

    def heard_link(self, link: Link) -> None:
        """Note which transform between map and robot came longest ago."""
        self._link = link

    def refuse_pose(self, error: FasacoError) -> None:
        """Stop for a pose that is none, until the next one."""
        self._pose_fault = error

    def take_path(self, payload: bytes) -> None:
        """Follow another path from now on; an empty one, or one that is none, stops the robot."""
        self._path_of = self._planner
        try:
            points = PathPoints(payload)
        except MalformedMessage as error:
            self._have_none(State.BAD_PATH, str(error))
            return
        if not points.left:
            self._have_none(State.EMPTY_PATH)
            return
        if not self._is_new:
            self._before = self._route
        self._path_frame = points.frame
        self._route = Route(points.take, self._limits.steered)
        self._is_new = True
        self._grip.try_again()

    def take_planner(self, planner: str, now: float) -> None:
        """Note which daemon plans, "" for none; another one's path is not this one's."""
        if planner == self._planner:
            return
        self._planner, self._status_at = planner, now
        if planner and self._path_of and planner != self._path_of:
            self._have_none(State.NO_PATH)
            self._path_of = ""
        elif planner and not self._path_of:
            self._path_of = planner

    def heard_status(self, now: float) -> None:
        """Note a sign of the daemon."""
        self._status_at = now

    def step(self, now: float) -> Command | None:
        """Return what is to be sent now; None where nothing is."""
        try:
            self.state, self.detail = self._trouble(now)
            command = self._steer(now) if self.state is State.DRIVING else None
        except MalformedMessage as error:
            # Further on the path is none.
            self._have_none(State.BAD_PATH, str(error))
            self.state, self.detail, command = State.BAD_PATH, str(error), None
        if command is None:
            self._pursuit.stand()
        else:
            self._driven_at = now
        if self._moves:
            self._estimate.sent(command or STAND, now)
            self._grip.sent(command or STAND, 1.0 / RATE_HZ)
        if command is None and now - self._driven_at <= ZEROS_S:
            return STAND
        return command

    def _have_none(self, state: State, detail: str = "") -> None:
        """Have no path; the one before is withdrawn, too."""
        self._route, self._before, self._is_new = None, None, False
        self._path_state, self._path_detail = state, detail

    def _trouble(self, now: float) -> tuple[State, str]:
        """Return why the robot has to stand, and figures; or that it may drive."""
        if not self._planner:
            return State.NO_DAEMON, "none plans for this robot"
        if (silent_s := now - self._status_at) > self._patience.status_s:
            return State.SILENT_DAEMON, f"for {silent_s:.1f} s"
        if self._route is None:
            return self._path_state, self._path_detail
        return self._trouble_of_poses(now) or (State.DRIVING, "")

    def _trouble_of_poses(self, now: float) -> tuple[State, str] | None:
        if self._pose_fault is not None:
            return State.BAD_POSE, str(self._pose_fault)
        estimate = self._estimate
        if estimate.pose_at is None:
            return State.NO_POSE, "none has come"
        if estimate.jump is not None:
            far, turned = estimate.jump
            return State.POSE_JUMPED, f"by {far:.1f} m and {math.degrees(turned):.0f} deg"
        if age := self._age(estimate.pose_at, now):
            return State.OLD_POSE, age
        if self._frame != self._path_frame:
            return State.WRONG_FRAME, f"pose in {self._frame!r}, path in {self._path_frame!r}"
        return None

    def _age(self, pose_at: float, now: float) -> str:
        """Return how old pose or link is, where that is too old; else ""."""
        if (age_s := now - pose_at) > self._patience.pose_s:
            why = ", and comes again and again by its stamp" if self._repeats else ""
            return f"{age_s:.2f} s{why}"
        if self._link and (age_s := now - self._link.came_at) > self._patience.link_s:
            transform = self._link.transform
            return f"{age_s:.2f} s: transform of {transform.child!r} in {transform.frame!r}"
        return ""

    def _steer(self, now: float) -> Command | None:
        assert self._route is not None
        if self._grip.is_lost(self._estimate.measured, now):
            self.state, self.detail = State.NOT_MOVING, f"tried {self._grip.tries} times"
            return None
        pose = self._estimate.at(now)
        here = (pose.x, pose.y)
        if self._is_new:
            heading = pose.yaw if self._estimate.speed > 0.0 else None
            joining = self._route.join(here, heading, self._before)
            if joining is Joining.AT_REST:
                return self._pursuit.brake()
            if joining is Joining.ELSEWHERE:
                self.state = State.PATH_ELSEWHERE
                return None
            self._is_new, self._before = False, None
        leg = self._route.leg
        if leg is not None and (off := leg.distance(here)) > OFF_PATH_M:
            self.state, self.detail = State.OFF_PATH, f"by {off:.2f} m"
            return None
        command = self._pursuit.steer(pose, self._route)
        if self._route.leg is None:
            self.state = State.DRIVEN
            return None
        return command
