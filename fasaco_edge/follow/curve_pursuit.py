"""Velocities along a curve: pure pursuit by a base that cannot turn on the spot.

As ``follow/pursuit.py``, but no arc is tighter than the base's turning radius, and legs may be
driven backward: then the point ahead on the path lies behind the robot, and it steers as if it
looked there. It comes to rest where the path changes between forward and backward.
"""

from __future__ import annotations

import math

from fasaco_edge.follow.estimate import STAND, Command, Limits
from fasaco_edge.follow.pursuit import ARRIVED_M, LOOKAHEAD_M, LOOKAHEAD_S, Pursuit
from fasaco_edge.follow.route import Route
from fasaco_edge.grid.geometry import Pose2D

# It stands where the point ahead is farther off its heading; on a curve it is by a third of that
# [rad].
BESIDE_RAD = math.radians(60.0)
# The point ahead is at most this far away [turning radii]: arcs are hardly cut.
MOST_AHEAD = 0.7


class CurvePursuit(Pursuit):
    """Drives along curves, from one command to the next.

    ``last`` has the speed in the direction of driving.

    Args:
        limits: of the base, with a turning radius.
        period: from one command to the next [s].
    """

    def __init__(self, limits: Limits, period: float) -> None:
        super().__init__(limits, period)
        self._is_back = False

    @property
    def is_turning(self) -> bool:
        """Never: it cannot turn on the spot."""
        return False

    def brake(self) -> Command:
        """Return the next command of braking."""
        return self._sent(0.0, 0.0)

    def steer(self, pose: Pose2D, route: Route, most: float = math.inf) -> Command:
        """Return the next command, at most so fast [m/s]; ``STAND`` once the route is driven."""
        limits, here, self.is_lost = self._limits, (pose.x, pose.y), False
        route.pass_bends(here)
        while (leg := route.leg) is not None:
            along, _ = leg.placed(here)
            ends = route.ends(along, limits.speed**2 / limits.acceleration + limits.speed)
            left, speed = ends[0]
            if speed > 0.0 or left > ARRIVED_M or self._braked() > 0.0:
                break
            route.next_leg()
        if leg is None:
            self.stand()
            return STAND
        if leg.is_back != self._is_back:
            if self._braked() > 0.0:
                return self.brake()
            self.last, self._is_back = STAND, leg.is_back
        ahead = max(LOOKAHEAD_S * self.last.speed, LOOKAHEAD_M)
        x, y = route.carrot(max(along, 0.0), min(ahead, MOST_AHEAD * limits.turn_radius))
        yaw = pose.yaw + (math.pi if self._is_back else 0.0)
        error = math.remainder(math.atan2(y - pose.y, x - pose.x) - yaw, math.tau)
        if abs(error) > BESIDE_RAD:
            self.is_lost = True
            return self.brake()
        return self._sent(min(most, self._most(ends)), self._curvature(error, here, (x, y)))

    def _curvature(self, error: float, here: tuple[float, float], to: tuple[float, float]) -> float:
        """Return the curvature of the arc through a point, or the tightest one [1/m]."""
        most = 1.0 / self._limits.turn_radius
        curvature = 2.0 * math.sin(error) / max(math.dist(here, to), 1e-3)
        return min(max(curvature, -most), most)

    def _sent(self, most: float, curvature: float) -> Command:
        """Return the next command on an arc, at up to a speed; noted as the last one."""
        speed = self._sped(min(most, self._limits.turn_rate / max(abs(curvature), 1e-9)))
        rate, tightest = self._toward(speed * curvature), speed / self._limits.turn_radius
        self.last = Command(speed, min(max(rate, -tightest), tightest))
        return Command(-speed if self._is_back else speed, self.last.turn_rate)
