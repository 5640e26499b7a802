"""A walk as a line that keeps to the right, so that there and back are two lanes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]


def directions(points: Points) -> Points:
    """Return unit vectors (n - 1, 2) along points (n, 2), no two in succession equal."""
    steps = np.diff(points, axis=0)
    unit: Points = steps / np.hypot(steps[:, 0], steps[:, 1])[:, None]
    return unit


def lanes(points: Points, offset: float) -> tuple[Points, Points]:
    """Return start and end of every segment, both (m, 2), of the line beside ``points``.

    Args:
        points: a walk (n, 2) of right angles, no two points in succession equal.
        offset: how far to the right of the walk [same unit].
    """
    along = directions(points)
    right = np.stack([along[:, 1], -along[:, 0]], axis=1)
    cosine = (along[:-1] * along[1:]).sum(axis=1)
    turns, back = np.abs(cosine) < 0.5, cosine <= -0.5
    at_start, at_end = right.copy(), right.copy()
    # Where it turns, the two lanes meet beside the corner.
    at_end[:-1][turns] += right[1:][turns]
    at_start[1:][turns] += right[:-1][turns]
    # Where it turns back, they are joined a little beyond the centre.
    at_end[:-1][back] += along[:-1][back]
    at_start[1:][back] += along[:-1][back]
    starts, ends = points[:-1] + offset * at_start, points[1:] + offset * at_end
    corners = np.stack([starts, ends], axis=1).reshape(-1, 2)
    moved = (np.abs(np.diff(corners, axis=0)) > 1e-9).any(axis=1)
    return corners[:-1][moved], corners[1:][moved]


def arrow_places(points: Points, every: float) -> NDArray[np.intp]:
    """Return which segments of a walk carry an arrow: straight ones, about ``every`` apart."""
    along = directions(points)
    travelled = np.cumsum(np.hypot(*np.diff(points, axis=0).T))
    goes_on = (along[1:] * along[:-1]).sum(axis=1) > 0.99
    straight = np.zeros(len(along), np.bool_)
    straight[1:] |= goes_on
    straight[:-1] |= goes_on
    candidates = np.flatnonzero(straight)
    if not len(candidates):
        return candidates
    wanted = np.arange(every / 2, travelled[-1], every)
    nearest = np.searchsorted(travelled[candidates], wanted)
    return np.unique(candidates[nearest[nearest < len(candidates)]])
