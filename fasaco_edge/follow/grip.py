"""Check that the base moves as commanded: one that pushes against an obstacle must stop."""

from __future__ import annotations

import math

from fasaco_edge.follow.estimate import Command
from fasaco_edge.follow.tries import Tries
from fasaco_edge.grid.geometry import Pose2D

# The check follows this commanded distance [m], of which the robot must have moved this share; a
# radian of turning counts as the third. For a fast robot it follows after this time [s]: poses lag.
LEAST_WAY_M, LEAST_SHARE, WAY_M_RAD = 0.2, 0.15, 0.2
LOOK_S = 2.0
# Pause after the first try [s], doubled after the next, and number of tries in a direction. After
# the last one it waits until its pose has moved this far [m], or the path leads elsewhere.
REST_S = 2.0
TRIES = 3
FREED_M = 0.1


class Grip:
    """Compares the commands with the motion of the poses."""

    def __init__(self) -> None:
        self._tries = Tries(FREED_M, REST_S, math.inf, TRIES)
        self._toward = 0.0
        self._from = Pose2D(0.0, 0.0)
        # Commanded distance and duration since then.
        self._way, self._seconds = 0.0, 0.0
        # Commanded distance since the first failed try [m].
        self._pushed = 0.0

    @property
    def tries(self) -> int:
        """Number of tries in the present direction in which the robot did not move."""
        return self._tries.tries(self._toward)

    def is_lost(self, pose: Pose2D, toward: float, now: float) -> bool:
        """Tell whether the robot must pause because it did not move.

        Args:
            pose: the newest one measured.
            toward: the direction in which the path leads [rad].
            now: the time [s].
        """
        self._toward = toward
        # Odometry that runs on while wheels slip is no progress.
        self._tries.moved_to((pose.x, pose.y), LEAST_SHARE * self._pushed)
        if not self._tries.may_try(toward, now):
            if self._seconds > 0.0:
                self._look_from(pose)
            if self._came(pose) < FREED_M:
                return True
            # It was moved, perhaps turned, while nothing was commanded.
            self._tries.forget()
        if self._seconds == 0.0:
            self._look_from(pose)
        if self._seconds < LOOK_S or self._way < LEAST_WAY_M:
            return False
        is_lost = self._came(pose) < LEAST_SHARE * self._way
        self._look_from(pose)
        if is_lost:
            self._tries.failed((pose.x, pose.y), toward, now)
        return is_lost

    def sent(self, command: Command, seconds: float) -> None:
        """Note a command and its duration."""
        if way := seconds * (command.speed + WAY_M_RAD * abs(command.turn_rate)):
            self._way += way
            self._seconds += seconds
            self._pushed = self._pushed + way if self._tries.have_failed else 0.0

    def _came(self, pose: Pose2D) -> float:
        """Return how far the robot has come since the last look [m]."""
        turned = abs(math.remainder(pose.yaw - self._from.yaw, math.tau))
        return math.hypot(pose.x - self._from.x, pose.y - self._from.y) + WAY_M_RAD * turned

    def _look_from(self, pose: Pose2D) -> None:
        self._from, self._way, self._seconds = pose, 0.0, 0.0
