"""The scatter of poses: how far localisation errs from one pose to the next.

A robot drives smoothly: in a tenth of a second no drive takes it off the straight way between the
pose before and the pose after by more than some millimetres. What a pose is off that way, across
it, is an error of localisation; along it, it would be one of the poses' times. Three errors of
standard deviation s across the way make one of sqrt(1 + 1/4 + 1/4) s, whose median size is 0.674
times that. The median of the last ones is taken: corners between poses far apart are few of them.

What does not change from pose to pose, a drift, is not seen.
"""

from __future__ import annotations

import math
from collections import deque
from statistics import median

from fasaco_edge.grid.geometry import Pose2D

# So many poses tell, and no fewer than these.
POSES, FEWEST = 31, 5
# Median size of what a pose is off the way between its neighbours, for errors of 1.
_MEDIAN_OFF = 0.6745 * math.sqrt(1.5)


class PoseScatter:
    """Estimates the errors of the newest poses.

    Attributes:
        sigma_m: standard deviation of an error along one axis [m]; 0 before enough poses have come.
    """

    def __init__(self) -> None:
        self.sigma_m = 0.0
        self._before: tuple[Pose2D, ...] = ()
        self._off_m: deque[float] = deque(maxlen=POSES)

    def note(self, pose: Pose2D) -> None:
        """Take in the next pose."""
        if len(self._before) == 2:
            first, middle = self._before
            dx, dy = pose.x - first.x, pose.y - first.y
            way = math.hypot(dx, dy)
            across = dx * (middle.y - first.y) - dy * (middle.x - first.x)
            self._off_m.append(abs(across) / way if way else 0.0)
            if len(self._off_m) >= FEWEST:
                self.sigma_m = median(self._off_m) / _MEDIAN_OFF
        self._before = (*self._before[-1:], pose)

    def break_track(self) -> None:
        """Note that the robot's way to its next pose is unknown."""
        self._before = ()
