"""Alternating maps, which show two publishers if samples do not identify their sender."""

from __future__ import annotations

import zlib
from collections import deque

import numpy as np

from fasaco_edge.grid.occupancy import OccupancyGrid

# Number of maps within PERIOD_S [s], each equal to the last but one, that shows two publishers. A
# door that opens and shuts is slower.
RETURNS, PERIOD_S = 3, 10.0
# Least difference of the two maps, above flickering pixels: free pixels along this length [m].
LEAST_WALL_M = 0.5

# Frame, geometry and checksum of the pixels; and the number of free pixels.
_Seen = tuple[tuple[object, ...], int]


class ReturningMaps:
    """Detects maps that alternate."""

    def __init__(self) -> None:
        self._last: _Seen | None = None
        self._before: _Seen | None = None
        self._returned = deque[float](maxlen=RETURNS)

    def note(self, grid: OccupancyGrid, now: float) -> None:
        """Note a map that arrived at ``now`` [s, monotonic]."""
        pixels = np.ascontiguousarray(grid.cells)
        name = grid.frame, grid.geometry, zlib.crc32(pixels.data)
        seen = name, int(np.count_nonzero(pixels == 0))
        last, before = self._last, self._before
        if last is None or seen == last:
            self._last = seen
            return
        is_large = abs(seen[1] - last[1]) * grid.geometry.resolution >= LEAST_WALL_M
        if seen == before and (is_large or seen[0][1] != last[0][1]):
            self._returned.append(now)
        self._before, self._last = last, seen

    def conflict(self, now: float) -> str:
        """Return the text of a conflict; "" for none."""
        if len(self._returned) < RETURNS or now - self._returned[0] > PERIOD_S:
            return ""
        return "maps alternate, as from two publishers"
