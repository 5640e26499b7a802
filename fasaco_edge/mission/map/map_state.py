"""Map state: the newest map, its lattice, the robot's place in it, and what it can reach."""

from __future__ import annotations

from collections.abc import Sequence

from fasaco_edge.errors import (
    FasacoError,
    MapTooFar,
    MapTooLarge,
    OrderError,
    PatchWithoutBase,
    WrongFrame,
)
from fasaco_edge.grid.changes import LatticeChange
from fasaco_edge.grid.geometry import Polygon, StampedPose, Window, polygon_bounds
from fasaco_edge.grid.lattice import COVERABLE, UNKNOWN, Cell, CoverageLattice, lattice_window
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid, without_base
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.coverage.ledger import CoverageLedger
from fasaco_edge.mission.coverage.progress import Coverage, FreeArea
from fasaco_edge.mission.map.inputs import FrameSelector
from fasaco_edge.mission.map.loop_closure import has_moved
from fasaco_edge.mission.map.reachable_area import ReachableArea, anchor_cell
from fasaco_edge.mission.orders.order import MissionOrder
from fasaco_edge.mission.orders.zones import kept_out, without


class MapState:
    """Takes maps and poses in.

    Attributes:
        grid: the newest map, with all updates; None before there is one.
        map_revision: goes up by one with each new state of the map: a whole map, updates taken in
            together, the map of another frame; 0 before there is one.
        free: the lattice over it.
        lattice: the same without the cells the robot must keep out of.
        pose: the newest pose in the map's frame; before there is a map in any frame.
        has_moved: whether the newest map shows the walls elsewhere: a loop closure.
        area: what can be reached, as of the last ``update_area``; None where the robot's pose is
            on no coverable cell.
        frames: which frame is active, and what came in another.
    """

    def __init__(self, config: MissionConfig) -> None:
        self.grid: OccupancyGrid | None = None
        self.map_revision = 0
        self.free: CoverageLattice | None = None
        self.lattice: CoverageLattice | None = None
        self.pose: StampedPose | None = None
        self.area: ReachableArea | None = None
        self.has_moved = False
        self.frames = FrameSelector()
        self._config = config
        self._change: LatticeChange | None = None
        self._keep_out: tuple[Polygon, ...] = ()
        self._patches_lost = False
        # Why the newest map was refused; "" where it was not.
        self._refused = ""
        self._free_area = FreeArea(config.footprint.free_at_most)

    def take_map(self, grid: OccupancyGrid) -> bool:
        """Take a full map in; return whether that makes its frame active.

        Raises:
            WrongFrame: another frame is active.
            MapTooLarge: its lattice would be too large.
            MapTooFar: its lattice would reach too far from 0.
        """
        is_active_now = False
        if self.frames.active not in ("", grid.frame):
            # It may be wanted later, if it is one that can be taken at all.
            lattice_window(
                grid.geometry, self._config.footprint.cell_m, self._config.max_lattice_cells
            )
            is_active_now = self.frames.note_map(grid)
            if grid.frame != (active := self.frames.active):
                raise WrongFrame(f"map in frame {grid.frame!r}, the mission's is {active!r}")
        try:
            self._take_map(grid)
        except (MapTooLarge, MapTooFar) as error:
            self._refused = str(error)
            raise
        self._patches_lost, self._refused = False, ""
        return self.frames.note_map(grid) or is_active_now

    def switch_frame(self) -> bool:
        """Go on with map and pose of the active frame; return whether it is another map."""
        grid = self.frames.newest_map
        is_other = grid is not None and (self.grid is None or self.grid.frame != grid.frame)
        if grid is not None and is_other:
            self._patches_lost = False
            self._take_map(grid)
        if grid is not None and (self.pose is None or self.pose.frame != grid.frame):
            self.pose = self.frames.pose_in(grid.frame)
        return is_other

    def take_patches(self, patches: Sequence[MapPatch]) -> tuple[bool, list[FasacoError]]:
        """Take consecutive map updates in as one: the map is copied and classified once.

        Returns:
            Whether the map is another now; why some could not be laid over it.
        """
        own, faults = self.frames.note_patches(patches)
        if self.grid is None or self._patches_lost:
            return False, faults + without_base(own, updates_lost=self._patches_lost)
        updated = self.grid.with_updates(own)
        if updated.windows:
            self._take_map(updated.grid, Window.around(*updated.windows))
            self.frames.note_map(self.grid)
        return bool(updated.windows), faults + updated.faults

    def lose_patches(self, count: int) -> None:
        """Note that updates were lost; always raises PatchWithoutBase, which says so."""
        self._patches_lost = True
        raise PatchWithoutBase(f"{count} map updates were lost")

    def _take_map(self, grid: OccupancyGrid, within: Window | None = None) -> None:
        footprint, most = self._config.footprint, self._config.max_lattice_cells
        is_first = self.grid is None or self.grid.frame != grid.frame
        if self.grid is None or self.free is None or is_first:
            change = LatticeChange.first(grid, footprint, most)
        else:
            maps = self.grid, grid
            change = LatticeChange.between(maps, self.free, footprint, most, within)
        self.has_moved = has_moved(change)
        before, self.grid = self.lattice, grid
        if is_first:
            before = self.area = None
        if change.after is not self.free:
            self.free, self.lattice = change.after, self._without_kept_out(change.after)
            # Without the same cells as before: no others have changed.
            self._change = LatticeChange(before, self.lattice, change.cells)
        self.map_revision += 1
        if self.pose is not None and self.pose.frame != grid.frame:
            self.pose = self.frames.pose_in(grid.frame)

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
            WrongFrame: it is not in the map's frame, or not in the active one.
        """
        if self.grid is not None and pose.frame != self.grid.frame:
            raise WrongFrame(f"pose in frame {pose.frame!r}, map in {self.grid.frame!r}")
        if self.frames.active not in ("", pose.frame):
            raise WrongFrame(f"pose in frame {pose.frame!r}, progress in {self.frames.active!r}")
        self.pose = pose

    def update_area(self) -> None:
        """Find out what can be reached from where the robot is."""
        cell, before, self.area = self.robot_cell(), self.area, None
        if cell is None or self.lattice is None:
            return
        if before is None or self._change is None or self._change.after is not self.lattice:
            self.area = ReachableArea.around(self.lattice, cell)
        else:
            self.area = before.updated(self._change, cell)

    def forget_area(self) -> None:
        """Forget what can be reached, until the robot is on coverable ground again."""
        self.area = None

    def robot_cell(self) -> Cell | None:
        """Return the coverable cell the robot is in, or next to."""
        if self.lattice is None or self.pose is None:
            return None
        return anchor_cell(self.lattice, self.pose.pose)

    def why_no_map(self) -> str:
        """Return why there is no map."""
        why = self.frames.why_no_map()
        return f"{why}: the last one was refused: {self._refused}" if self._refused else why

    def why_no_pose(self) -> str:
        """Return why there is no pose, or none any more."""
        return self.frames.why_no_pose(self.grid.frame) if self.grid is not None else "no pose yet"

    def why_other_frame(self) -> str:
        """Return that poses come in another frame than the map, to be appended; "" if not."""
        other = self.grid is not None and self.frames.last_pose_frame not in ("", self.grid.frame)
        return f"; {self.why_no_pose()}" if other else ""

    def why_misplaced(self) -> str:
        """Return why the robot cannot be where it is, and what it waits for."""
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
        """Check that part of each zone lies on the map; without a map nothing is checked.

        Raises:
            OrderError: a zone lies outside.
        """
        if self.grid is None:
            return
        west, south, east, north = whole = self.grid.geometry.bounds()
        for index, zone in enumerate(order.zones):
            x0, y0, x1, y1 = polygon_bounds(zone.polygon) if zone.polygon else whole
            if x1 <= west or x0 >= east or y1 <= south or y0 >= north:
                raise OrderError(
                    f"zones[{index}].polygon: zone {zone.name!r} lies outside of the map, "
                    f"x {west:.2f}..{east:.2f} m, y {south:.2f}..{north:.2f} m"
                )

    def coverage(self, ledger: CoverageLedger) -> Coverage | None:
        """Return how much is covered; None before there is a map."""
        if self.lattice is None or self.grid is None:
            return None
        reachable = self.area.reachable if self.area else None
        visits = ledger.visits(self.lattice.window)
        free_m2 = self._free_area.out_of_reach_m2(
            self.grid, self.map_revision, self.lattice, reachable
        )
        return Coverage.of(self.lattice, reachable, visits, free_m2)
