"""Drive meter: the robot's speed and the durations of its turns, by its poses.

A turn is measured from ``BESIDE_S`` before it to ``BESIDE_S`` after it. The duration of the turn is
this time, less the time that the distance takes at full speed. So it includes braking and starting,
as ``robot.quarter_turn_s`` does. Only turns faster than ``TURNS_RAD_S`` between two straight
stretches count. The results are medians, so waits at a few turns change little. Times are by the
poses' stamps.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from itertools import pairwise
from statistics import median
from typing import NamedTuple

from fasaco_edge.grid.geometry import StampedPose

# Straight driving required before and after a turn [s].
BESIDE_S = 1.5
# Turns are faster than TURNS_RAD_S [rad/s], measured over OVER_S [s], as headings are noisy.
TURNS_RAD_S, OVER_S = 0.12, 0.5
# Poses of one track are at most GAP_S apart; poses closer than LEAST_S are ignored [s].
GAP_S, LEAST_S = 1.0, 0.05
# Time for which poses are kept [s]. A robot that takes longer for a turn waits, or is lost.
KEPT_S = 40.0
# Largest deviation from straight driving at constant speed, as a share of the distance driven in
# ``BESIDE_S``. The noise of a standing robot's poses exceeds it.
UNEVEN = 0.2
# Ranges of a quarter-turn and a half-turn [rad].
QUARTER = math.radians(70.0), math.radians(110.0)
HALF = math.radians(150.0), math.radians(180.0)
# Medians are over the NEWEST values; at least FEWEST are needed.
NEWEST, FEWEST = 31, 5


@dataclass(frozen=True, slots=True)
class DriveTimes:
    """Measured drive times; None until enough is measured.

    Attributes:
        speed_m_s: speed in straight driving [m/s].
        quarter_turn_s, half_turn_s: duration of turns on the spot, with braking and starting [s].
        turns: number of turns measured.
    """

    speed_m_s: float | None = None
    quarter_turn_s: float | None = None
    half_turn_s: float | None = None
    turns: int = 0


class _Seen(NamedTuple):
    """A pose with its time [s], and whether the robot was turning."""

    at: float
    x: float
    y: float
    yaw: float
    turns: bool


class DriveMeter:
    """Measures speed and turns from the newest poses."""

    def __init__(self) -> None:
        self._seen: deque[_Seen] = deque()
        self._speeds: deque[float] = deque(maxlen=NEWEST)
        self._quarters: deque[float] = deque(maxlen=NEWEST)
        self._halves: deque[float] = deque(maxlen=NEWEST)
        self._turns = 0
        # Time up to which the poses have been measured [s].
        self._measured_until = -math.inf

    @property
    def times(self) -> DriveTimes:
        """The current medians."""
        return DriveTimes(
            _median(self._speeds), _median(self._quarters), _median(self._halves), self._turns
        )

    def break_track(self) -> None:
        """Note that the robot's track to its next pose is unknown."""
        self._seen.clear()
        self._measured_until = -math.inf

    def receive_pose(self, stamped: StampedPose) -> None:
        """Take in the next pose; a pose that is hardly newer is ignored."""
        at, pose, seen = stamped.stamp_ns * 1e-9, stamped.pose, self._seen
        if seen and 0.0 <= at - seen[-1].at < LEAST_S:
            return  # with each map the newest pose is repeated
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
        """Measure the last turn or straight stretch, once enough straight driving follows."""
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
        """Measure the speed of a straight stretch that is far enough from both turns."""
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
        stops = seen[first], seen[begin], seen[last], seen[-1]
        distance_m = sum(_apart(a, b) for a, b in pairwise(stops))
        took_s = seen[-1].at - seen[first].at - distance_m / speed_m_s
        for of_kind, (least, most) in ((self._quarters, QUARTER), (self._halves, HALF)):
            if least <= turned <= most:
                of_kind.append(max(took_s, 0.0))
                self._turns += 1


def _before(seen: list[_Seen], index: int, seconds: float) -> int | None:
    """Return the last pose at least ``seconds`` older than pose ``index``; None if none is."""
    at = seen[index].at - seconds
    return next((i for i in range(index - 1, -1, -1) if seen[i].at <= at), None)


def _is_even(seen: list[_Seen]) -> bool:
    a, b = seen[0], seen[-1]
    most_m, took_s = UNEVEN * _apart(a, b), b.at - a.at
    return all(
        math.hypot(
            p.x - a.x - (b.x - a.x) * (p.at - a.at) / took_s,
            p.y - a.y - (b.y - a.y) * (p.at - a.at) / took_s,
        )
        < most_m
        for p in seen
    )


def _apart(a: _Seen, b: _Seen) -> float:
    # Straight distance, as a sum over all poses would add up their noise.
    return math.hypot(b.x - a.x, b.y - a.y)


def _median(values: deque[float]) -> float | None:
    return median(values) if len(values) >= FEWEST else None
