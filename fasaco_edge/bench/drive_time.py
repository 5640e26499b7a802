"""Drive time of a line, by the robot's limits: it comes to rest wherever it turns on the spot.

Between two such places it speeds up, drives and brakes (a trapezoid of speed over time, or a
triangle on short ways); a turn is a trapezoid of its rate. Knows nothing of what planners assume.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class DriveLimits:
    """What bounds a robot's motion, beside its speed.

    Attributes:
        acceleration_m_s2: of driving, up and down.
        turn_deg_s, turn_deg_s2: rate of turning on the spot, and its acceleration.
        steered_deg: a bend up to this is steered without a stop.
    """

    acceleration_m_s2: float
    turn_deg_s: float
    turn_deg_s2: float
    steered_deg: float = 1.0


def drive_seconds(
    ways_m: NDArray[np.float64], bends_deg: NDArray[np.float64], speed_m_s: float, by: DriveLimits
) -> float:
    """Return what driving along a line takes [s].

    Args:
        ways_m: float64 (n,), lengths between its points [m].
        bends_deg: float64 (n - 1,), turns at the points between, in [0, 180].
        speed_m_s: the robot's speed.
        by: its limits.
    """
    if not len(ways_m):
        return 0.0
    is_stop = bends_deg > by.steered_deg
    runs_m = np.add.reduceat(ways_m, np.concatenate([[0], np.flatnonzero(is_stop) + 1]))
    runs_s = _from_rest_to_rest(runs_m, speed_m_s, by.acceleration_m_s2)
    turns_s = _from_rest_to_rest(bends_deg[is_stop], by.turn_deg_s, by.turn_deg_s2)
    return float(runs_s.sum() + turns_s.sum())


def _from_rest_to_rest(
    ways: NDArray[np.float64], most_speed: float, acceleration: float
) -> NDArray[np.float64]:
    """Return the least seconds for ways, angles or lengths, from standstill to standstill."""
    ramp = most_speed / acceleration
    return np.where(
        ways < most_speed * ramp, 2.0 * np.sqrt(ways / acceleration), ways / most_speed + ramp
    )
