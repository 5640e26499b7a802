"""How far a robot is on its path."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Pose2D

# Poses come more often than steps are driven: further ahead, a path may pass the place again.
LOOK_AHEAD_STEPS = 8


class Walk:
    """A path, and which of its points the robot is at.

    Attributes:
        xy: float64 (n, 2), points [m].
        revision: number of the path.
        at: index of the point the robot came to last.
    """

    def __init__(self, xy: NDArray[np.float64] | None = None, revision: int = 0) -> None:
        self.xy = np.zeros((0, 2)) if xy is None else xy
        self.revision = revision
        self.at = 0

    def left(self, steps: int) -> None:
        """Note that the daemon says so many steps are left."""
        self.at = max(self.at, len(self.xy) - 1 - max(steps, 0))

    def passed(self, pose: Pose2D) -> None:
        """Note where the robot is; it goes forward only."""
        near = self.xy[self.at : self.at + LOOK_AHEAD_STEPS]
        if len(near) < 2:
            return
        step_m = float(np.hypot(*(near[1] - near[0])))
        away = np.hypot(near[:, 0] - pose.x, near[:, 1] - pose.y)
        closest = int(np.argmin(away))
        if away[closest] <= step_m:
            self.at += closest

    def ahead(self, pose: Pose2D | None) -> NDArray[np.float64]:
        """Return what is still to be driven, float64 (n, 2) [m], from the robot on."""
        rest = self.xy[self.at + 1 :]
        if not len(rest):
            return rest
        here = self.xy[self.at] if pose is None else np.array([pose.x, pose.y])
        return np.concatenate([here[None, :], rest])
