"""Speed limits: rates under limits of acceleration, in equal time steps."""

from __future__ import annotations

import math


def stopping_rate(remaining: float, acceleration: float, period: float) -> float:
    """Return the highest rate that can be ramped down to rest within ``remaining``.

    The sum of v dt, (v - a dt) dt, ... is v^2 / 2a + v dt / 2; within one step it is v dt.
    """
    half_step = 0.5 * acceleration * period
    braking = math.sqrt(half_step**2 + 2.0 * acceleration * remaining) - half_step
    return min(braking, remaining / period)


def limited(rate: float, goal: float, step: float) -> float:
    """Return ``rate`` moved towards ``goal`` by at most ``step``."""
    return min(max(goal, rate - step), rate + step)
