"""The remaining time of a path, from its length, its turns and the robot's measured speeds."""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence

from fasaco_edge.grid.geometry import Point
from fasaco_edge.wire.documents.settings import RobotSettings
from fasaco_edge.wire.documents.status import DriveReport


class Way:
    """The remaining distance and turns from each point of a path.

    Args:
        xy: its points (x, y) [m].
    """

    def __init__(self, xy: Sequence[Point] = ()) -> None:
        way_m, turns, heading = 0.0, 0.0, None
        lengths, quarters = array("d"), array("d")
        for here, there in zip(xy[-2::-1], xy[:0:-1], strict=True):
            way_m += math.dist(here, there)
            towards = math.atan2(there[1] - here[1], there[0] - here[0])
            if heading is not None:
                turns += abs(math.remainder(heading - towards, math.tau)) / (math.pi / 2)
            heading = towards
            lengths.append(way_m)
            quarters.append(turns)
        self._lengths, self._quarters = lengths[::-1], quarters[::-1]

    def left_s(
        self, at: int, robot: RobotSettings, drive: DriveReport, beyond_m: float = 0.0
    ) -> float | None:
        """Return the remaining time from ``beyond_m`` [m] beyond point ``at`` [s].

        None if no speed is known.
        """
        speed_m_s = drive.speed_m_s or robot.speed_m_s
        if not speed_m_s > 0.0:
            return None
        if not 0 <= at < len(self._lengths):
            return 0.0
        turn_s = drive.quarter_turn_s or drive.planned_quarter_turn_s
        return max(self._lengths[at] - beyond_m, 0.0) / speed_m_s + self._quarters[at] * turn_s
