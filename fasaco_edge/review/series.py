"""The figures of a review over time, for pictures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.review.review import Review

Points = tuple[NDArray[np.float64], NDArray[np.float64]]
"""When [s], and how much from then on; both float64 (n,)."""


def covered_share(review: Review) -> Points:
    """Return which share of the cells coverable at the end was covered, 0 to 1.

    Where some were covered before the recording began, the share of what was known then.
    """
    restored = any(status.restored_cells for status in review.story.statuses)
    if review.drive is None or restored:
        return review.known_fractions[:, 0], review.known_fractions[:, 1]
    count = len(review.first_s)
    coverable = max(review.drive.coverage.coverable, 1)
    return review.first_s, (np.arange(count) + 1.0) / coverable


def replan_times(review: Review) -> Points:
    """Return when each replan came [s], and how long it took [ms]."""
    timed = [path for path in review.replans.later if path.plan_ms is not None]
    return (
        np.array([path.at_s for path in timed], np.float64),
        np.array([path.plan_ms for path in timed], np.float64),
    )
