"""Detection that something moves a resting robot, by averaged poses, as single poses scatter."""

from __future__ import annotations

import math
from collections import deque
from statistics import fmean, median

# Poses are averaged over this time [s].
MEAN_S = 1.0
# The robot was moved if an average is this far [m] from the one this many averages earlier; slower
# motion is drift of the poses.
MOVED_M, MEANS = 0.1, 5
# Where poses scatter, the distance is larger: by this many times the usual step from one average to
# the next. That is the median of the last steps, which a few steps of a moved robot do not change;
# fewer than the least number are not enough. With normal noise, scatter alone moves one average in
# 2^(4^2) that far.
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
        """The distance from which on it counts as moved [m]."""
        return MOVED_M + SCATTERS * median(self._steps or (0.0,))

    def begin(self, now: float) -> None:
        """Begin a rest; the measured scatter of the poses is kept."""
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
