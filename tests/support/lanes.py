"""Share of a line that runs along lanes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Largest angle between a segment along the lanes and the lanes [deg].
ALONG_DEG = 15.0


def along_share(xy: NDArray[np.float64], angle_deg: float) -> float:
    """Return the share of a line's length, points (n, 2) [m], at an angle to the x axis [deg]."""
    x, y = np.diff(xy, axis=0).T
    lengths = np.hypot(x, y)
    aside = np.abs((np.degrees(np.arctan2(y, x)) - angle_deg + 90.0) % 180.0 - 90.0)
    return float(lengths[aside <= ALONG_DEG].sum() / lengths.sum())
