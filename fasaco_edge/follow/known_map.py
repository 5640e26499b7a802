"""The map as the follower needs it: whether it shows an obstacle at a place. Without numpy."""

from __future__ import annotations

import math

from fasaco_edge.wire.messages.grid_octets import GridOctets, read_grid, with_update

# A point of a scan this near to an obstacle of the map belongs to that obstacle [m]: ranges
# scatter, and the pose is off by some centimetres.
KNOWN_M = 0.15
UNKNOWN = 255


class KnownMap:
    """Keeps the newest map.

    Args:
        free_at_most: occupancy up to which a pixel is free [percent].
    """

    def __init__(self, free_at_most: int) -> None:
        self._grid: GridOctets | None = None
        # Values that are no obstacle: free and unknown pixels.
        self._free = bytes([*range(free_at_most + 1), UNKNOWN])

    @property
    def frame(self) -> str | None:
        """Name of its frame; None without a map."""
        return self._grid.frame if self._grid is not None else None

    def take_map(self, payload: bytes) -> None:
        """Take in a nav_msgs/OccupancyGrid.

        Raises:
            MalformedMessage: it is malformed.
        """
        self._grid = read_grid(payload)

    def take_update(self, payload: bytes) -> None:
        """Take in a map_msgs/OccupancyGridUpdate; without a map it is ignored.

        Raises:
            MalformedMessage: it is malformed, or no part of the map.
        """
        if self._grid is not None:
            self._grid = with_update(self._grid, payload)

    def shows(self, x: float, y: float) -> bool:
        """Return whether an obstacle of the map is at most about ``KNOWN_M`` from a place [m]."""
        grid = self._grid
        if grid is None:
            return False
        size, octets = grid.geometry, grid.octets
        far = KNOWN_M / size.resolution
        col, row = size.to_pixels(x, y)
        left, right = max(math.floor(col - far), 0), min(math.floor(col + far) + 1, size.cols)
        if left >= right:
            return False
        for line in range(max(math.floor(row - far), 0), min(math.floor(row + far) + 1, size.rows)):
            start = line * size.cols
            if bytes(octets[start + left : start + right]).translate(None, self._free):
                return True
        return False
