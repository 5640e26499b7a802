"""Steady track: filtered robot positions from noisy poses.

A place is the mean over a symmetric window of poses. The window is wide enough for an error of a
quarter of a pixel, but not wider than the tool's reach. Exact poses become places at once, noisy
poses some poses later.

The noise is estimated from three consecutive poses. A robot drives smoothly: within a tenth of a
second it deviates by only some millimetres from the straight line between its neighbouring poses. A
larger lateral deviation is localisation noise; a longitudinal deviation would be timestamp error.
Three lateral errors of standard deviation s give a deviation with standard deviation sqrt(1 + 1/4 +
1/4) s; its median size is 0.674 times that. Corners are rare, so the median over the last
deviations ignores them. If poses are far apart, corners are frequent, and are excluded. Drift,
which is equal in consecutive poses, is not detected.
"""

from __future__ import annotations

import math
from collections import deque
from statistics import median
from typing import NamedTuple

from fasaco_edge.grid.geometry import Point, Pose2D
from fasaco_edge.mission.coverage.floor_tiles import PIXEL_M

# The median is over the last POSES deviations; at least FEWEST are needed.
POSES, FEWEST = 31, 5
# Median size of the deviation from the line between the neighbours, for standard deviation 1.
_MEDIAN_OFF = 0.6745 * math.sqrt(1.5)


class PoseScatter:
    """Estimates the noise of the newest poses.

    Attributes:
        sigma_m: standard deviation of an error along one axis [m]; 0 before there are enough poses.
    """

    def __init__(self, corner_m: float) -> None:
        """Start without a pose; ``corner_m``: shorter steps [m] are never taken for a corner."""
        self.sigma_m = 0.0
        self._corner_m = corner_m
        self._before: tuple[Pose2D, ...] = ()
        self._off_m: deque[float] = deque(maxlen=POSES)

    def receive_pose(self, pose: Pose2D) -> None:
        """Take in the next pose."""
        if len(self._before) == 2 and not self._is_corner(*self._before, pose):
            first, middle = self._before
            dx, dy = pose.x - first.x, pose.y - first.y
            length = math.hypot(dx, dy)
            across = dx * (middle.y - first.y) - dy * (middle.x - first.x)
            self._off_m.append(abs(across) / length if length else 0.0)
            if len(self._off_m) >= FEWEST:
                self.sigma_m = median(self._off_m) / _MEDIAN_OFF
        self._before = (*self._before[-1:], pose)

    def _is_corner(self, first: Pose2D, middle: Pose2D, last: Pose2D) -> bool:
        """Return whether the robot turned more sharply than noise can explain."""
        ax, ay, bx, by = (
            middle.x - first.x,
            middle.y - first.y,
            last.x - middle.x,
            last.y - middle.y,
        )
        is_long = min(math.hypot(ax, ay), math.hypot(bx, by)) > self._corner_m
        return is_long and abs(ax * by - ay * bx) > ax * bx + ay * by

    def break_track(self) -> None:
        """Note that the robot's track to its next pose is unknown."""
        self._before = ()


# Half-width of the 95 % confidence interval, in standard deviations.
SURE_SIGMAS = 2.0
# Error of a place that needs no wider window [m].
GOOD_ERROR_M = PIXEL_M / 4
# Limit on the poses before and after a place.
MOST_BESIDE = 15


class Position(NamedTuple):
    """A filtered position.

    Attributes:
        x, y: the position [m].
        error_m: bound of the error [m].
        farthest_m: longest possible drive to it from the previous pose; 0 if unknown [m].
        yaw: heading of the robot there [rad].
    """

    x: float
    y: float
    error_m: float
    farthest_m: float = 0.0
    yaw: float = 0.0

    @property
    def point(self) -> Point:
        """The position, x, y [m]."""
        return self.x, self.y


class SteadyTrack:
    """Filters poses into places."""

    def __init__(self, tool_m: float) -> None:
        """Start without a pose; ``tool_m``: width of the tool [m]."""
        self._reach_m = 0.5 * tool_m
        self._scatter = PoseScatter(self._reach_m)
        # The newest poses, the longest possible drive to each from the previous pose [m], and the
        # number of poses that have become places.
        self._poses: list[Pose2D] = []
        self._farthest_m: list[float] = []
        self._done = 0

    def receive_pose(self, pose: Pose2D, farthest_m: float = 0.0) -> list[Position]:
        """Take in the next pose; return the places that are final now.

        ``farthest_m``: longest possible drive since the previous pose; 0 if unknown [m].
        """
        self._scatter.receive_pose(pose)
        self._poses.append(pose)
        self._farthest_m.append(farthest_m)
        places = self._places(len(self._poses) - self._beside)
        past = max(self._done - MOST_BESIDE, 0)
        del self._poses[:past], self._farthest_m[:past]
        self._done -= past
        return places

    def ahead(self) -> list[Position]:
        """Return the preliminary places of the newest poses."""
        return [self._place(index) for index in range(self._done, len(self._poses))]

    def box_ahead(self) -> tuple[float, float, float, float] | None:
        """Return the bounds of the places of ``ahead``: least x, y, greatest x, y [m], or None."""
        if self._done == len(self._poses):
            return None
        # Places are means of poses, so the poses bound them.
        around = self._poses[max(self._done - self._beside, 0) :]
        xs, ys = [pose.x for pose in around], [pose.y for pose in around]
        return min(xs), min(ys), max(xs), max(ys)

    def end(self) -> list[Position]:
        """Return the last places, as the robot's track to its next pose is unknown."""
        places = self._places(len(self._poses))
        self._poses, self._farthest_m, self._done = [], [], 0
        self._scatter.break_track()
        return places

    @property
    def _beside(self) -> int:
        """Number of poses before and after a place in its window."""
        needed = (self._scatter.sigma_m / GOOD_ERROR_M) ** 2
        return min(max(math.ceil((needed - 1) / 2), 0), MOST_BESIDE)

    def _places(self, stop: int) -> list[Position]:
        places = [self._place(index) for index in range(self._done, stop)]
        self._done = max(self._done, stop)
        return places

    def _place(self, index: int) -> Position:
        poses, sigma_m = self._poses, self._scatter.sigma_m
        here, reach_m = poses[index], self._reach_m + SURE_SIGMAS * sigma_m
        beside = min(self._beside, index, len(poses) - 1 - index)
        for away in range(1, beside + 1):
            before, after = poses[index - away], poses[index + away]
            if (
                math.hypot(before.x - here.x, before.y - here.y) > reach_m
                or math.hypot(after.x - here.x, after.y - here.y) > reach_m
            ):
                beside = away - 1
                break
        around = poses[index - beside : index + beside + 1]
        count = len(around)
        x, y = sum([pose.x for pose in around]) / count, sum([pose.y for pose in around]) / count
        error_m = SURE_SIGMAS * sigma_m / math.sqrt(count)
        return Position(x, y, error_m, self._farthest_m[index], here.yaw)
