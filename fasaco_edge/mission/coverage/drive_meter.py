"""Drive meter: how fast the robot drives, and what its turns take, as its poses show.

A turn takes what passes from ``BESIDE_S`` before it to as long after it, less what the way between
would take at full speed: so braking and starting count, as in ``robot.quarter_turn_s``. Only turns
with straight driving on both sides count, and no rate below ``TURNS_RAD_S``. Medians are reported:
a robot that waits for somebody at a turn changes them little. Times are those of the poses' stamps.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from itertools import pairwise
from statistics import median
from typing import NamedTuple

from fasaco_edge.grid.geometry import StampedPose

# Straight driving before and behind a turn that shows what the turn takes [s].
BESIDE_S = 1.5
# From this rate on the robot turns [rad/s], measured over so long [s]: headings scatter.
TURNS_RAD_S, OVER_S = 0.12, 0.5
# Poses further apart than this show nothing of what was between, nearer ones no more [s].
GAP_S, LEAST_S = 1.0, 0.05
# Poses are kept for so long [s]: who takes longer to turn waits, or is lost.
KEPT_S = 40.0
# Straight driving is even: a pose may be off by this share of the way of ``BESIDE_S``. The poses of
# a robot that stands scatter, and lead nowhere.
UNEVEN = 0.2
# What counts as a quarter-turn and as a half turn [rad].
QUARTER = math.radians(70.0), math.radians(110.0)
HALF = math.radians(150.0), math.radians(180.0)
# So many of the last ones count, and no fewer than these.
NEWEST, FEWEST = 31, 5


@dataclass(frozen=True, slots=True)
class DriveTimes:
    """What driving takes the robot; None of what too little was seen.

    Attributes:
        speed_m_s: in straight driving [m/s].
        quarter_turn_s, half_turn_s: turns on the spot, braking and starting included [s].
        turns: how many turns were measured.
    """

    speed_m_s: float | None = None
    quarter_turn_s: float | None = None
    half_turn_s: float | None = None
    turns: int = 0


class _Seen(NamedTuple):
    """A pose at a time [s], and whether the robot was turning."""

    at: float
    x: float
    y: float
    yaw: float
    turns: bool


class DriveMeter:
    """Measures on the newest poses."""

    def __init__(self) -> None:
        self._seen: deque[_Seen] = deque()
        self._speeds: deque[float] = deque(maxlen=NEWEST)
        self._quarters: deque[float] = deque(maxlen=NEWEST)
        self._halves: deque[float] = deque(maxlen=NEWEST)
        self._turns = 0
        # Up to when was measured [s].
        self._measured_until = -math.inf

    @property
    def times(self) -> DriveTimes:
        """What was measured so far."""
        return DriveTimes(
            _median(self._speeds), _median(self._quarters), _median(self._halves), self._turns
        )

    def break_track(self) -> None:
        """Note that the way of the robot to its next pose is unknown."""
        self._seen.clear()
        self._measured_until = -math.inf

    def note(self, stamped: StampedPose) -> None:
        """Take in the next pose; one whose stamp is not a little newer shows nothing."""
        at, pose, seen = stamped.stamp_ns * 1e-9, stamped.pose, self._seen
        if seen and 0.0 <= at - seen[-1].at < LEAST_S:
            return  # with each map the newest pose comes again
        if seen and not 0.0 < at - seen[-1].at <= GAP_S:
            self.break_track()
        before = next((old for old in reversed(seen) if at - old.at >= OVER_S), None)
        turned = abs(math.remainder(pose.yaw - before.yaw, math.tau)) if before else 0.0
        is_turning = before is not None and turned > TURNS_RAD_S * (at - before.at)
        seen.append(_Seen(at, pose.x, pose.y, pose.yaw, is_turning))
        while at - seen[0].at > KEPT_S:
            seen.popleft()
        if not is_turning:
            self._measure(list(seen))

    def _measure(self, seen: list[_Seen]) -> None:
        """Measure the last turn, or a piece without one, once enough straight driving follows."""
        after = _before(seen, len(seen) - 1, BESIDE_S)
        if after is None or any(old.turns for old in seen[after + 1 :]):
            return
        last = next((i for i in range(after, -1, -1) if seen[i].turns), None)
        if last is not None and seen[last].at > self._measured_until:
            self._measured_until = seen[last].at
            self._measure_turn(seen, last)
        else:
            self._measure_speed(seen, after)

    def _measure_speed(self, seen: list[_Seen], after: int) -> None:
        """Measure straight driving: so long after the last turn, and before the next one."""
        middle = _before(seen, after, BESIDE_S)
        if middle is None or seen[middle].at < self._measured_until:
            return
        first = _before(seen, middle, BESIDE_S)
        if first is None or any(old.turns for old in seen[first:]):
            return
        self._measured_until = seen[after].at
        if _is_even(seen[middle : after + 1]):
            took_s = seen[after].at - seen[middle].at
            self._speeds.append(_apart(seen[middle], seen[after]) / took_s)

    def _measure_turn(self, seen: list[_Seen], last: int) -> None:
        begin = last
        while begin > 0 and seen[begin].turns:
            begin -= 1
        first = _before(seen, begin, BESIDE_S)
        speed_m_s = _median(self._speeds)
        if first is None or speed_m_s is None or any(old.turns for old in seen[first:begin]):
            return
        yaws = [old.yaw for old in seen[begin : last + 1]]
        turned = abs(sum(math.remainder(b - a, math.tau) for a, b in pairwise(yaws)))
        way = seen[first], seen[begin], seen[last], seen[-1]
        way_m = sum(_apart(a, b) for a, b in pairwise(way))
        took_s = seen[-1].at - seen[first].at - way_m / speed_m_s
        for of_kind, (least, most) in ((self._quarters, QUARTER), (self._halves, HALF)):
            if least <= turned <= most:
                of_kind.append(max(took_s, 0.0))
                self._turns += 1


def _before(seen: list[_Seen], index: int, seconds: float) -> int | None:
    """Return the last pose that is so much older than another one; None where none is."""
    at = seen[index].at - seconds
    return next((i for i in range(index - 1, -1, -1) if seen[i].at <= at), None)


def _is_even(seen: list[_Seen]) -> bool:
    """Tell whether poses lie where a robot is that drives straight at one speed."""
    a, b = seen[0], seen[-1]
    most_m, way_s = UNEVEN * _apart(a, b), b.at - a.at
    return all(
        math.hypot(
            p.x - a.x - (b.x - a.x) * (p.at - a.at) / way_s,
            p.y - a.y - (b.y - a.y) * (p.at - a.at) / way_s,
        )
        < most_m
        for p in seen
    )


def _apart(a: _Seen, b: _Seen) -> float:
    # Straight: along all poses between, their scatter would add up.
    return math.hypot(b.x - a.x, b.y - a.y)


def _median(values: deque[float]) -> float | None:
    return median(values) if len(values) >= FEWEST else None
