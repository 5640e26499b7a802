"""Velocity commands along a route: regulated pure pursuit on its legs, turns at its corners.

Source: R. C. Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01:
the robot steers the arc through a point of the path some way ahead, of curvature 2 y / L^2. The
speed is regulated as by S. Macenski et al., Regulated Pure Pursuit for Robot Path Tracking (2023),
but by the limits of the base: it brakes to come to rest at each stop, and respects the turn rate.
Deviations: past a corner the point lies straight on, so that the corner is not cut; corners are
rounded at the speed that ``follow/legs.py`` allows; and a robot with a large heading error
comes to rest and turns on the spot.
"""

from __future__ import annotations

import math

from fasaco_edge.follow.estimate import STAND, BaseLimits, VelocityCommand
from fasaco_edge.follow.route import LegRoute
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.motion import limited, stopping_rate

# Lookahead time [s], and least lookahead distance [m].
LOOKAHEAD_S, LOOKAHEAD_M = 0.8, 0.2
# Distance within which the robot has reached a stop [m].
ARRIVED_M = 0.005
# Heading error below which the robot starts to drive, and above which it turns on the spot [rad].
ALIGNED_RAD, MISALIGNED_RAD = 0.03, 0.2
# Largest duration of a cycle taken into account [periods]; factor by which the expected delay
# decays with each cycle.
MOST_PERIODS = 4.0
FORGETTING = 0.98

Ends = list[tuple[float, float]]
"""Corners ahead: distance of each [m], and the greatest speed there [m/s]."""


class Pursuit:
    """Commands along routes, one per cycle.

    On a busy computer a command comes late, and the robot drives on with the last command. The next
    command then brakes by as much as was possible since then. The robot also brakes earlier, by the
    distance that it would drive on in such a delay.

    ``period``: time from one command to the next [s].
    """

    def __init__(self, limits: BaseLimits, period: float) -> None:
        self._limits = limits
        self._period = period
        # Whether the robot turns on the spot; and whether it cannot steer to the route.
        self._is_turning, self.is_lost = True, False
        # Time since the last command, and the expected delay of the next command [s].
        self._seconds, self._late = period, 0.0
        self.last = STAND

    def note_time(self, seconds: float) -> None:
        """Note the time since the last command [s]."""
        self._seconds = min(max(seconds, self._period), MOST_PERIODS * self._period)
        self._late = max(self._seconds - self._period, FORGETTING * self._late)

    def stand(self) -> None:
        """Note that the robot was commanded to stop at once."""
        self._is_turning, self.last = True, STAND

    @property
    def is_turning(self) -> bool:
        """Whether the robot turns on the spot, or comes to rest to turn."""
        return self._is_turning

    def brake(self) -> VelocityCommand:
        """Return the next command to brake to rest."""
        self._is_turning, self.last = True, VelocityCommand(self._braked(), self._toward(0.0))
        return self.last

    def steer(self, pose: Pose2D, route: LegRoute, most: float = math.inf) -> VelocityCommand:
        """Return the next command, up to ``most`` [m/s]; ``STAND`` once the route is driven."""
        limits, here, self.is_lost = self._limits, (pose.x, pose.y), False
        route.pass_bends(here)
        # Half a cycle early, as a turn can begin only with a cycle.
        early = 0.5 * self._period * self.last.speed
        early_x, early_y = early * math.cos(pose.yaw), early * math.sin(pose.yaw)
        route.round_corner((pose.x + early_x, pose.y + early_y), self.last.speed)
        while (leg := route.leg) is not None:
            along, _ = leg.along_and_left(here)
            ends = route.ends(along, limits.speed**2 / limits.acceleration + limits.speed)
            left, speed = ends[0]
            if speed > 0.0 or left > ARRIVED_M or self._braked() > 0.0:
                return self._along(pose, route, along, ends, most)
            route.next_leg(here)
            self._is_turning, route.rounds = True, 0.0
        self.stand()
        return STAND

    def _along(
        self, pose: Pose2D, route: LegRoute, along: float, ends: Ends, most: float
    ) -> VelocityCommand:
        """Return the next command on a leg; the robot is ``along`` it [m]."""
        most = min(most, self._most(ends))
        leg = route.leg
        assert leg is not None
        if route.rounds > 0.0:
            # Turn, and drive on.
            error = math.remainder(math.atan2(leg.uy, leg.ux) - pose.yaw, math.tau)
            self._is_turning = False
            speed = self._sped(min(most, route.rounds))
            self.last = VelocityCommand(speed, self._toward(self._turning(error)))
            if abs(error) <= ALIGNED_RAD:
                route.rounds = 0.0
            return self.last
        ahead = max(LOOKAHEAD_S * self.last.speed, LOOKAHEAD_M)
        x, y = route.carrot(max(along, 0.0), ahead)
        error = math.remainder(math.atan2(y - pose.y, x - pose.x) - pose.yaw, math.tau)
        if abs(error) > MISALIGNED_RAD:
            self._is_turning = True
        elif abs(error) <= ALIGNED_RAD:
            self._is_turning = False
        if self._is_turning:
            # Turn on the spot, once at rest.
            speed = self._braked()
            rate = self._turning(error) if speed == 0.0 else 0.0
        else:
            speed, rate = self._arc(
                error, max(math.dist((pose.x, pose.y), (x, y)), LOOKAHEAD_M), most
            )
        self.last = VelocityCommand(speed, self._toward(rate))
        return self.last

    def _arc(self, error: float, far: float, most: float) -> tuple[float, float]:
        """Return the next speed [m/s], up to ``most``, and rate of turning [rad/s], on the arc
        through a point ``far`` away [m] and ``error`` off the heading [rad]."""
        tightest = 1.0 / self._limits.turn_radius if self._limits.turn_radius else math.inf
        curvature = min(max(2.0 * math.sin(error) / far, -tightest), tightest)
        speed = self._sped(min(most, self._limits.turn_rate / max(abs(curvature), 1e-9)))
        return speed, speed * curvature

    def _most(self, ends: Ends) -> float:
        """Return the greatest speed from which the corners ahead can be passed [m/s]."""
        limits, most = self._limits, self._limits.speed
        for left, speed in ends:
            # The robot brakes as if to a stop this far beyond the corner.
            further = min(speed, limits.speed) ** 2 / (2.0 * limits.acceleration)
            way = max(left + further - self.last.speed * self._late, 0.0)
            most = min(most, max(stopping_rate(way, limits.acceleration, self._period), speed))
        return most

    def _turning(self, error: float) -> float:
        """Return the turn rate for a remaining angle [rad/s]."""
        limits = self._limits
        left = max(abs(error) - abs(self.last.turn_rate) * self._late, 0.0)
        rate = min(stopping_rate(left, limits.turn_acceleration, self._period), limits.turn_rate)
        return math.copysign(rate, error)

    def _sped(self, goal: float) -> float:
        """Return the next speed towards a wanted speed [m/s]."""
        most = self.last.speed + self._limits.acceleration * self._period
        return min(max(goal, self._braked()), most)

    def _braked(self) -> float:
        """Return the lowest speed that the base can reach with this command [m/s]."""
        return max(self.last.speed - self._limits.acceleration * self._seconds, 0.0)

    def _toward(self, turn_rate: float) -> float:
        last = self.last.turn_rate
        seconds = self._seconds if abs(turn_rate) < abs(last) else self._period
        return limited(last, turn_rate, self._limits.turn_acceleration * seconds)


