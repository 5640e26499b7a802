"""Lattice angle: the angle of the cells' rows to the map frame, and when it changes.

Without a configured angle, rows are parallel to the axes of the map frame at first, and to the
walls once their direction is certain; to the axes again if a map does not fit otherwise.
"""

from __future__ import annotations

from collections.abc import Iterable

from fasaco_edge.errors import FasacoError, LedgerMismatchError, MapTooFar, MapTooLarge
from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.grid.lattice import lattice_window
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.grid.rotation import rotated_geometry
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.map.wall_watch import WallWatch


class LatticeAngle:
    """Decides the angle of the cells' rows [deg].

    Attributes:
        deg: the present angle.
    """

    def __init__(self, config: MissionConfig) -> None:
        self.deg = config.lattice_deg or 0.0
        self._is_given = config.lattice_deg is not None
        self._cell_m, self._most_cells = config.footprint.cell_m, config.max_lattice_cells
        self._walls = WallWatch()
        if self._is_given:
            self._walls.end()

    def resume(self, deg: float) -> bool:
        """Keep the angle of a ledger from before a restart; return whether that changes it."""
        if self._is_given or not deg:
            return False
        self.deg = deg
        self._walls.end()
        return True

    def note_faults(self, faults: Iterable[FasacoError]) -> None:
        """Estimate the walls again if the map shows another building."""
        is_other = any(isinstance(fault, LedgerMismatchError) for fault in faults)
        if is_other and not self._is_given:
            self._walls.begin()

    @property
    def is_settled(self) -> bool:
        """Whether no later map will rotate the lattice to its walls."""
        return self._walls.is_over

    def rotates_to_walls(self, grid: OccupancyGrid, pose: StampedPose) -> bool:
        """Evaluate the walls of the newest map; return whether the angle has changed."""
        deg = self._walls.look(grid, pose.pose)
        # A rotated lattice spans up to twice as many cells, and the map may grow.
        if deg is None or deg == self.deg or not self._fits(grid, deg, share=0.5):
            return False
        self.deg = deg
        return True

    def rotates_back_for(self, maps: Iterable[OccupancyGrid]) -> bool:
        """Return whether the angle changes to 0, because one of the maps does not fit otherwise."""
        if self._is_given or not self.deg:
            return False
        if all(self._fits(grid, self.deg) or not self._fits(grid, 0.0) for grid in maps):
            return False
        self.deg = 0.0
        return True

    def _fits(self, grid: OccupancyGrid, deg: float, share: float = 1.0) -> bool:
        """Return whether a lattice at an angle [deg] takes at most a share of the cell limit."""
        geometry = rotated_geometry(grid.geometry, -deg)
        try:
            lattice_window(geometry, self._cell_m, int(share * self._most_cells))
        except (MapTooLarge, MapTooFar):
            return False
        return True
