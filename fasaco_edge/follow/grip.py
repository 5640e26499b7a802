"""Whether the base does as it is told: one that pushes against something should not go on."""

from __future__ import annotations

import math

from fasaco_edge.follow.estimate import Command
from fasaco_edge.grid.geometry import Pose2D

# Looked at after so long [s]. Then the robot should have come so far [m], of which it has to have
# come the share; a radian of turning counts as the third.
LOOK_S = 2.0
LEAST_WAY_M, LEAST_SHARE, WAY_M_RAD = 0.2, 0.15, 0.2
# So long it is left alone before the next try [s].
REST_S = 2.0


class Grip:
    """Compares what was sent with how far the poses came."""

    def __init__(self) -> None:
        self._since = -math.inf
        self._from = Pose2D(0.0, 0.0)
        self._way = 0.0
        self._rests_until = -math.inf

    def is_lost(self, pose: Pose2D, now: float) -> bool:
        """Tell whether the robot has to be left alone for not moving.

        Args:
            pose: the newest one measured.
            now: the time [s].
        """
        if now < self._rests_until:
            return True
        if now - self._since < LOOK_S:
            return False
        came = math.hypot(pose.x - self._from.x, pose.y - self._from.y)
        came += WAY_M_RAD * abs(math.remainder(pose.yaw - self._from.yaw, math.tau))
        is_lost = self._way >= LEAST_WAY_M and came < LEAST_SHARE * self._way
        self._since, self._from, self._way = now, pose, 0.0
        if is_lost:
            self._rests_until = now + REST_S
            self._since = self._rests_until
        return is_lost

    def sent(self, command: Command, seconds: float) -> None:
        """Note what is sent, for how long."""
        self._way += seconds * (command.speed + WAY_M_RAD * abs(command.turn_rate))
