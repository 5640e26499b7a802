"""Spread of repeated measurements: median, least and most, as other load would distort a mean."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np


@dataclass(frozen=True, slots=True)
class Spread:
    """Median, least and most of some measurements."""

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Self | None:
        """Return the spread of values; None without values."""
        if not values:
            return None
        return cls(statistics.median(values), min(values), max(values))

    def document(self) -> dict[str, float]:
        """Return this as JSON values."""
        return {name: round(getattr(self, name), 6) for name in ("median", "low", "high")}


def median(spread: Spread | None) -> float | None:
    """Return the median; None if nothing was measured."""
    return spread.median if spread else None


def document(spread: Spread | None) -> dict[str, float] | None:
    """Return a spread as JSON values; None if nothing was measured."""
    return spread.document() if spread else None


def text(spread: Spread | None, digits: int) -> tuple[str, str]:
    """Return median and range as texts of a table."""
    if spread is None:
        return "-", "-"
    return f"{spread.median:.{digits}f}", f"{spread.low:.{digits}f} .. {spread.high:.{digits}f}"


def percentile(values: Sequence[float], percent: float) -> float | None:
    """Return the percentile by nearest rank, so one of the values; None without values.

    Of 200 values, the 99th percentile is the third largest.
    """
    if not values:
        return None
    return float(np.percentile(values, percent, method="inverted_cdf"))