# Angle between the heading and the point ahead above which the robot has lost the curve [rad]; on
# the curve, the angle stays below a third of this.
BESIDE_RAD = math.radians(60.0)
# Largest lookahead distance on a curve [turning radii], so that arcs are hardly cut.
MOST_AHEAD = 0.7


class CurvePursuit(Pursuit):
    """Commands along curves: pure pursuit for a base that cannot turn on the spot.

    No arc is tighter than the base's turning radius. A leg may be driven backward: then the robot
    steers as if it faced backward, and ``last`` has the speed in the direction of driving. It comes
    to rest where the path changes between forward and backward.
    """

    def __init__(self, limits: BaseLimits, period: float) -> None:
        super().__init__(limits, period)
        self._is_back = False

    @property
    def is_turning(self) -> bool:
        """False: the base cannot turn on the spot."""
        return False

    def brake(self) -> VelocityCommand:
        """Return the next command to brake to rest."""
        return self._sent(self._braked(), 0.0)

    def _along(
        self, pose: Pose2D, route: LegRoute, along: float, ends: Ends, most: float
    ) -> VelocityCommand:
        leg = route.leg
        assert leg is not None
        if leg.is_back != self._is_back:
            if self._braked() > 0.0:
                return self.brake()
            self.last, self._is_back = STAND, leg.is_back
        ahead = max(LOOKAHEAD_S * self.last.speed, LOOKAHEAD_M)
        x, y = route.carrot(max(along, 0.0), min(ahead, MOST_AHEAD * self._limits.turn_radius))
        yaw = pose.yaw + (math.pi if self._is_back else 0.0)
        error = math.remainder(math.atan2(y - pose.y, x - pose.x) - yaw, math.tau)
        if abs(error) > BESIDE_RAD:
            self.is_lost = True
            return self.brake()
        far = max(math.dist((pose.x, pose.y), (x, y)), 1e-3)
        return self._sent(*self._arc(error, far, min(most, self._most(ends))))

    def _sent(self, speed: float, rate: float) -> VelocityCommand:
        """Return the next command, limited to the base's turning radius."""
        rate, tightest = self._toward(rate), speed / self._limits.turn_radius
        self.last = VelocityCommand(speed, min(max(rate, -tightest), tightest))
        return VelocityCommand(-speed if self._is_back else speed, self.last.turn_rate)
