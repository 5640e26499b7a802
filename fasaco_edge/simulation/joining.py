"""How a robot under way takes up a new path.

A path begins at the centre of the cell the robot was in when it was planned.
Since then the robot has gone on: through the first waypoints, if the new path
begins like the old one, or off to a side. Only what it has driven through may
be left out. To ask merely where the robot is would not do: a path that goes
into a dead end and comes back passes the same place twice.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.simulation.robot import corners

Point = tuple[float, float]

# A waypoint is driven through if a point of the track is this near; it must not be less
# than half the track's spacing [m].
PASSED_WITHIN_M = 0.02
# As a last resort the path is joined anywhere in this much of its beginning [m].
JOIN_WITHIN_M = 2.0


def joined(
    path: NDArray[np.float64],
    track: NDArray[np.float64],
    is_clear: Callable[[Point, Point], bool],
) -> NDArray[np.float64] | None:
    """Return the corners to drive through from the track's last point to the path's end.

    Straight to the first waypoint not yet driven through, or to the one before it. If
    neither way is clear, back along the track until one is; if none ever is, to the
    nearest waypoint of the first metres that can be reached.

    Args:
        path: waypoints [m], float64 (n, 2).
        track: points [m] the robot came through lately, float64 (m, 2), m >= 1; the last
            is where it is, or can come to rest.
        is_clear: tells whether the robot can move straight between two points.

    Returns:
        float64 (k, 2); (0, 2) if nothing is left to drive; None if there is no way now.
    """
    passed = passed_waypoints(path, track)
    if passed == len(path):
        return path[:0]
    targets = [target for target in (passed, passed - 1) if target >= 0]
    for gone_back in range(1, len(track) + 1):
        here = track[-gone_back]
        for target in targets:
            if is_clear(_point(here), _point(path[target])):
                return corners(np.vstack((track[: -gone_back - 1 : -1], path[target:])))[1:]
    for target in _nearest_first(path, track[-1]):
        if is_clear(_point(track[-1]), _point(path[target])):
            return corners(np.vstack((track[-1], path[target:])))[1:]
    return None


def passed_waypoints(path: NDArray[np.float64], track: NDArray[np.float64]) -> int:
    """Return how many of the first waypoints the robot drove through, in order.

    Counted from its latest visit to the first one: visits before that belong to
    paths before this one.

    Args:
        path: waypoints [m], float64 (n, 2).
        track: points [m], float64 (m, 2), the latest last.
    """
    since = 0
    for index, waypoint in enumerate(path):
        offsets = track[since:] - waypoint
        near = np.flatnonzero(np.hypot(offsets[:, 0], offsets[:, 1]) <= PASSED_WITHIN_M)
        if len(near) == 0:
            return index
        since += int(near[-1 if index == 0 else 0])
    return len(path)


def _nearest_first(path: NDArray[np.float64], here: NDArray[np.float64]) -> Iterator[int]:
    """Yield the waypoints of the path's first metres, the nearest first."""
    steps = np.diff(path, axis=0)
    way = np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))
    head = path[: 1 + int(np.searchsorted(way, JOIN_WITHIN_M, side="right"))]
    distances = np.hypot(head[:, 0] - here[0], head[:, 1] - here[1])
    yield from (int(index) for index in np.argsort(distances, kind="stable"))


def _point(row: NDArray[np.float64]) -> Point:
    return float(row[0]), float(row[1])
