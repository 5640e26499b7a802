"""The wall watch: finds once along which angle a building's cells are to lie, and says it once.

A map frame's axes are where a robot first looked to; a building's walls are not along them. How
these lie shows after some metres. In six buildings turned by 30 degrees, LEAST_WALL_M of walls that
point the same way were seen after 1 to 14 m, and told the angle to 0.6 degrees. What is decided
then holds: cells that turn with each map would never be swept.
"""

from __future__ import annotations

import math

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.grid.walls import WallDirection, wall_direction

# With less the angle is not certain: length of walls that point the same way [m], share of all.
LEAST_WALL_M, LEAST_SHARE = 5.0, 0.45
# Two looks at the map have to agree to that [deg]; of so much wall [m] one will do.
SAME_DEG, PLENTY_M = 1.5, 15.0
# A smaller turn is not worth the stop that it costs [deg].
LEAST_TURN_DEG = 2.0
# It looks again after the robot drove so far [m], and gives up after so many looks.
BETWEEN_M, MOST_LOOKS = 1.0, 40
# Poses that lie farther apart are no drive [m]; larger maps take too long to look at [pixels].
JUMP_M, MOST_PIXELS = 1.0, 4_000_000


class WallWatch:
    """Watches maps until the direction of the walls is certain."""

    def __init__(self) -> None:
        self._looks = 0
        # The way driven, and after which it looks again [m].
        self._driven_m = self._due_m = 0.0
        self._last: Pose2D | None = None
        # What the last look told; None where that was too little.
        self._seen: WallDirection | None = None

    @property
    def is_over(self) -> bool:
        """Whether it has decided, or given up."""
        return self._looks >= MOST_LOOKS

    def end(self) -> None:
        """Look no more."""
        self._looks = MOST_LOOKS

    def begin(self) -> None:
        """Look anew, in another building."""
        self._looks, self._seen, self._due_m = 0, None, self._driven_m

    def look(self, grid: OccupancyGrid, pose: Pose2D) -> float | None:
        """Return the angle for the cells [deg], once it is certain; None before and after that.

        Args:
            grid: the newest map.
            pose: where the robot is now.
        """
        last, self._last = self._last, pose
        if last is not None:
            way_m = math.hypot(pose.x - last.x, pose.y - last.y)
            self._driven_m += way_m if way_m <= JUMP_M else 0.0
        if self.is_over or self._driven_m < self._due_m:
            return None
        self._due_m = self._driven_m + BETWEEN_M
        self._looks += 1
        before, self._seen = self._seen, _certain(grid)
        seen = self._seen
        if seen is None or not (seen.wall_m >= PLENTY_M or _agree(before, seen)):
            return None
        self.end()
        return seen.angle_deg if abs(seen.angle_deg) >= LEAST_TURN_DEG else 0.0


def _certain(grid: OccupancyGrid) -> WallDirection | None:
    """Return where walls point on a map that shows enough of them."""
    walls = wall_direction(grid) if grid.cells.size <= MOST_PIXELS else None
    # The rim of what is free is where a scan ended, too.
    if walls is None or walls.is_of_rim:
        return None
    return walls if walls.share >= LEAST_SHARE and walls.wall_m >= LEAST_WALL_M else None


def _agree(before: WallDirection | None, seen: WallDirection) -> bool:
    # Cells look alike after a quarter-turn.
    return before is not None and (
        abs(math.remainder(before.angle_deg - seen.angle_deg, 90.0)) <= SAME_DEG
    )
