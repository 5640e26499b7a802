"""Turning: durations of turns on the spot.

The robot brakes to a stop, turns, and starts again. Its rate of turning goes up, stays at its
limit and goes down (a trapezoid over time), or, in smaller turns, goes up and down (a triangle).
This module needs no compiler, so that a configuration can be checked without one.
"""

import math
from typing import NamedTuple


class Turning(NamedTuple):
    """Durations of turns.

    Attributes:
        steered_rad: a turn up to this is steered while driving, and takes no time [rad].
        stop_s: time lost by braking before any other turn and starting after it, compared with
            driving on [s].
        ramp_s: time for the rate to go from rest to its limit [s].
        full_rad: the smallest turn in which the rate reaches its limit [rad].
        radian_s: duration of a radian at that limit [s].
    """

    steered_rad: float
    stop_s: float
    ramp_s: float
    full_rad: float
    radian_s: float


def turn_seconds(turning: Turning, angle: float) -> float:
    """Return the duration of a turn by an angle in [0, pi] [s]; kernels compile this."""
    if angle <= turning.steered_rad:
        seconds = 0.0
    elif angle < turning.full_rad:
        seconds = turning.stop_s + 2.0 * turning.ramp_s * math.sqrt(angle / turning.full_rad)
    else:
        seconds = turning.stop_s + turning.ramp_s + turning.radian_s * angle
    return seconds


def proportional_turning(quarter_turn_s: float) -> Turning:
    """Return turns with durations proportional to the angle, ``quarter_turn_s`` for 90 degrees."""
    return Turning(0.0, 0.0, 0.0, 0.0, quarter_turn_s / (0.5 * math.pi))


def limited_turning(
    turn_deg_s: float,
    turn_deg_s2: float,
    speed_m_s: float,
    acceleration_m_s2: float,
    steered_deg: float,
) -> Turning:
    """Return turns of a robot with limited rates and accelerations.

    Args:
        turn_deg_s, turn_deg_s2: rate of turning on the spot, and its acceleration.
        speed_m_s, acceleration_m_s2: limits of driving. Braking and starting take twice as long as
            the same distance at full speed: speed / acceleration longer in all.
        steered_deg: a turn up to this is steered while driving [deg].
    """
    rate, acceleration = math.radians(turn_deg_s), math.radians(turn_deg_s2)
    return Turning(
        steered_rad=math.radians(steered_deg),
        stop_s=speed_m_s / acceleration_m_s2,
        ramp_s=rate / acceleration,
        full_rad=rate * rate / acceleration,
        radian_s=1.0 / rate,
    )
