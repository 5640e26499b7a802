"""Maps that alternate: a sign of two publishers if samples do not identify their sender."""

from __future__ import annotations

import zlib
from collections import deque

import numpy as np

from fasaco_edge.grid.occupancy import OccupancyGrid

# So many maps within this time [s] that each equal the last but one, byte for byte, show two
# publishers. A door that opens and shuts is slower.
RETURNS, PERIOD_S = 3, 10.0
# Least difference of the two maps, as pixels flicker: the free pixels in a wall of this length [m].
LEAST_WALL_M = 0.5

# Frame, geometry and sum of the pixels; and how many of them are free.
_Seen = tuple[tuple[object, ...], int]


class ReturningMaps:
    """Watches for maps that return."""

    def __init__(self) -> None:
        self._last: _Seen | None = None
        self._before: _Seen | None = None
        self._returned = deque[float](maxlen=RETURNS)

    def note(self, grid: OccupancyGrid, now: float) -> None:
        """Note a map that came at ``now`` [s, monotonic]."""
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
        """Return that maps change to and fro; "" if they do not."""
        if len(self._returned) < RETURNS or now - self._returned[0] > PERIOD_S:
            return ""
        return "maps change to and fro, as those of two publishers"
