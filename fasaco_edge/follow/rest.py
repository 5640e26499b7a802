"""A robot that rests: whether something moves it, by means of poses, as a single one scatters."""

from __future__ import annotations

import math
from collections import deque
from statistics import fmean, median

# Poses are averaged over this time [s].
MEAN_S = 1.0
# It was moved if a mean is this far [m] from that of this many means before: what is slower is a
# drift of the poses.
MOVED_M, MEANS = 0.1, 5
# Where poses scatter it is further, by this many times the usual step from mean to mean: the median
# of the last ones, which a few steps of a robot that is moved do not change. Fewer than the least
# say nothing. With normal noise one mean in 2^(4^2) is that far off by scatter alone.
SCATTERS, STEPS, LEAST_STEPS = 4.0, 30, 6

# Position and turn, as lengths [m].
Place = tuple[float, float, float]


class Rest:
    """Compares means of poses of a robot that should stand."""

    def __init__(self) -> None:
        self._poses: list[Place] = []
        self._means = deque[Place](maxlen=MEANS + 1)
        self._steps = deque[float](maxlen=STEPS)
        self._ends = math.inf

    @property
    def least(self) -> float:
        """The distance that tells that it was moved [m]."""
        return MOVED_M + SCATTERS * median(self._steps or (0.0,))

    def begin(self, now: float) -> None:
        """Begin a rest; what is known of the poses' scatter is kept."""
        self._poses.clear()
        self._means.clear()
        self._ends = now + MEAN_S

    def is_moved(self, place: Place, now: float) -> bool:
        """Take in a pose; tell whether the robot was moved."""
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
