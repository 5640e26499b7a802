"""Main directions: which way the lanes of a path run, region by region."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Edge of a region [steps], and at most about so many of them side by side.
REGION_STEPS = 5
MOST_ACROSS = 16
# Where less of the way than this runs in one direction, there is none.
LEAST_SHARE = 0.2
# A line is as long as this share of its region where all of the way runs along it.
LENGTH = 0.8


def main_directions(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a line, float64 (n, 2, 2), for each region that a path leads through.

    Back and forth is one direction: angles are doubled before they are averaged, so that the
    mean of opposite ones is their axis (K. V. Mardia, P. E. Jupp, Directional Statistics, 1.1).
    The line runs along that axis, the longer the more of the way does.

    Args:
        xy: points of the path [m], float64 (n, 2).
    """
    steps = np.diff(xy, axis=0)
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    moves = lengths > 0
    if not moves.any():
        return np.zeros((0, 2, 2))
    steps, lengths, middles = steps[moves], lengths[moves], (xy[1:] + xy[:-1])[moves] / 2
    edge = _edge(float(np.median(lengths)), float(np.ptp(xy, axis=0).max()))
    _, region = np.unique(np.floor(middles / edge), axis=0, return_inverse=True)
    region = region.ravel()
    doubled = 2 * np.arctan2(steps[:, 1], steps[:, 0])
    along, across, x, y = (
        np.bincount(region, lengths * part)
        for part in (np.cos(doubled), np.sin(doubled), middles[:, 0], middles[:, 1])
    )
    total = np.bincount(region, lengths)
    share, axis = np.hypot(along, across) / total, np.arctan2(across, along) / 2
    half = (LENGTH / 2 * edge * share) * np.array((np.cos(axis), np.sin(axis)))
    centre = np.array((x, y)) / total
    lines = np.stack((centre - half, centre + half)).transpose(2, 0, 1)
    return np.asarray(lines[share >= LEAST_SHARE], np.float64)


def _edge(step: float, extent: float) -> float:
    """Return the edge of a region [m]; it doubles, so that most regions stay where they were."""
    doublings = np.ceil(np.log2(max(extent / (MOST_ACROSS * REGION_STEPS * step), 1.0)))
    return float(REGION_STEPS * step * 2.0**doublings)
