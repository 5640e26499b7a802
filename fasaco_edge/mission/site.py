"""The site: the newest map, the robot's place in it, and what it can come to from there."""

from __future__ import annotations

from fasaco_edge.errors import PatchWithoutBase, WrongFrame
from fasaco_edge.grid.changes import LatticeChange
from fasaco_edge.grid.geometry import StampedPose, Window
from fasaco_edge.grid.lattice import COVERABLE, UNKNOWN, Cell, CoverageLattice
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.free_area import FreeArea
from fasaco_edge.mission.ground import Ground, anchor_cell
from fasaco_edge.mission.ledger import CoverageLedger
from fasaco_edge.mission.loop_closure import has_moved
from fasaco_edge.mission.order import MissionOrder, OrderError
from fasaco_edge.mission.polygons import Polygon, bounds
from fasaco_edge.mission.progress import Coverage
from fasaco_edge.mission.zones import kept_out, without


class Site:
    """Takes maps and poses in.

    Attributes:
        grid: the newest map, with all updates; None before there is one.
        map_revision: counts the maps, from 1.
        free: the lattice over it.
        lattice: the same without the cells the robot must keep out of.
        pose: the newest pose in the map's frame; before there is a map in any frame.
        map_moved: whether the newest map shows the walls elsewhere: a loop closure.
        ground: what can be reached, as of the last ``survey``; None where the robot stands ill.
    """

    def __init__(self, config: MissionConfig) -> None:
        self.grid: OccupancyGrid | None = None
        self.map_revision = 0
        self.free: CoverageLattice | None = None
        self.lattice: CoverageLattice | None = None
        self.pose: StampedPose | None = None
        self.ground: Ground | None = None
        self.map_moved = False
        self._config = config
        self._change: LatticeChange | None = None
        self._keep_out: tuple[Polygon, ...] = ()
        self._patches_lost = False
        self._free_area = FreeArea(config.footprint.free_at_most)

    def take_map(self, grid: OccupancyGrid) -> None:
        """Take a full map in.

        Raises:
            WrongFrame: the map before lay in another frame.
            MapTooLarge: its lattice would be too large.
        """
        self._patches_lost = False
        self._take_map(grid)

    def take_patch(self, patch: MapPatch) -> None:
        """Take a map update in.

        Raises:
            PatchWithoutBase: it does not fit the map there is.
        """
        if self.grid is None or self._patches_lost:
            why = "updates before it were lost" if self._patches_lost else "there is no map yet"
            raise PatchWithoutBase(f"map update refused: {why}")
        self._take_map(self.grid.patched(patch), patch.window)

    def lose_patches(self, count: int) -> None:
        """Note that updates were lost; always raises PatchWithoutBase, which says so."""
        self._patches_lost = True
        raise PatchWithoutBase(f"{count} map updates were lost")

    def _take_map(self, grid: OccupancyGrid, within: Window | None = None) -> None:
        if self.grid is not None and grid.frame != self.grid.frame:
            raise WrongFrame(f"map in frame {grid.frame!r}, the mission's is {self.grid.frame!r}")
        config = self._config
        footprint, most = config.footprint, config.max_lattice_cells
        if self.grid is None or self.free is None:
            change = LatticeChange.first(grid, footprint, most)
        else:
            maps = self.grid, grid
            change = LatticeChange.between(maps, self.free, footprint, most, within)
        self.map_moved = has_moved(change)
        before, self.grid = self.lattice, grid
        if change.after is not self.free:
            self.free, self.lattice = change.after, self._without_kept_out(change.after)
            # Without the same cells as before: no others have changed.
            self._change = LatticeChange(before, self.lattice, change.cells)
        self.map_revision += 1
        if self.pose is not None and self.pose.frame != grid.frame:
            self.pose = None

    def keep_out(self, polygons: tuple[Polygon, ...]) -> None:
        """Keep out of these polygons (x, y) [m] from now on, and of no others."""
        self._keep_out = polygons
        if self.free is not None:
            self.lattice = self._without_kept_out(self.free)

    def _without_kept_out(self, free: CoverageLattice) -> CoverageLattice:
        if not self._keep_out:
            return free
        radius_m = self._config.footprint.robot_radius_m
        return without(free, kept_out(self._keep_out, free.window, free.cell_m, radius_m))

    def take_pose(self, pose: StampedPose) -> None:
        """Take a pose in.

        Raises:
            WrongFrame: it is not in the map's frame.
        """
        if self.grid is not None and pose.frame != self.grid.frame:
            raise WrongFrame(f"pose in frame {pose.frame!r}, map in {self.grid.frame!r}")
        self.pose = pose

    def cell(self) -> Cell | None:
        """Return the coverable cell the robot is in, or next to."""
        if self.lattice is None or self.pose is None:
            return None
        return anchor_cell(self.lattice, self.pose.pose)

    def misplaced(self) -> str:
        """Return why the robot cannot be where it is, and what is waited for."""
        assert self.free is not None
        assert self.lattice is not None
        assert self.pose is not None
        cell = self.lattice.cell_at(self.pose.pose.x, self.pose.pose.y)
        waits = "waits for a map or a pose that puts it on free ground"
        if not self.lattice.contains(cell):
            return f"robot is outside of the map: {waits}"
        place = self.lattice.local(cell)
        if self.free.states[place] == COVERABLE:
            return "robot is in a keep-out zone: waits to be driven out of it, or for another order"
        if self.free.states[place] == UNKNOWN:
            return f"robot is on unknown ground: {waits}"
        return f"robot is in an occupied cell, or too close to one: {waits}"

    def check_zones(self, order: MissionOrder) -> None:
        """Check that each zone lies on the map, if only in part; without a map there is no telling.

        Raises:
            OrderError: one does not.
        """
        if self.grid is None:
            return
        west, south, east, north = self.grid.geometry.bounds()
        for index, zone in enumerate(order.zones):
            x0, y0, x1, y1 = bounds(zone.polygon) if zone.polygon else (west, south, east, north)
            if x1 <= west or x0 >= east or y1 <= south or y0 >= north:
                raise OrderError(
                    f"zones[{index}].polygon: zone {zone.name!r} lies outside of the map, "
                    f"x {west:.2f}..{east:.2f} m, y {south:.2f}..{north:.2f} m"
                )

    def survey(self) -> None:
        """Find out what can be reached from where the robot is."""
        cell, before, self.ground = self.cell(), self.ground, None
        if cell is None or self.lattice is None:
            return
        if before is None or self._change is None or self._change.after is not self.lattice:
            self.ground = Ground.around(self.lattice, cell)
        else:
            self.ground = before.after(self._change, cell)

    def coverage(self, ledger: CoverageLedger) -> Coverage | None:
        """Return how much of it is covered; None before there is a map."""
        if self.lattice is None or self.grid is None:
            return None
        reachable = self.ground.reachable if self.ground else None
        visits = ledger.visits(self.lattice.window)
        free_m2 = self._free_area.out_of_reach_m2(self.grid, self.lattice, reachable)
        return Coverage.of(self.lattice, reachable, visits, free_m2)
