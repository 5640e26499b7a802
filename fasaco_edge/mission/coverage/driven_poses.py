"""Driven poses: the poses that the robot could have driven to.

Swept floor uses only poses that the robot could have driven to. Localisation sometimes errs by more
than its noise: one pose lies beside the track, and the next pose lies on it again. A pose farther
away than the robot could have driven since the previous pose is held until the next pose. If the
robot could have driven directly to the next pose, the held pose was an error. Otherwise the held
pose counts, and the track to it is unknown.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from fasaco_edge.grid.geometry import Pose2D, StampedPose

# A base drives up to SPEED_MARGIN times as fast as configured. The track between two poses is known
# if they are at most LONGEST_S apart [s].
SPEED_MARGIN, LONGEST_S = 1.2, 3.0
# Because of noise, two poses may be this much farther apart than the distance driven [cells].
NOISE_CELLS = 0.5


class Driven(NamedTuple):
    """A pose that counts.

    Attributes:
        pose: the pose.
        farthest_m: longest possible drive to it from the previous pose; 0 if unknown [m].
        is_joined: whether the robot has driven to it from the previous pose.
    """

    pose: Pose2D
    farthest_m: float = 0.0
    is_joined: bool = True


class DrivenPoses:
    """Holds a pose that may be an error until the next pose."""

    def __init__(self, speed_m_s: float, cell_m: float) -> None:
        """Start without a pose; ``speed_m_s``: speed of the robot [m/s], 0 if unknown."""
        self._speed_m_s, self._noise_m = speed_m_s, NOISE_CELLS * cell_m
        self._sure: StampedPose | None = None
        self._held: StampedPose | None = None

    @property
    def holds(self) -> bool:
        """Whether the newest pose may be an error."""
        return self._held is not None

    def break_track(self) -> None:
        """Note that the next pose counts wherever it is: the map may have moved."""
        self._sure = self._held = None

    def farthest_m(self, before: StampedPose, after: StampedPose) -> float:
        """Return how far the robot could have driven between two poses; 0 if unknown [m]."""
        took_s = (after.stamp_ns - before.stamp_ns) * 1e-9
        return SPEED_MARGIN * self._speed_m_s * took_s if 0.0 < took_s <= LONGEST_S else 0.0

    def receive_pose(self, stamped: StampedPose) -> list[Driven]:
        """Take in the next pose; return the poses that count now."""
        sure, held = self._sure, self._held
        farthest_m = 0.0 if sure is None else self.farthest_m(sure, stamped)
        if sure is None or not farthest_m or self._is_near(sure, stamped, farthest_m):
            self._sure, self._held = stamped, None
            return [Driven(stamped.pose, farthest_m)]
        if held is None:
            self._held = stamped
            return []
        self._sure, self._held = held, None
        return [Driven(held.pose, is_joined=False), *self.receive_pose(stamped)]

    def _is_near(self, before: StampedPose, after: StampedPose, farthest_m: float) -> bool:
        one, other = before.pose, after.pose
        return math.hypot(other.x - one.x, other.y - one.y) <= farthest_m + self._noise_m
