"""Route along a path: legs, the corners to round or to stop at, and the robot's progress.

A coverage path crosses and touches itself, so the robot's position does not determine its progress.
The robot is always on one leg. It changes to the next leg only at the end of its leg, even if
another leg is nearer.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import islice, pairwise

from fasaco_edge.follow.estimate import BaseLimits
from fasaco_edge.follow.legs import LEAST_LEG_M, Leg, apart, leg_between, rounding
from fasaco_edge.grid.geometry import Point, Pose2D

# Largest distance from a new path's start at which the robot joins it [m]: the robot drove that far
# while the path was planned and sent.
JOIN_WITHIN_M = 0.3
# Largest distance from a path [m], and angle to it [rad], to join it while driving. Else the robot
# comes to rest, and drives to the nearest point or the start, if within NEAREST_M or BEGINNING_M.
BESIDE_M, ALONG_RAD = 0.02, 0.1
NEAREST_M, BEGINNING_M = 0.15, 0.6
# A path continues the last path if it begins on that path, between these distances ahead [m].
LEAST_LEAD_M, LEAD_M = 0.15, 2.0
# Distance at which the robot has missed a corner, or the place where a turn begins [m].
MISSED_M = 0.03
# A corner of the new path this near to a corner of the old path is the same corner [m].
SAME_M = 1e-3
# Legs of a curve up to this long are chords of an arc [m].
CHORD_M = 0.06


class JoinOutcome(enum.Enum):
    """How a new path can be joined."""

    JOINED = "joined"
    AT_REST = "once the robot stands"
    ELSEWHERE = "not from here"


class LegRoute:
    """A path, read lazily, and the leg that the robot is on."""

    def __init__(self, poses: Iterable[Pose2D], limits: BaseLimits) -> None:
        # Greatest speed in the corner that the robot rounds to its leg [m/s]; 0 without a corner.
        self.rounds = 0.0
        self._limits = limits
        # Legs read so far, from the leg that the robot is on; legs still to be read.
        self._legs: list[Leg] = []
        self._coming = self._legs_along(poses)
        # Distance by which the robot missed the corner that it returns to [m]; infinity if it does
        # not return.
        self._missed_by = math.inf

    @property
    def leg(self) -> Leg | None:
        """The leg that the robot is on; None once the path is driven."""
        return self._leg(0)

    def next_leg(self, here: Point | None = None) -> None:
        """Go on to the next leg.

        A robot at rest at ``here`` that has missed the corner returns to it first: the straight
        line to the next leg may cross a wall. It returns again only if the last return brought it
        nearer. Otherwise a robot with late poses, or poses of a point that is not its centre of
        rotation, would circle about the corner endlessly.
        """
        self._leg(1)
        corner = self._legs[0].end if self._legs else None
        del self._legs[:1]
        before, self._missed_by = self._missed_by, math.inf
        if here is None or corner is None or not self._legs:
            return
        missed_by = math.dist(here, corner)
        if self._legs[0].distance(here) > MISSED_M and missed_by < before - MISSED_M:
            self._missed_by = missed_by
            self._legs.insert(0, leg_between(here, corner))

    def pass_bends(self, here: Point) -> None:
        """Go on to the leg that ``here`` is on, past bends that are steered."""
        while (leg := self.leg) and leg.bends and leg.along_and_left(here)[0] >= leg.length:
            self.next_leg()

    def round_corner(self, here: Point, speed: float) -> None:
        """Go on to the next leg if the robot, at this speed [m/s], has to begin the turn to it.

        A robot past the place where the turn begins comes to rest at the corner instead.
        """
        leg = self.leg
        if leg is None or leg.stops or leg.bends:
            return
        late = leg.along_and_left(here)[0] + leg.early_s * min(speed, leg.most) - leg.length
        if late > MISSED_M:
            self._legs[0] = replace(leg, most=0.0)
        elif late >= 0.0:
            self.next_leg()
            self.rounds = leg.most

    def ends(self, along: float, horizon: float) -> list[tuple[float, float]]:
        """Return the places ahead that limit the speed: distance from ``along`` [m], and greatest
        speed there [m/s]. The last one is the next stop, or the first place beyond ``horizon``."""
        found: list[tuple[float, float]] = []
        left = -along
        for leg in self._ahead():
            left += leg.length
            if not leg.bends or left > horizon:
                found.append((left - leg.early_s * leg.most if leg.early_s else left, leg.most))
            if leg.stops or left > horizon:
                break
        return found

    def carrot(self, along: float, ahead: float) -> Point:
        """Return the point at ``along`` plus ``ahead`` [m]; past a corner, straight on."""
        leg, _, to = self._leg_at(along + ahead)
        return leg.at(to)

    def line_ahead(self, here: Point, ahead: float) -> list[Point]:
        """Return the polyline of the route from ``here``, of length ``ahead`` [m] or less."""
        line = [here]
        for leg in self._ahead():
            (x0, y0), (x1, y1) = line[-1], leg.end
            length = math.dist(line[-1], leg.end)
            share = min(ahead / length, 1.0) if length > 0.0 else 1.0
            line.append((x0 + share * (x1 - x0), y0 + share * (y1 - y0)))
            ahead -= length
            if ahead <= 0.0:
                break
        return line

    def join(self, here: Point, heading: float | None, before: LegRoute | None) -> JoinOutcome:
        """Join this new path at its beginning: find the robot's leg.

        If the path has the corner that the robot was driving to, the robot's leg is the leg to that
        corner. If the path begins farther along the last path, the robot first drives along the
        last path to the new one's start.

        Args:
            here: the robot's position.
            heading: its direction of driving [rad]; None at rest.
            before: the last route, if any.
        """
        index, is_kept = self._passing(here, before)
        leg = self._leg(index)
        if leg is None:
            return JoinOutcome.JOINED
        aside = leg.distance(here)
        is_same = before is not None and is_kept and leg.leads_as(before.leg)
        turn = math.atan2(leg.uy, leg.ux) - (heading or 0.0)
        is_along = heading is None or abs(math.remainder(turn, math.tau)) <= ALONG_RAD
        if (is_same and aside <= NEAREST_M) or (aside <= BESIDE_M and is_along):
            del self._legs[:index]
            # The robot may be about to round the corner to that leg.
            self.rounds = before.rounds if before is not None and is_same else 0.0
            return JoinOutcome.JOINED
        begin = self._legs[0].start
        if lead := before._lead_to(begin, here) if before is not None else []:
            self._legs[:0] = lead
            return JoinOutcome.JOINED
        if heading is not None:
            return JoinOutcome.AT_REST
        if aside <= NEAREST_M:
            del self._legs[:index]
            begin = leg.at(min(max(leg.along_and_left(here)[0], 0.0), leg.length))
            rest_m = math.dist(begin, leg.end)
            rest = [replace(leg, start=begin, length=rest_m)] if rest_m >= LEAST_LEG_M else []
            self._legs[:1] = rest
        elif math.dist(here, begin) > BEGINNING_M:
            return JoinOutcome.ELSEWHERE
        if math.dist(here, begin) >= LEAST_LEG_M:
            self._legs.insert(0, leg_between(here, begin))
        return JoinOutcome.JOINED

    def _passing(self, here: Point, before: LegRoute | None) -> tuple[int, bool]:
        """Return the index of the leg beside ``here``, near the beginning, and whether it ends at
        the corner that the robot was driving to."""
        target = before._legs[0].end if before is not None and before._legs else None
        way = 0.0
        for index, leg in enumerate(self._ahead()):
            if target is None or way > JOIN_WITHIN_M:
                break
            if math.dist(leg.end, target) <= SAME_M:
                return index, True
            way += leg.length
        # Else the robot is on the leg where the distance to the robot stops decreasing.
        way, index = 0.0, 0
        while (one := self._leg(index)) and (after := self._leg(index + 1)):
            way += one.length
            is_past = one.along_and_left(here)[0] >= one.length
            if way > JOIN_WITHIN_M or not is_past or after.distance(here) > one.distance(here):
                break
            index += 1
        return index, False

    def _lead_to(self, point: Point, here: Point) -> list[Leg]:
        """Return the legs up to a point soon ahead; none if point or robot is off the legs."""
        way = 0.0
        for index, leg in enumerate(self._ahead()):
            if index == 0:
                way = -leg.along_and_left(here)[0]
                if leg.distance(here) > NEAREST_M:
                    break
            if way > LEAD_M:
                break
            along, aside = leg.along_and_left(point)
            # The robot may be unable to come to rest at a nearer point.
            on_leg = LEAST_LEG_M <= along <= leg.length + LEAST_LEG_M
            is_ahead = on_leg and LEAST_LEAD_M <= way + along <= LEAD_M
            if is_ahead and abs(aside) <= BESIDE_M:
                return [*self._legs[:index], leg_between(leg.start, leg.at(along))]
            way += leg.length
        return []

    def _leg_at(self, to: float) -> tuple[Leg, Leg | None, float]:
        """Return the leg at a distance ``to`` from the first leg's start [m], but not past the next
        corner; the leg before it, if any; and the distance along the leg [m]."""
        before = None
        for leg in self._ahead():
            if to <= leg.length or not leg.bends:
                return leg, before, to
            to, before = to - leg.length, leg
        raise AssertionError("the last leg does not bend")

    def _ahead(self) -> Iterator[Leg]:
        index = 0
        while (leg := self._leg(index)) is not None:
            yield leg
            index += 1

    def _leg(self, index: int) -> Leg | None:
        self._legs += islice(self._coming, max(index + 1 - len(self._legs), 0))
        return self._legs[index] if index < len(self._legs) else None

    def _legs_along(self, poses: Iterable[Pose2D]) -> Iterator[Leg]:
        leg = None
        for start, end in pairwise(apart(poses, LEAST_LEG_M)):
            after = self._leg_between(start, end)
            if leg is not None:
                yield self._ending(leg, after)
            leg = after
        if leg is not None:
            yield leg

    def _leg_between(self, start: Pose2D, end: Pose2D) -> Leg:
        return leg_between((start.x, start.y), (end.x, end.y))

    def _ending(self, leg: Leg, after: Leg) -> Leg:
        """Return a leg with ``most`` and ``early_s`` of the corner at its end."""
        turn = math.atan2(after.uy, after.ux) - math.atan2(leg.uy, leg.ux)
        room = 0.5 * min(leg.length, after.length)
        most, early_s = rounding(abs(math.remainder(turn, math.tau)), room, self._limits)
        return replace(leg, most=most, early_s=early_s)


class CurveRoute(LegRoute):
    """A curve for a robot that cannot turn on the spot, and the leg that the robot is on.

    The legs are chords of arcs, and lanes; the robot steers from each to the next. It comes to rest
    only where it changes between forward and backward: a leg is driven backward if the path's
    heading is opposite to the leg's direction.
    """

    def __init__(self, poses: Iterable[Pose2D], limits: BaseLimits) -> None:
        super().__init__(poses, limits)
        # The leg before the first leg, unless the robot comes to rest between them.
        self._behind: Leg | None = None

    def next_leg(self, here: Point | None = None) -> None:
        """Go on to the next leg; the robot does not return to a corner that it has missed."""
        leg = self.leg
        self._behind = None if leg is None or leg.stops else leg
        super().next_leg()

    def carrot(self, along: float, ahead: float) -> Point:
        """Return the point at ``along`` plus ``ahead`` [m]; past a stop, farther on the arc."""
        leg, before, to = self._leg_at(along + ahead)
        before = before or self._behind
        beyond = to - leg.length
        if beyond <= 0.0 or before is None or max(before.length, leg.length) > CHORD_M:
            return leg.at(to)
        heading = math.atan2(leg.uy, leg.ux)
        turn = math.remainder(heading - math.atan2(before.uy, before.ux), math.tau)
        curvature = 2.0 * turn / (before.length + leg.length)
        # At a chord's end, the arc has turned farther than the chord, by half of the chord's angle.
        heading += 0.5 * (curvature * leg.length + curvature * beyond)
        x, y = leg.end
        return x + beyond * math.cos(heading), y + beyond * math.sin(heading)

    def join(self, here: Point, heading: float | None, before: LegRoute | None) -> JoinOutcome:
        """Join this new path; see ``LegRoute.join``.

        The robot steers to a leg beside it, as it cannot turn towards the nearest point.
        """
        leg = self.leg
        if leg is None:
            return JoinOutcome.JOINED
        index, _ = self._passing(here, before)
        if self._legs[index].distance(here) <= NEAREST_M:
            del self._legs[:index]
            return JoinOutcome.JOINED
        if before is not None and (lead := before._lead_to(leg.start, here)):
            is_back = before._legs[len(lead) - 1].is_back
            most = math.inf if is_back == leg.is_back else 0.0
            self._legs[:0] = [*lead[:-1], replace(lead[-1], most=most, is_back=is_back)]
            return JoinOutcome.JOINED
        if heading is not None:
            return JoinOutcome.AT_REST
        return (
            JoinOutcome.ELSEWHERE
            if math.dist(here, leg.start) > BEGINNING_M
            else JoinOutcome.JOINED
        )

    def _leg_between(self, start: Pose2D, end: Pose2D) -> Leg:
        leg = super()._leg_between(start, end)
        return replace(leg, is_back=leg.ux * math.cos(start.yaw) + leg.uy * math.sin(start.yaw) < 0)

    def _ending(self, leg: Leg, after: Leg) -> Leg:
        return replace(leg, most=math.inf if after.is_back == leg.is_back else 0.0)
