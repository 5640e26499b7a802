"""Offset from the line: whether the robot always drives beside its line, and on which side.

A robot strays from its line at corners and after a push, to either side. A robot that stays on one
side by the same distance, metre after metre, has a fault that it cannot detect: its pose is not
that of the point that its base leads along the line, or the base pulls to a side.
"""

from __future__ import annotations

import math
from collections import deque
from statistics import median
from typing import NamedTuple

from fasaco_edge.grid.geometry import Point

# Offsets are taken this far apart, at this distance from corners; farther apart two poses are a
# jump [m].
STEP_M, CORNER_M, JUMP_M = 0.05, 0.25, 1.0
# A bend of more than this is a corner [rad].
BEND_RAD = math.radians(10.0)
# Number of samples used, of the last 10 m; and least number, of 5 m.
MOST, LEAST = 200, 100
# The least offset that counts: a share of the tool's width, and a distance that no follower can
# keep more exactly [m].
TOOL_SHARE, LEAST_M = 0.1, 0.03
# Share of the offsets that must be on that side.
ONE_SIDE = 0.8


class Beside(NamedTuple):
    """Where a robot is beside its line.

    Attributes:
        left_m: how far left of the line, negative to its right [m].
        heading: direction of the line there [rad].
        bend: angle between that and the way to a point ``CORNER_M`` ahead [rad].
    """

    left_m: float
    heading: float
    bend: float


class Offset:
    """Collects offsets of the robot from its line, and judges them."""

    def __init__(self, tool_m: float) -> None:
        """Begin; ``tool_m``: width of the tool [m]."""
        self._limit_m = max(TOOL_SHARE * tool_m, LEAST_M)
        self._left_m: deque[float] = deque(maxlen=MOST)
        # The last pose, the line's heading there, and how far it was driven since a corner and
        # since the last offset.
        self._last: tuple[Point, float] | None = None
        self._straight_m = self._since_m = 0.0

    def succeed(self, before: Offset) -> None:
        """Take over the samples of a predecessor."""
        self._left_m = before._left_m

    def note(self, at: Point, beside: Beside | None) -> None:
        """Note a pose at x, y [m] beside its line; None for no line there."""
        before, self._last = self._last, (at, beside.heading) if beside else None
        if beside is None or before is None:
            self._straight_m = 0.0
            return
        driven_m, turned = math.dist(before[0], at), beside.heading - before[1]
        if abs(math.remainder(turned, math.tau)) > BEND_RAD or driven_m > JUMP_M:
            self._straight_m = 0.0
            return
        self._straight_m += driven_m
        self._since_m += driven_m
        is_straight = self._straight_m >= CORNER_M and abs(beside.bend) <= BEND_RAD
        if is_straight and self._since_m >= STEP_M:
            self._left_m.append(beside.left_m)
            self._since_m = 0.0

    @property
    def why(self) -> str:
        """How far beside its line the robot drives; "" if it does not."""
        if len(self._left_m) < LEAST:
            return ""
        middle_m = median(self._left_m)
        same = sum(left_m * middle_m > 0.0 for left_m in self._left_m)
        if abs(middle_m) < self._limit_m or same < ONE_SIDE * len(self._left_m):
            return ""
        side = "left" if middle_m > 0.0 else "right"
        return f"drives {100 * abs(middle_m):.0f} cm {side} of its line"
