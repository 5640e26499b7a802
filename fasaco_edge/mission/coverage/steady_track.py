"""A steady track: where the robot was, from poses that scatter.

A place is the mean of the poses around it: of as many as it takes to be right to a quarter of a
pixel, as many before as after it, and no farther away than the tool reaches. So exact poses are
taken as they are, and at once. Where poses scatter, places come some poses later.

How far poses scatter is estimated from three in a row. A robot drives smoothly: in a tenth of a
second no drive takes it off the straight way between the pose before and the pose after by more
than some millimetres. What a pose is off that way, across it, is an error of localisation; along
it, it would be one of the poses' times. Three errors of standard deviation s across the way make
one of sqrt(1 + 1/4 + 1/4) s, whose median size is 0.674 times that. The median of the last ones is
taken: corners between poses far apart are few of them. What does not change from pose to pose, a
drift, is not seen.
"""

from __future__ import annotations

import math
from collections import deque
from statistics import median
from typing import NamedTuple

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.mission.coverage.floor_tiles import PIXEL_M

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


# Standard deviations within which a pose is taken to be right: 95 % are.
SURE = 2.0
# A place that is so right needs no more poses [m].
RIGHT_M = PIXEL_M / 4
# The most poses before and after a place.
MOST_BESIDE = 15


class Place(NamedTuple):
    """Where the robot was: x, y [m], and within which distance of that, to each side [m]."""

    x: float
    y: float
    error_m: float


class SteadyTrack:
    """Turns poses into places."""

    def __init__(self, tool_m: float) -> None:
        """Begin without a pose; ``tool_m``: width of the tool [m]."""
        self._reach_m = 0.5 * tool_m
        self._scatter = PoseScatter()
        # The poses that still matter, and how many of them have become places.
        self._poses: list[Pose2D] = []
        self._done = 0

    def add(self, pose: Pose2D) -> list[Place]:
        """Take in the next pose; return the places that are certain now."""
        self._scatter.note(pose)
        self._poses.append(pose)
        places = self._places(len(self._poses) - self._beside)
        past = max(self._done - MOST_BESIDE, 0)
        del self._poses[:past]
        self._done -= past
        return places

    @property
    def is_behind(self) -> bool:
        """Whether the places of some poses are still to come."""
        return self._done < len(self._poses)

    def ahead(self) -> list[Place]:
        """Return the places of the newest poses, as they seem now."""
        return [self._place(index) for index in range(self._done, len(self._poses))]

    def box_ahead(self) -> tuple[float, float, float, float] | None:
        """Return a box that these places lie in: least x and y, most x and y [m]; None for none."""
        if not self.is_behind:
            return None
        # Each is a mean of poses.
        around = self._poses[max(self._done - self._beside, 0) :]
        xs, ys = [pose.x for pose in around], [pose.y for pose in around]
        return min(xs), min(ys), max(xs), max(ys)

    def end(self) -> list[Place]:
        """Return the last places: the way of the robot to its next pose is unknown."""
        places = self._places(len(self._poses))
        self._poses, self._done = [], 0
        self._scatter.break_track()
        return places

    @property
    def _beside(self) -> int:
        """How many poses before and after a place are taken."""
        needed = (self._scatter.sigma_m / RIGHT_M) ** 2
        return min(max(math.ceil((needed - 1) / 2), 0), MOST_BESIDE)

    def _places(self, stop: int) -> list[Place]:
        places = [self._place(index) for index in range(self._done, stop)]
        self._done = max(self._done, stop)
        return places

    def _place(self, index: int) -> Place:
        poses, sigma_m = self._poses, self._scatter.sigma_m
        here, reach_m = poses[index], self._reach_m + SURE * sigma_m
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
        return Place(x, y, SURE * sigma_m / math.sqrt(count))
