"""Figures of the line ahead and of the floor, as the status reports them."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from fasaco_edge.mission.line.missed_floor import Cause


class Unswept(IntEnum):
    """Why a pixel of the floor is not swept; 0 if it is, or if it is no floor."""

    NARROW = Cause.NARROW
    CLOSED = Cause.CLOSED
    KEPT_OUT = Cause.KEPT_OUT
    PASSED = 4
    BESIDE = 5
    AHEAD = 6


class FloorToSweep(NamedTuple):
    """Areas of floor to sweep, on the newest map and for the present order.

    Attributes:
        asked_m2: reachable floor that is asked for, swept or not [m2].
        ahead_m2: the unswept part of it that the line ahead sweeps [m2].
        left_m2: the unswept part of it that the line ahead does not sweep [m2].
        passed_m2: the rest of the unswept part: floor that the line has passed, and strips as
            narrow as a pixel [m2].
        beyond_m2: free floor out of the tool's reach, asked for or not, by cause [m2].
        possible_m2: floor that would be reachable if walls were a pixel thinner than on the map
            [m2]; None before the end of the order, or if not known.
    """

    asked_m2: float
    ahead_m2: float
    left_m2: float
    passed_m2: float
    beyond_m2: dict[str, float]
    possible_m2: float | None


class AheadFigures(NamedTuple):
    """Time that the line ahead takes, and a lower bound for any line that sweeps as much [s].

    A tool of width w sweeps at most w l + pi w^2 / 4 along a line of length l; turns are left out.
    """

    seconds: float
    least_s: float

    @property
    def gap(self) -> float | None:
        """How far the line is above the bound, as a share of it; None if that is 0."""
        return max(self.seconds / self.least_s - 1.0, 0.0) if self.least_s > 0.0 else None
