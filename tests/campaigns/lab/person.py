"""A person with a joystick, who helps a robot that stands though there is work: by default nobody.

It is turned away from the nearest wall, and driven 0.4 m.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from fasaco_edge.follow.estimate import STAND, VelocityCommand
from tests.campaigns.lab.building import Building
from tests.campaigns.lab.settings import TICK_S

if TYPE_CHECKING:
    from tests.campaigns.lab.base import Base
    from tests.campaigns.lab.own import OwnBase

# Ends of the turn, of the drive after it, and of the stop after that [s].
TURNED_S, DRIVEN_S, HELPED_S = 4.0, 7.0, 8.0
SPEED_M_S, TURN_RAD_S, TURN_GAIN = 0.13, 0.8, 2.0
# Slowest wheel speed and turn rate that count as motion [m/s, rad/s].
STANDS_M_S, STANDS_RAD_S = 0.005, 0.02


class Person:
    """Helps after ``patience_s`` [s] of standing; 0 for never.

    Attributes:
        nudges: when the help began [s].
    """

    def __init__(self, building: Building, patience_s: float) -> None:
        self.nudges: list[float] = []
        self._patience_s = patience_s
        self._stood_s = 0.0
        self._geometry = building.geometry
        if patience_s:
            distance = ndimage.distance_transform_edt(~building.occupied)
            self._slope = np.gradient(ndimage.gaussian_filter(distance, 3))

    def note(self, base: Base | OwnBase, now: float, *, has_work: bool) -> None:
        """Look at the robot; begin to help if it has stood for long."""
        wheels = base.wheels
        stands = abs(wheels.speed) < STANDS_M_S and abs(wheels.turn_rate) < STANDS_RAD_S
        self._stood_s = self._stood_s + TICK_S if has_work and stands else 0.0
        if self._patience_s and self._stood_s > self._patience_s:
            self.nudges.append(now)
            self._stood_s = 0.0

    def helps(self, base: Base | OwnBase, now: float) -> VelocityCommand | None:
        """Return the joystick's command; None while nobody helps."""
        if not self.nudges or (since_s := now - self.nudges[-1]) >= HELPED_S:
            return None
        if since_s < TURNED_S:
            bend = math.remainder(self._away(base) - base.truth.yaw, math.tau)
            return VelocityCommand(0.0, max(-TURN_RAD_S, min(TURN_RAD_S, TURN_GAIN * bend)))
        return VelocityCommand(SPEED_M_S) if since_s < DRIVEN_S else STAND

    def _away(self, base: Base | OwnBase) -> float:
        """Return the direction away from the nearest wall [rad]."""
        col, row = self._geometry.to_pixels(base.truth.x, base.truth.y)
        up, right = (slope[int(row), int(col)] for slope in self._slope)
        return math.atan2(up, right)
