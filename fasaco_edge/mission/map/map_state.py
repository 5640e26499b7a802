"""Map state: the newest map, the robot's cell on it, and the reachable area."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import (
    FasacoError,
    MapTooFar,
    MapTooLarge,
    OrderError,
    PatchWithoutBase,
    WrongFrame,
)
from fasaco_edge.grid.changes import LatticeChange
from fasaco_edge.grid.geometry import StampedPose, Window, polygon_bounds
from fasaco_edge.grid.lattice import COVERABLE, UNKNOWN, Cell, CoverageLattice, lattice_window
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid, without_base
from fasaco_edge.grid.reachable_area import ReachableArea, anchor_cell
from fasaco_edge.grid.rotation import rotated_geometry
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.coverage.counts import Coverage, FreeArea
from fasaco_edge.mission.coverage.loop_closure import (
    Motion,
    closes_cells,
    has_moved,
    shows_floor,
    small_shift,
)
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.map.building_watch import BuildingWatch
from fasaco_edge.mission.map.configured_places import ConfiguredPlaces
from fasaco_edge.mission.map.frame_selector import FrameSelector
from fasaco_edge.mission.map.ground import MissionGround
from fasaco_edge.mission.map.obstacles import Obstacles
from fasaco_edge.mission.orders.order import MissionOrder

# Distance from the dock's pose up to which a robot is in the dock [m].
IN_DOCK_M = 0.5


class MapState:
    """Takes in maps and poses.

    Attributes:
        ground: lattice and floor of the newest map.
        grid: the newest map, with all updates and obstacles; None before there is one.
        given: the same map as received, without obstacles.
        obstacles: obstacles that the map does not show.
        map_revision: counter of map states: full maps, batches of updates, changes of frame; 0
            before the first.
        pose: the newest pose in the map's frame; before the first map, in any frame.
        has_moved: whether the newest map shows walls at other places, after a loop closure.
        shift: a small shift of the newest map against the previous map; None for none.
        shows_floor: whether the newest map shows floor; else it gives no evidence of walls.
        area: the reachable area as of the last ``update_area``; None while the robot's pose is on
            no coverable cell.
        frames: selects the active frame; keeps inputs in another frame.
        building: whether the newest map still shows the same building.
        places: the places of the configuration.
        path_cell: the robot's cell by its place on the line; None off the line.
    """

    def __init__(self, config: MissionConfig) -> None:
        self._config, self.ground = config, MissionGround(config)
        self.grid: OccupancyGrid | None = None
        self.given: OccupancyGrid | None = None
        self.obstacles = Obstacles(config.footprint.robot_radius_m)
        self.map_revision = 0
        self.pose: StampedPose | None = None
        self.area: ReachableArea | None = None
        self.has_moved = self.shows_floor = False
        self.shift: Motion | None = None
        # The cell centres of the newest map that shows floor.
        self._shown: CoverageLattice | None = None
        self.frames = FrameSelector()
        self.building = BuildingWatch()
        self.places = ConfiguredPlaces(config.policy, config.given or config.policy)
        self.path_cell: Cell | None = None
        self._patches_lost = False
        # Why the newest map was refused; "" if it was taken in.
        self._refused = ""
        self._free_area = FreeArea(config.footprint.free_at_most)

    def receive_map(self, grid: OccupancyGrid) -> bool:
        """Take in a full map; return whether its frame becomes active.

        Raises:
            WrongFrame: another frame is active.
            MapTooLarge: its lattice would be too large.
            MapTooFar: its lattice would reach too far from 0.
        """
        is_active_now = False
        if self.frames.active not in ("", grid.frame):
            # The map's frame may become active later, so the map is kept unless it is too large.
            lattice_window(
                grid.geometry, self._config.footprint.cell_m, self._config.max_lattice_cells
            )
            is_active_now = self.frames.receive_map(grid)
            if grid.frame != (active := self.frames.active):
                raise WrongFrame(
                    f"map in frame {grid.frame!r}, the mission's is {active!r}",
                    hint=f"publish the map in {active!r}; or `mission reset` to start over",
                )
        try:
            self._apply_map(grid)
        except (MapTooLarge, MapTooFar) as error:
            self._refused = str(error)
            raise
        self._patches_lost, self._refused = False, ""
        return self.frames.receive_map(grid) or is_active_now

    def switch_frame(self) -> bool:
        """Switch to map and pose of the active frame; return whether the map has changed."""
        grid = self.frames.newest_map
        is_other = grid is not None and (self.grid is None or self.grid.frame != grid.frame)
        if grid is not None and is_other:
            self._patches_lost = False
            self._apply_map(grid)
        if grid is not None and (self.pose is None or self.pose.frame != grid.frame):
            self.pose = self.frames.pose_in(grid.frame)
        return is_other

    def receive_patches(self, patches: Sequence[MapPatch]) -> tuple[bool, list[FasacoError]]:
        """Take in consecutive map updates as one: the map is copied and classified once.

        Returns:
            Whether the map has changed; and the faults of updates that could not be applied.
        """
        own, faults = self.frames.receive_patches(patches)
        if self.given is None or self._patches_lost:
            return False, faults + without_base(own, updates_lost=self._patches_lost)
        updated = self.given.with_updates(own)
        if updated.windows:
            self._apply_map(updated.grid, Window.around(*updated.windows))
            self.frames.receive_map(self.given)
        return bool(updated.windows), faults + updated.faults

    def receive_loss(self, count: int) -> None:
        """Refuse updates until the next map, as some were lost; raise PatchWithoutBase."""
        self._patches_lost = True
        raise PatchWithoutBase(f"{count} map updates were lost")

    def draw_obstacles(self) -> None:
        """Draw the newest map again, as its obstacles have changed."""
        if self.given is not None:
            self._apply_map(self.given)
            self.has_moved = False  # obstacles move no walls

    def without_obstacles(self, lattice: CoverageLattice) -> CoverageLattice:
        """Return a lattice over the newest map, with the cells near obstacles unknown.

        The lattice then shows the building without robots that stand in it.
        """
        if self.grid is None or self.given is None or self.grid is self.given:
            return lattice
        rows, cols = np.nonzero(self.grid.cells != self.given.cells)
        x, y = self.grid.geometry.to_map(
            cols.astype(np.float64) + 0.5, rows.astype(np.float64) + 0.5
        )
        window, cell_m = lattice.window, lattice.cell_m
        reach = 1 + math.ceil(self._config.footprint.robot_radius_m / cell_m)
        found = np.unique(np.floor(np.stack((y, x), axis=1) / cell_m).astype(np.int64), axis=0)
        states = lattice.states.copy()
        for row, col in found.tolist():
            around = Window(row - reach, col - reach, row + reach + 1, col + reach + 1)
            if (part := around.intersection(window)) is not None:
                states[part.slices_in(window)] = UNKNOWN
        return replace(lattice, states=states)

    def _apply_map(self, given: OccupancyGrid, within: Window | None = None) -> None:
        grid, lattice, before = self.obstacles.on(given), self.ground.lattice, self.given
        if self.grid is None or self.grid.frame != grid.frame:
            change = self.ground.begin_lattice(grid)
            if self.grid is not None:
                self.building.reset()
            self.area = self._shown = None
        else:
            change = self.ground.follow_map((self.grid, grid), within)
        self._compare(change)
        self.shift = None
        is_other = lattice is not None and self.ground.lattice is not lattice and self.shows_floor
        if before is not None and is_other and closes_cells(self.ground.change):
            self.shift = small_shift(before, given, self._config.footprint)
        self.grid, self.given = grid, given
        self.map_revision += 1
        if self.pose is not None and self.pose.frame != grid.frame:
            self.pose = self.frames.pose_in(grid.frame)

    def _compare(self, change: LatticeChange) -> None:
        """Find whether the newest map shows floor, and moved since the last map with floor."""
        assert self.ground.free is not None
        self.has_moved, self.shows_floor = False, shows_floor(self.ground.free)
        if not self.shows_floor:
            return
        if self._shown is not None and self._shown is not change.before:
            change = LatticeChange.to(self._shown, change.after)
        self.has_moved, self._shown = has_moved(change), change.after

    def continue_from(self, before: MapState) -> None:
        """Take over the doubt about the building of a predecessor, which had the same cells."""
        self.building = before.building

    def receive_pose(self, pose: StampedPose) -> None:
        """Take in a pose.

        Raises:
            WrongFrame: the pose is not in the map's frame, or not in the active frame.
        """
        if self.grid is not None and pose.frame != self.grid.frame:
            raise WrongFrame(f"pose in frame {pose.frame!r}, map in {self.grid.frame!r}")
        if self.frames.active not in ("", pose.frame):
            active = self.frames.active
            raise WrongFrame(
                f"pose in frame {pose.frame!r}, progress in {active!r}",
                hint=f"publish map and pose in {active!r}; or `mission reset` to start over",
            )
        self.pose = pose

    def update_area(self) -> None:
        """Compute the area reachable from the robot's cell."""
        cell, before, self.area = self.robot_cell(), self.area, None
        if cell is None or self.ground.lattice is None:
            return
        change = self.ground.change
        if before is not None and before.lattice is self.ground.lattice and before.contains(cell):
            self.area = before  # most poses change nothing: steps can be driven both ways
        elif before is None or change is None or change.after is not self.ground.lattice:
            self.area = ReachableArea.around(self.ground.lattice, cell)
        else:
            self.area = before.updated(change, cell)

    def forget_area(self) -> None:
        """Clear the reachable area until the robot is on coverable ground again."""
        self.area = None

    def robot_cell(self) -> Cell | None:
        """Return the coverable cell at the robot; in its dock, the cell in front of the dock."""
        lattice, cell = self.ground.lattice, self.path_cell
        if lattice is None or self.pose is None:
            return None
        # A polished line may not pass through the cells of its walk.
        if cell is not None and lattice.is_coverable(cell):
            return cell
        pose, dock = self.pose.pose, self.places.dock
        own = anchor_cell(lattice, pose)
        if own is not None or dock is None:
            return own
        # Paths start in front of the dock, as no path leads into it.
        is_docked = math.hypot(pose.x - dock.x_m, pose.y - dock.y_m) <= IN_DOCK_M
        return anchor_cell(lattice, dock.stand) if is_docked else None

    def cell_at_pose(self) -> Cell | None:
        """Return the coverable cell at the robot's pose; ``robot_cell`` if there is none.

        On a polished line, which takes short cuts, ``robot_cell`` may be metres from the robot.
        """
        if self.ground.lattice is None or self.pose is None:
            return None
        own = anchor_cell(self.ground.lattice, self.pose.pose)
        is_reachable = own is not None and self.area is not None and self.area.contains(own)
        return own if is_reachable else self.robot_cell()

    def set_path_cell(self, cell: Cell | None) -> None:
        """Set the robot's cell on its path; None while it is off its line."""
        self.path_cell = cell

    def why_no_map(self) -> str:
        """Return why there is no map."""
        why = self.frames.why_no_map()
        return f"{why}: the last one was refused: {self._refused}" if self._refused else why

    def why_no_pose(self) -> str:
        """Return why there is no current pose."""
        return self.frames.why_no_pose(self.grid.frame) if self.grid is not None else "no pose yet"

    def why_other_frame(self) -> str:
        """Return the end of a text on poses in another frame than the map's; "" for none."""
        other = self.grid is not None and self.frames.last_pose_frame not in ("", self.grid.frame)
        return f"; {self.why_no_pose()}" if other else ""

    @property
    def is_kept_out(self) -> bool:
        """Whether a keep-out zone alone makes the robot's cell unusable."""
        states = self._states_here()
        return states is not None and states[0] == COVERABLE != states[1]

    @property
    def is_on_unknown(self) -> bool:
        """Whether the robot is in a cell that the map shows in part, or not at all."""
        states = self._states_here()
        return states is not None and states[0] == UNKNOWN

    def _states_here(self) -> tuple[int, int] | None:
        """Return the state of the robot's cell without and with keep-outs; None off the map."""
        free, lattice = self.ground.free, self.ground.lattice
        if free is None or lattice is None or self.pose is None:
            return None
        cell = lattice.cell_at(self.pose.pose.x, self.pose.pose.y)
        if not lattice.contains(cell):
            return None
        place = lattice.local(cell)
        return int(free.states[place]), int(lattice.states[place])

    def why_misplaced(self) -> str:
        """Return why the robot's position is unusable, and which input it waits for."""
        waits = "waits for a map or a pose that puts it on free ground"
        if self._states_here() is None:
            return f"robot is outside of the map: {waits}"
        if self.is_kept_out:
            return "robot is in a keep-out zone: waits to be driven out of it, or for another order"
        if self.is_on_unknown:
            return f"robot is on unknown ground: {waits}"
        return f"robot is in an occupied cell, or too close to one: {waits}"

    def check_zones(self, order: MissionOrder) -> None:
        """Check that part of each zone, in the map frame, lies on the map, if there is one.

        Rooms are not checked: a map that begins anew will grow to include them.

        Raises:
            OrderError: a zone lies off the map.
        """
        if self.grid is None:
            return
        geometry = rotated_geometry(self.grid.geometry, self._config.lattice_deg or 0.0)
        west, south, east, north = whole = geometry.bounds()
        for index, zone in enumerate(order.as_given.zones):
            polygon = zone.polygon if not zone.room else None
            x0, y0, x1, y1 = polygon_bounds(polygon) if polygon else whole
            if x1 <= west or x0 >= east or y1 <= south or y0 >= north:
                raise OrderError(
                    f"zone {zone.name!r} lies outside of the map, "
                    f"x {west:.2f}..{east:.2f} m, y {south:.2f}..{north:.2f} m",
                    key=f"zones[{index}].polygon",
                )

    def coverage(self, ledger: MissionLedger, known: NDArray[np.bool_]) -> Coverage | None:
        """Return the counts of coverage; None before there is a map.

        ``known``: bool (rows, cols), the cells that are reachable or were before.
        """
        if self.ground.lattice is None or self.grid is None:
            return None
        reachable = self.area.reachable if self.area else None
        visits = ledger.visits(self.ground.lattice.window)
        free_m2 = self._free_area.out_of_reach_m2(
            self.grid, self.map_revision, self.ground.lattice, reachable
        )
        return Coverage.of(self.ground.lattice, known, visits, free_m2)
