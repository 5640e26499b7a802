"""The angle at which a mission's cells lie to the map frame, and when it changes.

Where none is given, cells lie along the axes of the map frame at first, and along the walls once
these are certain; along the axes again where a map fits in no other way.
"""

from __future__ import annotations

from collections.abc import Iterable

from fasaco_edge.errors import FasacoError, LedgerMismatchError, MapTooFar, MapTooLarge
from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.grid.lattice import lattice_window
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.grid.turning import turned_geometry
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.map.wall_watch import WallWatch


class LatticeAngle:
    """Decides at which angle cells lie [deg].

    Attributes:
        deg: the angle now.
    """

    def __init__(self, config: MissionConfig) -> None:
        self.deg = config.lattice_deg or 0.0
        self._is_given = config.lattice_deg is not None
        self._cell_m, self._most_cells = config.footprint.cell_m, config.max_lattice_cells
        self._walls = WallWatch()
        if self._is_given:
            self._walls.end()

    def resume(self, deg: float) -> bool:
        """Keep the angle of a ledger from before a restart; return whether cells turn by that."""
        if self._is_given or not deg:
            return False
        self.deg = deg
        self._walls.end()
        return True

    def note_faults(self, faults: Iterable[FasacoError]) -> None:
        """Look for walls anew where the map is of another building."""
        is_other = any(isinstance(fault, LedgerMismatchError) for fault in faults)
        if is_other and not self._is_given:
            self._walls.begin()

    @property
    def is_settled(self) -> bool:
        """Whether no map will turn the cells along its walls any more."""
        return self._walls.is_over

    def turns_along_walls(self, grid: OccupancyGrid, pose: StampedPose) -> bool:
        """Look at the walls of the newest map; return whether the angle is another one now."""
        deg = self._walls.look(grid, pose.pose)
        # Askew, a lattice spans up to twice the cells; and the map may grow.
        if deg is None or deg == self.deg or not self._fits(grid, deg, share=0.5):
            return False
        self.deg = deg
        return True

    def turns_back_for(self, maps: Iterable[OccupancyGrid]) -> bool:
        """Return whether the angle is 0 now, as one of the maps fits in no other way."""
        if self._is_given or not self.deg:
            return False
        if all(self._fits(grid, self.deg) or not self._fits(grid, 0.0) for grid in maps):
            return False
        self.deg = 0.0
        return True

    def _fits(self, grid: OccupancyGrid, deg: float, share: float = 1.0) -> bool:
        """Tell whether a lattice at an angle [deg] takes no more than a share of its cells."""
        geometry = turned_geometry(grid.geometry, -deg)
        try:
            lattice_window(geometry, self._cell_m, int(share * self._most_cells))
        except (MapTooLarge, MapTooFar):
            return False
        return True
