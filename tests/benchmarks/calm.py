"""Calm of a line: how much it turns, whether it follows the walls, and how often it crosses itself.

Residents notice these figures more than the seconds. A line leads from point to point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# A way counts as along the walls within this angle of their direction, or across [deg].
ALONG_DEG = 3.0
# A turn back [deg].
BACK_DEG = 135.0
# Legs that are compared with all others at once.
AT_ONCE = 512


@dataclass(frozen=True, slots=True)
class Calm:
    """Figures of a line, for each square metre that it sweeps but for the share.

    Attributes:
        turning_deg: sum of its turns [deg].
        turns_back: turns of more than 135 degrees.
        crossings: of two legs, inside of both.
        along_share: share of its length within 3 degrees of the walls' directions.
    """

    turning_deg: float
    turns_back: float
    crossings: float
    along_share: float


def calm_of(xy: NDArray[np.float64], swept_m2: float, walls_deg: float) -> Calm:
    """Return the figures of a line.

    Args:
        xy: float64 (n, 2): its points [m], not all in one place.
        swept_m2: floor that it sweeps [m2], above 0.
        walls_deg: direction of the walls, any of the four [deg].
    """
    legs = np.diff(xy, axis=0)
    lengths = np.hypot(*legs.T)
    kept = lengths > 1e-6
    legs, lengths = legs[kept], lengths[kept]
    begins = xy[:-1][kept]
    headings = np.degrees(np.arctan2(legs[:, 1], legs[:, 0]))
    turns = np.abs((np.diff(headings) + 180.0) % 360.0 - 180.0)
    off = np.abs((headings - walls_deg + 45.0) % 90.0 - 45.0)
    return Calm(
        turning_deg=float(turns.sum()) / swept_m2,
        turns_back=int(np.count_nonzero(turns > BACK_DEG)) / swept_m2,
        crossings=_crossings(begins, begins + legs) / swept_m2,
        along_share=float(lengths[off <= ALONG_DEG].sum() / lengths.sum()),
    )


def _crossings(a: NDArray[np.float64], b: NDArray[np.float64]) -> int:
    """Return how many pairs of segments a to b cross, each inside of the other's ends."""

    def side(
        p: NDArray[np.float64], q: NDArray[np.float64], r: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return on which side of the line from p to q a point is: -1, 0 or 1."""
        to_q, to_r = q - p, r - p
        across = to_q[..., 0] * to_r[..., 1] - to_q[..., 1] * to_r[..., 0]
        return np.sign(across)

    found = 0
    for first in range(0, len(a), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        p, q = a[part, None], b[part, None]
        apart = side(p, q, a) * side(p, q, b) < 0.0
        found += int(np.count_nonzero(apart & (side(a, b, p) * side(a, b, q) < 0.0)))
    return found // 2
