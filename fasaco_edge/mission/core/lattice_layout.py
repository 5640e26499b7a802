"""Lattice layout: angle of the cells' rows to the map frame, edge of a cell, and their changes.

Without a configured angle, rows are at first parallel to the axes of the map frame, then to the
walls, once the direction of the walls is certain. They return to the axes if a map does not fit
otherwise. If a pass has lanes at an angle, its rows have that angle. If it has an overlap of its
own, its cells are narrower or wider.

The robot's initial heading gives the axes of the map frame, so walls are at an angle to them. This
angle is decided once, as each rotation of the lattice loses coverage. In six buildings rotated by
30 degrees, LEAST_WALL_M of parallel walls were seen after 1 to 14 m of driving, and gave the angle
to 0.6 degrees.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from fasaco_edge.errors import FasacoError, LedgerMismatchError, MapTooFar, MapTooLarge
from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.grid.lattice import lattice_window
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.grid.rotation import rotated_geometry
from fasaco_edge.grid.walls import WallDirection, wall_direction
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.coverage.ledger import LedgerSnapshot
from fasaco_edge.planners.passes import Laid, lane_and_tool_m

# Evidence required: length of parallel walls [m], and their share of all walls.
LEAST_WALL_M, LEAST_SHARE = 5.0, 0.45
# Two estimates must agree within SAME_DEG [deg]; one estimate with PLENTY_M of walls suffices [m].
SAME_DEG, PLENTY_M = 1.5, 15.0
# The least rotation that is worth a stop of the robot [deg].
LEAST_ROTATION_DEG = 2.0
# An estimate is due every BETWEEN_M of driving [m], at most MOST_LOOKS times.
BETWEEN_M, MOST_LOOKS = 1.0, 40
# Poses farther apart than JUMP_M [m] are a jump. Maps of more than MOST_PIXELS take too long.
JUMP_M, MOST_PIXELS = 1.0, 4_000_000


class WallWatch:
    """Estimates the wall direction on maps until it is certain."""

    def __init__(self) -> None:
        self._looks = 0
        # Distance driven, and distance at which the next estimate is due [m].
        self._driven_m = self._due_m = 0.0
        self._last: Pose2D | None = None
        # The last estimate; None if the evidence was too little.
        self._seen: WallDirection | None = None

    @property
    def is_over(self) -> bool:
        """Whether the watch has decided or given up."""
        return self._looks >= MOST_LOOKS

    def stop(self) -> None:
        """Stop estimating."""
        self._looks = MOST_LOOKS

    def reset(self) -> None:
        """Start again in another building."""
        self._looks, self._seen, self._due_m = 0, None, self._driven_m

    def estimate(self, grid: OccupancyGrid, pose: Pose2D) -> float | None:
        """Return the lattice rotation [deg] once, when it is certain; else None.

        Args:
            grid: the newest map.
            pose: the robot's pose.
        """
        last, self._last = self._last, pose
        if last is not None:
            distance_m = math.hypot(pose.x - last.x, pose.y - last.y)
            self._driven_m += distance_m if distance_m <= JUMP_M else 0.0
        if self.is_over or self._driven_m < self._due_m:
            return None
        self._due_m = self._driven_m + BETWEEN_M
        self._looks += 1
        before, self._seen = self._seen, _certain(grid)
        seen = self._seen
        if seen is None or not (seen.wall_m >= PLENTY_M or _agree(before, seen)):
            return None
        self.stop()
        return seen.angle_deg if abs(seen.angle_deg) >= LEAST_ROTATION_DEG else 0.0


def _certain(grid: OccupancyGrid) -> WallDirection | None:
    """Return the wall direction of a map with enough evidence; else None."""
    walls = wall_direction(grid) if grid.cells.size <= MOST_PIXELS else None
    # The rim of free space may be the end of a scan, not a wall.
    if walls is None or walls.is_of_rim:
        return None
    return walls if walls.share >= LEAST_SHARE and walls.wall_m >= LEAST_WALL_M else None


def _agree(before: WallDirection | None, seen: WallDirection) -> bool:
    # A lattice is the same after a quarter-turn.
    return before is not None and (
        abs(math.remainder(before.angle_deg - seen.angle_deg, 90.0)) <= SAME_DEG
    )


class LatticeLayout:
    """Decides the angle of the cells' rows, and the edge of a cell.

    Attributes:
        deg: the present angle [deg].
        cell_m: the present edge [m].
    """

    def __init__(self, config: MissionConfig) -> None:
        self.deg = self._usual_deg = config.lattice_deg or 0.0
        self._is_given = config.lattice_deg is not None
        self.cell_m = self._usual_cell_m = config.footprint.cell_m
        # Usual width of the tool, and the width that plans assume at present [m].
        self._usual_tool_m = self._tool_m = config.tool_m
        self._most_cells = config.max_lattice_cells
        self._walls = WallWatch()
        if self._is_given:
            self._walls.stop()

    def sized(self, config: MissionConfig) -> MissionConfig:
        """Return a mission's configuration with cells of the present edge."""
        scale, sweeping = self.cell_m / self._usual_cell_m, config.sweeping
        if scale == 1.0:
            return config
        if sweeping is not None:
            sweeping = replace(sweeping, tool_m=self._tool_m)
        footprint = replace(config.footprint, cell_m=self.cell_m)
        cost = config.cost.paced(config.cost.step_s * scale)
        return replace(config, footprint=footprint, cost=cost, sweeping=sweeping)

    def restore(self, before: LedgerSnapshot, lay: Laid) -> bool:
        """Keep angle and edge of a ledger's cells; return whether that changes the layout.

        The ledger is from before a restart. Its edge of cells is kept only if the present pass has
        the same edge.
        """
        was, deg = (self.deg, self.cell_m), before.lattice_deg
        if deg == lay.angle_deg:
            self.deg = deg
        elif deg and not self._is_given:
            self.deg = self._usual_deg = deg
            self._walls.stop()
        cell_m, tool_m = self._lane_and_tool_m(lay)
        if math.isclose(before.cell_m, cell_m):
            self.cell_m, self._tool_m = cell_m, tool_m
        return (self.deg, self.cell_m) != was

    def _lane_and_tool_m(self, lay: Laid) -> tuple[float, float]:
        """Return the edge of a pass's cells, and the width of the tool to plan with [m]."""
        usual = self._usual_tool_m, self._usual_cell_m
        return usual[::-1] if lay.overlap is None else lane_and_tool_m(*usual, lay.overlap)

    def change(self, lay: Laid | None, grid: OccupancyGrid, pose: StampedPose) -> str:
        """Change to the cells of a pass, or to rows along the walls; return why, "" for no change.

        Args:
            lay: the present pass; None if the robot does not sweep.
            grid: the newest map.
            pose: the robot's pose.
        """
        if lay is not None and self.changes_for_pass(lay, grid):
            along = f"along the lanes of the pass, {self.cell_m:.3g} m wide,"
        elif self.deg == self._usual_deg and self._rotates_to_walls(grid, pose):
            along = "along the walls from now on,"
        else:
            return ""
        return f"cells lie {along} at {self.deg:.1f} degrees to the map frame"

    def changes_for_pass(self, lay: Laid, grid: OccupancyGrid) -> bool:
        """Take angle and edge of a pass's lanes if the map allows; return whether any changed."""
        wanted = self._usual_deg if lay.angle_deg is None else lay.angle_deg
        cell_m, tool_m = self._lane_and_tool_m(lay)
        if (wanted, cell_m) == (self.deg, self.cell_m):
            return False
        # Leave room for the map to grow.
        if not self._fits(grid, wanted, cell_m, share=0.5):
            return False
        self.deg, self.cell_m, self._tool_m = wanted, cell_m, tool_m
        return True

    def receive_faults(self, faults: Iterable[FasacoError]) -> None:
        """Estimate the walls again if the map shows another building."""
        is_other = any(isinstance(fault, LedgerMismatchError) for fault in faults)
        if is_other and not self._is_given:
            self._walls.reset()

    def _rotates_to_walls(self, grid: OccupancyGrid, pose: StampedPose) -> bool:
        """Evaluate the walls of the newest map; return whether the angle has changed."""
        deg = self._walls.estimate(grid, pose.pose)
        # A rotated lattice spans up to twice as many cells, and the map may grow.
        if deg is None or deg == self.deg or not self._fits(grid, deg, self.cell_m, share=0.5):
            return False
        self.deg = self._usual_deg = deg
        return True

    def rotates_back_for(self, maps: Iterable[OccupancyGrid]) -> str:
        """Change the angle to 0, or the edge to the usual edge, if a map does not fit otherwise;
        return why, "" for no change."""
        is_usual = (self.deg, self.cell_m) == (self._usual_deg, self._usual_cell_m)
        if is_usual and (self._is_given or not self.deg):
            return ""
        if all(
            self._fits(grid, self.deg, self.cell_m) or not self._fits(grid, 0.0, self._usual_cell_m)
            for grid in maps
        ):
            return ""
        if is_usual:
            self._usual_deg = 0.0
        self.deg, self.cell_m = self._usual_deg, self._usual_cell_m
        self._tool_m = self._usual_tool_m
        return "the map is too large for other cells than the usual ones"

    def _fits(self, grid: OccupancyGrid, deg: float, cell_m: float, share: float = 1.0) -> bool:
        """Return whether a lattice at an angle [deg] takes at most a share of the cell limit."""
        geometry = rotated_geometry(grid.geometry, -deg)
        try:
            lattice_window(geometry, cell_m, int(share * self._most_cells))
        except (MapTooLarge, MapTooFar):
            return False
        return True
