"""Follower of a base that takes velocities: paths, poses and heartbeats in, command and state out.

It has no clock and no session: the caller passes the monotonic time.
"""

from __future__ import annotations

import math

from fasaco_edge.follow.estimate import STAND, BaseLimits, PoseEstimate, VelocityCommand
from fasaco_edge.follow.grip import Grip
from fasaco_edge.follow.pursuit import CurvePursuit, Pursuit
from fasaco_edge.follow.route import CurveRoute, JoinOutcome, LegRoute
from fasaco_edge.follow.sight import AHEAD_M, NO_LIMIT, Limit, Sight
from fasaco_edge.follow.standstill import floor_ahead
from fasaco_edge.follow.supervision import FollowerState, Patience, Reason, Supervision
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.wire.messages.path_points import PathPoints

# Commands a second.
RATE_HZ = 20.0
PERIOD_S = 1.0 / RATE_HZ
# Zeros are sent for this long after a stop; then another program may drive [s].
ZEROS_S = 1.0
# Distance of the point ahead that gives the path's direction [m].
LEADS_M = 0.5
# A robot that is farther than this from its present piece of the path has left the path [m].
OFF_PATH_M = 0.3


class Follower(Supervision):
    """Follows the newest path while all its inputs are up to date.

    Args:
        limits: limits of the base.
        patience: timeouts of pose and status.
        moves: whether the base executes the commands; in a dry run it does not.
        sight: finds obstacles that the map does not show; None to use the map alone.
        radius: radius of the robot's disc [m]; 0 if unknown.
    """

    def __init__(
        self,
        limits: BaseLimits,
        patience: Patience | None = None,
        *,
        moves: bool = True,
        sight: Sight | None = None,
        radius: float = 0.0,
    ) -> None:
        super().__init__(patience or Patience())
        self._limits, self._moves = limits, moves
        self._sight, self._radius = sight, radius
        self._estimate = PoseEstimate(limits)
        self._pursuit = (CurvePursuit if limits.turn_radius else Pursuit)(limits, PERIOD_S)
        self._grip = Grip()
        # The route that is driven, and the route to join next.
        self._route: LegRoute | None = None
        self._next: LegRoute | None = None
        self._driven_at = -math.inf
        self._stepped_at: float | None = None

    def step(self, now: float) -> VelocityCommand | None:
        """Return the command to send now, or None."""
        if self._stepped_at is not None:
            self._pursuit.note_time(now - self._stepped_at)
        self._stepped_at = now
        command = self._supervised(self._steer, now)
        if command is None:
            self._pursuit.stand()
        else:
            self._driven_at = now
        if self._moves:
            self._estimate.sent(command or STAND, now)
            self._grip.sent(command or STAND, PERIOD_S)
        if command is None and now - self._driven_at <= ZEROS_S:
            return STAND
        return command

    def take_scan(self, payload: bytes, now: float) -> None:
        """Take in a scan on arrival; before the first pose it is ignored."""
        if self._sight is not None and self.newest_pose is not None:
            self._sight.take_scan(payload, self._estimate.at(now - self._estimate.delay), now)

    def _moved_to(self, pose: Pose2D, now: float) -> None:
        self._estimate.take(pose, now)

    def _have(self, points: PathPoints) -> None:
        self._next = (CurveRoute if self._limits.turn_radius else LegRoute)(points, self._limits)

    def _withdraw(self) -> None:
        self._route = self._next = None

    def _trouble(self, now: float) -> Reason | None:
        if (reason := super()._trouble(now)) is not None:
            return reason
        if self._estimate.jump is not None:
            far, turned = self._estimate.jump
            return FollowerState.POSE_JUMPED, f"by {far:.1f} m and {math.degrees(turned):.0f} deg"
        return self._sight.trouble(self.path_frame, now) if self._sight is not None else None

    def _steer(self, now: float) -> VelocityCommand | None:
        pose = self._estimate.at(now)
        here = (pose.x, pose.y)
        if self._next is not None:
            heading = None
            if self._estimate.speed:
                heading = pose.yaw if self._estimate.speed > 0.0 else pose.yaw + math.pi
            joining = self._next.join(here, heading, self._route)
            if joining is JoinOutcome.AT_REST:
                return self._pursuit.brake()
            if joining is JoinOutcome.ELSEWHERE:
                self.state = FollowerState.PATH_ELSEWHERE
                return None
            self._route, self._next = self._next, None
        route = self._route
        assert route is not None
        leg = route.leg
        x, y = route.line_ahead(here, LEADS_M)[-1]
        toward = math.atan2(y - here[1], x - here[0])
        if leg is not None and self._grip.is_lost(self._estimate, toward, now):
            self.state, self.detail = FollowerState.NOT_MOVING, self._grip.detail
            self.ahead = floor_ahead(here, toward, self._radius)
            return None
        if leg is not None and (off := leg.distance(here)) > OFF_PATH_M:
            self.state, self.detail = FollowerState.OFF_PATH, f"by {off:.2f} m"
            return None
        limit = self._limit(pose, route)
        most = min(limit.speed, self._path_most_m_s)
        command = self._pursuit.steer(pose, route, most)
        if route.leg is None:
            self.state = FollowerState.DRIVEN
            return None
        if self._pursuit.is_lost:
            self.state, self.detail = FollowerState.OFF_PATH, "the base cannot steer to it"
        elif limit.speed == 0.0 and command == STAND and not self._pursuit.is_turning:
            self.state, self.detail, self.ahead = FollowerState.OBSTACLE, limit.why, limit.around
        return command

    def _limit(self, pose: Pose2D, route: LegRoute) -> Limit:
        if self._sight is None or not self._sight.things:
            return NO_LIMIT
        line = route.line_ahead((pose.x, pose.y), AHEAD_M)
        if route.leg is not None and route.leg.is_back:
            pose = Pose2D(pose.x, pose.y, pose.yaw + math.pi)
        return self._sight.limit(pose, line, self._limits.acceleration, PERIOD_S)
