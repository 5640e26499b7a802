"""Check that the base moves as commanded: a base that pushes against an obstacle must stop.

Poses are noisy, so all poses of an interval are fitted to the commanded motion. The fitted share of
that motion is about 1 for a robot that moves and 0 for a robot that does not, whether it drives or
turns. Noise raises the share as often as it lowers it: if noise hides all motion, every second
interval ends in a pause.

While a robot rests, averaged poses show whether something moves it.
"""

from __future__ import annotations

import math
from collections import deque
from statistics import fmean, median

from fasaco_edge.follow.estimate import PoseEstimate, VelocityCommand
from fasaco_edge.follow.standstill import Tries
from fasaco_edge.grid.geometry import Pose2D

# Poses are averaged over this time [s].
MEAN_S = 1.0
# The robot was moved if an average pose is MOVED_M [m] or more from the average pose MEANS averages
# earlier; slower motion is drift of the poses.
MOVED_M, MEANS = 0.1, 5
# Noise adds SCATTERS times the median step from one average to the next to that distance. Number of
# last steps in the median, and least number. The few steps of a moved robot hardly change the
# median. Normally distributed noise moves only one average in 2^16 that far.
SCATTERS, STEPS, LEAST_STEPS = 4.0, 30, 6

# Position and turn, as lengths [m].
Place = tuple[float, float, float]


class Rest:
    """Compares averaged poses of a robot that should stand."""

    def __init__(self) -> None:
        self._poses: list[Place] = []
        self._means = deque[Place](maxlen=MEANS + 1)
        self._steps = deque[float](maxlen=STEPS)
        self._ends = math.inf

    @property
    def least(self) -> float:
        """The least distance that proves that the robot was moved [m]."""
        return MOVED_M + SCATTERS * median(self._steps or (0.0,))

    def begin(self, now: float) -> None:
        """Begin a rest; the measured noise of the poses is kept."""
        self._poses.clear()
        self._means.clear()
        self._ends = now + MEAN_S

    def is_moved(self, place: Place, now: float) -> bool:
        """Take in a pose; return whether the robot was moved."""
        self._poses.append(place)
        if now < self._ends:
            return False
        self._ends = now + MEAN_S
        x, y, turn = zip(*self._poses, strict=True)
        self._poses.clear()
        self._means.append((fmean(x), fmean(y), fmean(turn)))
        if len(self._means) > 1:
            self._steps.append(math.dist(self._means[-1], self._means[-2]))
        far = math.dist(self._means[-1], self._means[0])
        return len(self._steps) >= LEAST_STEPS and far >= self.least


# Least commanded distance of an interval [m], the share of it that the robot must have moved, and
# the distance that a turn counts as [m/rad]; least duration of an interval [s], and number of
# poses.
LEAST_WAY_M, LEAST_SHARE, WAY_M_RAD = 0.2, 0.15, 0.2
INTERVAL_S, LEAST_POSES = 2.0, 3
# Pause after the first try [s], doubled after each further try; number of tries in a direction.
# After the last try the robot waits until it is moved, or the path leads elsewhere.
REST_S = 2.0
TRIES = 3


class Grip:
    """Compares the commands with the motion of the poses."""

    def __init__(self) -> None:
        self._tries = Tries(MOVED_M, REST_S, math.inf, TRIES)
        self._rest = Rest()
        self._interval = _Interval()
        self._toward = 0.0
        self._rests = False
        self._pose, self._turned = Pose2D(0.0, 0.0), 0.0

    @property
    def detail(self) -> str:
        """The failed tries in the present direction, in words."""
        tries = self._tries.tries(self._toward)
        text = f"tried {tries} time{'s' * (tries != 1)}"
        if (least := self._rest.least) >= 2.0 * MOVED_M:
            text += f"; poses scatter: goes on once moved by {least:.1f} m"
        return text

    def is_lost(self, estimate: PoseEstimate, toward: float, now: float) -> bool:
        """Return whether the robot must pause because it did not move.

        Args:
            estimate: the estimate, with the newest pose, and the motion commanded up to that pose.
            toward: the path's direction [rad].
            now: the time [s].
        """
        self._toward = toward
        pose, is_new = estimate.measured, estimate.measured is not self._pose
        self._turned += math.remainder(pose.yaw - self._pose.yaw, math.tau)
        self._pose = pose
        place = (pose.x, pose.y, WAY_M_RAD * self._turned)
        if not self._tries.may_try(toward, now):
            if not self._rests:
                self._rests = True
                self._rest.begin(now)
            if not self._rest.is_moved(place, now):
                return True
            self._tries.forget()
        if self._rests:
            self._rests, self._interval = False, _Interval()
        done = self._interval
        if is_new or not done.count:
            x, y, turn = estimate.commanded
            done.take(place, (x, y, WAY_M_RAD * turn))
        if done.seconds < INTERVAL_S or done.way < LEAST_WAY_M or done.count < LEAST_POSES:
            return False
        self._interval = _Interval()
        if done.share() >= LEAST_SHARE:
            self._tries.moved_to(done.middle())
            return False
        self._tries.note_failure(done.middle(), toward, now)
        return True

    def sent(self, command: VelocityCommand, seconds: float) -> None:
        """Note a command and its duration."""
        if way := seconds * (abs(command.speed) + WAY_M_RAD * abs(command.turn_rate)):
            self._interval.way += way
            self._interval.seconds += seconds


class _Interval:
    """Poses of an interval, fitted to the commanded motion by least squares.

    Attributes:
        way, seconds: commanded distance [m], and its duration [s].
        count: number of poses.
    """

    def __init__(self) -> None:
        self.way = self.seconds = 0.0
        self.count = 0
        self._first: tuple[Place, Place] | None = None
        # Sums of measured and commanded motion since the first pose, and of their products.
        self._measured, self._commanded = [0.0] * 3, [0.0] * 3
        self._products = self._squares = 0.0

    def take(self, place: Place, commanded: Place) -> None:
        self._first = self._first or (place, commanded)
        self.count += 1
        for axis in range(3):
            went, meant = place[axis] - self._first[0][axis], commanded[axis] - self._first[1][axis]
            self._measured[axis] += went
            self._commanded[axis] += meant
            self._products += went * meant
            self._squares += meant * meant

    def share(self) -> float:
        """Return the share of the commanded motion that the poses show; 0 before any effect."""
        went, meant = self._measured, self._commanded
        products = self._products - _product(went, meant) / self.count
        squares = self._squares - _product(meant, meant) / self.count
        return products / squares if squares > 0.0 else 0.0

    def middle(self) -> tuple[float, float]:
        """Return the mean of the positions [m]."""
        assert self._first is not None
        (x, y, _), _ = self._first
        return x + self._measured[0] / self.count, y + self._measured[1] / self.count


def _product(one: list[float], other: list[float]) -> float:
    return sum(a * b for a, b in zip(one, other, strict=True))
