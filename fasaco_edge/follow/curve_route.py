"""The route along a curve, for a robot that cannot turn on the spot.

Its legs are chords of arcs, and lanes; the robot steers from each to the next. It comes to rest
only where it changes between forward and backward: a leg is driven backward if the path's heading
is opposite to it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from fasaco_edge.follow.estimate import Limits
from fasaco_edge.follow.route import (
    BEGINNING_M,
    NEAREST_M,
    Joining,
    Leg,
    Route,
)
from fasaco_edge.grid.geometry import Point, Pose2D

# Legs up to this long are chords of an arc [m].
CHORD_M = 0.06


class CurveRoute(Route):
    """A curve, and the leg of it that the robot is on."""

    def __init__(self, poses: Iterable[Pose2D], limits: Limits) -> None:
        super().__init__(poses, limits)
        # The leg before the first one, unless the robot comes to rest between them.
        self._behind: Leg | None = None

    def next_leg(self, here: Point | None = None) -> None:
        """Go on to the next leg; the robot does not return to a corner that it has missed."""
        leg = self.leg
        self._behind = None if leg is None or leg.stops else leg
        super().next_leg()

    def carrot(self, along: float, ahead: float) -> Point:
        """Return the point ``ahead`` of ``along`` the leg [m]; past a stop, further on the arc."""
        leg, before, to = self._leg_at(along + ahead)
        before = before or self._behind
        beyond = to - leg.length
        if beyond <= 0.0 or before is None or max(before.length, leg.length) > CHORD_M:
            return leg.at(to)
        heading = math.atan2(leg.uy, leg.ux)
        turn = math.remainder(heading - math.atan2(before.uy, before.ux), math.tau)
        curvature = 2.0 * turn / (before.length + leg.length)
        # At its end, an arc has turned by half of a chord's angle more.
        heading += 0.5 * (curvature * leg.length + curvature * beyond)
        x, y = leg.end
        return x + beyond * math.cos(heading), y + beyond * math.sin(heading)

    def join(self, here: Point, heading: float | None, before: Route | None) -> Joining:
        """Find the leg that passes the robot; see ``Route.join``.

        The robot steers to a leg beside it: it cannot turn towards the nearest point.
        """
        leg = self.leg
        if leg is None:
            return Joining.JOINED
        index, _ = self._passing(here, before)
        if self._legs[index].distance(here) <= NEAREST_M:
            del self._legs[:index]
            return Joining.JOINED
        if before is not None and (lead := before._lead_to(leg.start, here)):
            is_back = before._legs[len(lead) - 1].is_back
            most = math.inf if is_back == leg.is_back else 0.0
            self._legs[:0] = [*lead[:-1], replace(lead[-1], most=most, is_back=is_back)]
            return Joining.JOINED
        if heading is not None:
            return Joining.AT_REST
        return Joining.ELSEWHERE if math.dist(here, leg.start) > BEGINNING_M else Joining.JOINED

    def _leg_between(self, start: Pose2D, end: Pose2D) -> Leg:
        leg = super()._leg_between(start, end)
        return replace(leg, is_back=leg.ux * math.cos(start.yaw) + leg.uy * math.sin(start.yaw) < 0)

    def _ending(self, leg: Leg, after: Leg) -> Leg:
        return replace(leg, most=math.inf if after.is_back == leg.is_back else 0.0)
