"""Alignment of a line with its walk: the cell of the walk that each point stands for.

The polisher moves, removes and inserts points, and its lanes may differ from those of the walk; so
the cells are found again by place (dynamic time warping, Sakoe and Chiba 1978).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.mission.line.polyline import Numbers, Points

# Squared distance to a cell without a stand [pixels2]: more than any other.
NOWHERE_PX2 = 1e12


def aligned(points: Points, stands: Points) -> Numbers:
    """Return the index of each point's stand, ascending; ends belong to ends.

    The sum of the squared distances between points and their stands is the least.

    Args:
        points: float64 (n, 2): y, x [pixels], n of 2 or more.
        stands: float64 (m, 2), the same, NaN where a cell has none; m of 1 or more.

    Returns:
        int64 (n,).
    """
    apart = (points[:, :1] - stands[:, 0]) ** 2 + (points[:, 1:] - stands[:, 1]) ** 2
    apart[np.isnan(apart)] = NOWHERE_PX2
    # Least sums of the points up to now, by the last point's stand.
    sums = np.empty_like(apart)
    sums[0] = np.inf
    sums[0, 0] = 0.0
    for number in range(1, len(points)):
        np.minimum.accumulate(sums[number - 1], out=sums[number])
        sums[number] += apart[number]
    found = np.empty(len(points), np.int64)
    found[-1] = len(stands) - 1
    for number in range(len(points) - 2, -1, -1):
        found[number] = np.argmin(sums[number, : found[number + 1] + 1])
    return found


def by_distance(place: Points, stands: Points) -> NDArray[np.intp]:
    """Return the indices of stands by their distance to a place, (2,); NaN stands last."""
    apart: NDArray[np.float64] = ((stands - place) ** 2).sum(axis=1)
    return np.argsort(apart, kind="stable")
