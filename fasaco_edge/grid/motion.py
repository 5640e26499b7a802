"""Rates under limits of acceleration, in equal steps of time."""

from __future__ import annotations

import math


def stopping_rate(remaining: float, acceleration: float, period: float) -> float:
    """Return the highest rate from which equal steps down come to rest within ``remaining``.

    The sum of v dt, (v - a dt) dt, ... is v^2 / 2a + v dt / 2; below one step, v dt is all.
    """
    half_step = 0.5 * acceleration * period
    braking = math.sqrt(half_step**2 + 2.0 * acceleration * remaining) - half_step
    return min(braking, remaining / period)


def limited(rate: float, goal: float, step: float) -> float:
    """Return ``goal``, or what is ``step`` nearer to it than ``rate``."""
    return min(max(goal, rate - step), rate + step)
