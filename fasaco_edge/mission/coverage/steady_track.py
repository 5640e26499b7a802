"""A steady track: where the robot was, from poses that scatter.

A place is the mean of the poses around it: of as many as it takes to be right to a quarter of a
pixel, as many before as after it, and no farther away than the tool reaches. So exact poses are
taken as they are, and at once. Where poses scatter, places come some poses later.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.mission.coverage.floor_tiles import PIXEL_M
from fasaco_edge.mission.coverage.pose_scatter import PoseScatter

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
