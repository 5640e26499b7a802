"""Check that the base moves as commanded: one that pushes against an obstacle must stop."""

from __future__ import annotations

import math

from fasaco_edge.follow.estimate import Command
from fasaco_edge.grid.geometry import Pose2D

# The check follows this commanded distance [m], of which the robot must have moved this share; a
# radian of turning counts as the third. For a fast robot it follows after this time [s]: poses lag.
LEAST_WAY_M, LEAST_SHARE, WAY_M_RAD = 0.2, 0.15, 0.2
LOOK_S = 2.0
# Pause before a retry [s], and number of retries, after which it waits until its pose has moved
# this far [m], or there is a new task.
REST_S = 2.0
TRIES = 3
FREED_M = 0.1


class Grip:
    """Compares the commands with the motion of the poses.

    Attributes:
        tries: consecutive tries in which the robot did not move.
    """

    def __init__(self) -> None:
        self.tries = 0
        self._from = Pose2D(0.0, 0.0)
        # Commanded distance and duration since then.
        self._way, self._seconds = 0.0, 0.0
        self._rests_until = -math.inf

    def is_lost(self, pose: Pose2D, now: float) -> bool:
        """Tell whether the robot must pause because it did not move.

        Args:
            pose: the newest one measured.
            now: the time [s].
        """
        if self._seconds == 0.0 and self.tries < TRIES:
            self._look_from(pose)
        if now < self._rests_until:
            return True
        came = math.hypot(pose.x - self._from.x, pose.y - self._from.y)
        came += WAY_M_RAD * abs(math.remainder(pose.yaw - self._from.yaw, math.tau))
        if self.tries >= TRIES:
            if came < FREED_M:
                return True
            self.tries = 0
            self._look_from(pose)
        if self._seconds < LOOK_S or self._way < LEAST_WAY_M:
            return False
        is_lost = came < LEAST_SHARE * self._way
        self._look_from(pose)
        self.tries = self.tries + 1 if is_lost else 0
        if is_lost:
            self._rests_until = now + REST_S
        return is_lost

    def try_again(self) -> None:
        """Reset the number of retries: there is a new task."""
        self.tries = 0

    def sent(self, command: Command, seconds: float) -> None:
        """Note a command and its duration."""
        if way := seconds * (command.speed + WAY_M_RAD * abs(command.turn_rate)):
            self._way += way
            self._seconds += seconds

    def _look_from(self, pose: Pose2D) -> None:
        self._from, self._way, self._seconds = pose, 0.0, 0.0
