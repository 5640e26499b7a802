"""The origin of all drawings: a viewer draws in float32, half a metre coarse at a UTM northing.

Far from 0 everything is drawn relative to whole kilometres near the first place that came.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from msgspec.structs import replace as replace_members

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.wire.paths import PathMessage
from fasaco_edge.wire.pheromone import PheromoneMessage
from fasaco_edge.wire.status import PathAttachment, Rectangle

# Nearer to 0 than this float32 resolves a millimetre, and nothing is moved [m].
NEAR_M = 10_000.0
STEP_M = 1_000.0


@dataclass(frozen=True, slots=True)
class Anchor:
    """The place in the map's frame that is drawn at 0: x [m], y [m]."""

    x: float = 0.0
    y: float = 0.0

    @classmethod
    def near(cls, x: float, y: float) -> Anchor:
        """Return the anchor of a drawing around a place [m]; 0 on an axis that is near."""
        return cls(*(0.0 if abs(at) < NEAR_M else STEP_M * round(at / STEP_M) for at in (x, y)))

    def __bool__(self) -> bool:
        return bool(self.x or self.y)

    def pose(self, pose: Pose2D) -> Pose2D:
        """Return where a pose is drawn."""
        return replace(pose, x=pose.x - self.x, y=pose.y - self.y)

    def grid(self, grid: OccupancyGrid) -> OccupancyGrid:
        """Return a grid as it is drawn."""
        return replace(grid, geometry=self._geometry(grid.geometry)) if self else grid

    def pheromone(self, message: PheromoneMessage) -> PheromoneMessage:
        """Return a pheromone field as it is drawn."""
        return replace(message, geometry=self._geometry(message.geometry)) if self else message

    def path(self, message: PathMessage) -> PathMessage:
        """Return a path as it is drawn."""
        if not self:
            return message
        return replace(message, xy=message.xy - np.array((self.x, self.y)), yaw=message.yaw)

    def attachment(self, about: PathAttachment) -> PathAttachment:
        """Return a path's attachment, with the rectangle of its reason where that is drawn."""
        changed = about.changed
        if not self or changed is None:
            return about
        moved = Rectangle(
            changed.x_min - self.x,
            changed.y_min - self.y,
            changed.x_max - self.x,
            changed.y_max - self.y,
        )
        return replace_members(about, changed=moved)

    def _geometry(self, geometry: GridGeometry) -> GridGeometry:
        return replace(geometry, origin=self.pose(geometry.origin))
