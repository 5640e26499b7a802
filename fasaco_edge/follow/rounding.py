"""Rounding of corners: how fast a robot can turn at a corner while it drives on.

It turns as on the spot, up to the limits of the base, and begins so early that half of the turn is
done beside the corner. The turn takes the same time at any speed, so the distance from the corner
is proportional to the speed: the allowed distance determines the speed.
"""

from __future__ import annotations

import math
from functools import lru_cache

from fasaco_edge.follow.estimate import Limits

# A corner is passed within this distance [m]: less than a map resolves, and less than poses
# scatter.
ROUNDED_M = 0.02
# At sharper corners the robot turns on the spot [rad].
SHARP_RAD = math.radians(135.0)
# Time steps of half a turn.
STEPS = 32


@lru_cache(maxsize=1024)
def times(turn: float, turn_rate: float, turn_acceleration: float) -> tuple[float, float]:
    """Return how long before a corner its turn begins [s], and how far from the corner the robot
    passes, as seconds of driving [s].

    Args:
        turn: in the corner, above 0 and below pi [rad].
        turn_rate, turn_acceleration: limits of the base [rad/s, rad/s^2].
    """
    ramp_s = min(math.sqrt(turn / turn_acceleration), turn_rate / turn_acceleration)
    half_s = 0.5 * ramp_s + 0.5 * turn / (turn_acceleration * ramp_s)
    step_s = half_s / STEPS
    along = aside = 0.0
    for step in range(STEPS):
        now = (step + 0.5) * step_s
        turned = 0.5 * turn_acceleration * min(now, ramp_s) ** 2
        turned += turn_acceleration * ramp_s * max(now - ramp_s, 0.0)
        along += step_s * math.cos(turned)
        aside += step_s * math.sin(turned)
    # Half of the turn is done on the line that halves the corner.
    return along + aside * math.tan(0.5 * turn), aside / math.cos(0.5 * turn)


def rounding(turn: float, room: float, limits: Limits) -> tuple[float, float]:
    """Return the greatest speed in a corner [m/s], and how long before it the turn begins [s].

    Args:
        turn: in the corner, 0 or more [rad].
        room: way before and after the corner that the turn may take [m].
        limits: of the base.

    Returns:
        a speed of 0 where the robot has to turn on the spot, and infinity where it steers.
    """
    if turn <= limits.steered:
        return math.inf, 0.0
    if turn > SHARP_RAD:
        return 0.0, 0.0
    early_s, aside_s = times(turn, limits.turn_rate, limits.turn_acceleration)
    return min(ROUNDED_M / aside_s, room / early_s, limits.speed), early_s
