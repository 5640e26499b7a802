"""Tool sight: the floor that a tool wider than the robot touches, without floor behind walls.

Side brushes, a wide deck or a lamp reach beyond the robot's disc. As in ``grid.floor``, a pixel
counts if free pixels under the tool connect it with the disc.
"""

from __future__ import annotations

from collections.abc import Callable

from fasaco_edge.grid.floor import tool_steps
from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import beside
from fasaco_edge.grid.occupancy import UNKNOWN, OccupancyGrid
from fasaco_edge.mission.coverage.floor_tiles import PIXEL_M, Mask, centres


class ToolSight:
    """Finds the floor within the tool's disc that the tool touches, on the newest map.

    Attributes:
        radius_m: radius of the robot's disc [m].
    """

    def __init__(
        self,
        tool_m: float,
        radius_m: float,
        free_at_most: int,
        grid: Callable[[], OccupancyGrid | None],
    ) -> None:
        """Create the sight of a tool.

        Args:
            tool_m: width of the tool [m].
            radius_m: radius of the robot's disc [m].
            free_at_most: largest occupancy of free pixels [percent].
            grid: returns the newest map.
        """
        self._steps = tool_steps(radius_m / PIXEL_M, 0.5 * tool_m / PIXEL_M)
        self.radius_m = radius_m
        self._free_at_most, self._grid = free_at_most, grid

    def of(self, under: Mask, inner: Mask, window: Window) -> Mask:
        """Return the pixels of a window of floor that the tool touches, bool (rows, cols).

        Args:
            under: bool (rows, cols), the pixels within the tool's disc.
            inner: bool (rows, cols), the pixels within the robot's disc.
            window: their window.
        """
        grid = self._grid()
        if grid is None:
            return inner
        open_ = under & _free_on(grid, self._free_at_most, window)
        found = inner & under
        for _ in range(self._steps):
            more = found | (beside(found) & open_)
            if (more == found).all():
                break
            found = more
        return found


def _free_on(grid: OccupancyGrid, free_at_most: int, window: Window) -> Mask:
    """Return which pixels of a window of floor have their centre on free ground of a map."""
    values = grid.geometry.values_at(grid.cells, centres(window, PIXEL_M), UNKNOWN)
    free: Mask = (values >= 0) & (values <= free_at_most)
    return free.reshape(window.rows, window.cols)
