"""Paths that take the place of others: which of them change what lies just ahead of the robot."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.mission.core.path_exit import PublishedPath

# Distance ahead within which changes count, and least shift of the path that is a change [m].
AHEAD_M, MOVED_M = 2.0, 0.05
# Distance of the compared points of a path [m].
STEP_M = 0.02
# Number of these points by which the beginning of a path may be off.
SLACK = 10
# The robot has come at most so far along its path from one look to the next [m]: paths cross.
REACH_M = 1.0
LOOK_TICKS = 5
Points = NDArray[np.float64]


class PathAhead:
    """A path, and how far a robot has come along it."""

    def __init__(self, xy: Points) -> None:
        self._xy = xy
        ways = np.hypot(*np.diff(xy, axis=0).T) if len(xy) > 1 else np.zeros(0)
        self._along = np.concatenate([[0.0], np.cumsum(ways)])
        self._come_m = 0.0

    def look(self, x: float, y: float) -> None:
        """Note where the robot is."""
        if len(self._xy) < 2:
            return
        ahead = np.arange(self._come_m, min(self._come_m + REACH_M, self._along[-1]), STEP_M)
        if len(ahead):
            points = self._at(ahead)
            nearest = int(np.argmin(np.hypot(points[:, 0] - x, points[:, 1] - y)))
            self._come_m = float(ahead[nearest])

    def ahead(self) -> Points:
        """Return points of the next metres, ``STEP_M`` apart, float64 (n, 2)."""
        if not len(self._xy):
            return self._xy
        left_m = self._along[-1] - self._come_m
        return self._at(self._come_m + np.arange(0.0, min(AHEAD_M, left_m) + 1e-9, STEP_M))

    def _at(self, along: NDArray[np.float64]) -> Points:
        xs, ys = (np.interp(along, self._along, axis) for axis in self._xy.T)
        return np.stack([xs, ys], axis=1)


def changes_ahead(
    paths: Sequence[tuple[int, PublishedPath]], x: NDArray[np.float64], y: NDArray[np.float64]
) -> Iterator[bool]:
    """Yield of each path but the first whether it changes what lies just ahead of the robot.

    Args:
        paths: each with the number of ticks before it.
        x, y: where the product has the robot tick by tick [m].
    """
    before: PathAhead | None = None
    begun = 0
    for tick, path in paths:
        if before is not None:
            for at in (*range(begun, tick, LOOK_TICKS), tick):
                before.look(x[at], y[at])
        now = PathAhead(path.xy)
        if before is not None:
            now.look(x[tick], y[tick])
            yield differs(before.ahead(), now.ahead())
        before, begun = now, tick


def differs(before: Points, after: Points) -> bool:
    """Return whether a stretch of path leads elsewhere than the one before it, or ends earlier."""
    if not len(before) or len(after) < len(before) - SLACK:
        return len(before) != len(after)
    common = min(len(before), len(after))
    padded = np.pad(after, ((SLACK, SLACK), (0, 0)), constant_values=np.inf)
    apart = np.min(
        [
            np.hypot(*(before[:common] - padded[shift : shift + common]).T)
            for shift in range(2 * SLACK + 1)
        ],
        axis=0,
    )
    return bool((apart > MOVED_M).any())
