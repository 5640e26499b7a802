"""The spread of repeated measurements in three numbers: a mean is sensitive to other load."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self


@dataclass(frozen=True, slots=True)
class Spread:
    """Median, least and most of some measurements."""

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Self | None:
        """Sum up ``values``; None where there are none."""
        if not values:
            return None
        return cls(statistics.median(values), min(values), max(values))

    def document(self) -> dict[str, float]:
        """Return this as JSON values."""
        return {name: round(getattr(self, name), 6) for name in ("median", "low", "high")}


def median(spread: Spread | None) -> float | None:
    """Return the median, None where nothing was measured."""
    return spread.median if spread else None


def document(spread: Spread | None) -> dict[str, float] | None:
    """Return a spread as JSON values, None where nothing was measured."""
    return spread.document() if spread else None


def text(spread: Spread | None, digits: int) -> tuple[str, str]:
    """Return median and range as texts of a table."""
    if spread is None:
        return "-", "-"
    return f"{spread.median:.{digits}f}", f"{spread.low:.{digits}f} .. {spread.high:.{digits}f}"


def percentile(values: Sequence[float], percent: float) -> float | None:
    """Return the least of ``values`` that ``percent`` of them do not exceed (nearest rank).

    One of the values, never a number between two: of 200, the 99th percentile is
    the third from the top.
    """
    if not values:
        return None
    rank = max(math.ceil(percent / 100.0 * len(values)), 1)
    return sorted(values)[rank - 1]
