"""View of a robot by its newest samples, with map and path as arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.client.robot_state import PathProgress, RobotState
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.wire.documents.json_text import decode_document
from fasaco_edge.wire.documents.path_documents import PathAttachment
from fasaco_edge.wire.messages.maps import decode_map_update, decode_occupancy_grid
from fasaco_edge.wire.messages.paths import decode_path


class RobotView(RobotState):
    """The newest map, coverage, path, pose and status of one robot, and the latest events.

    Attributes:
        map, coverage: None before the first.
    """

    def __init__(self, robot: str) -> None:
        super().__init__(robot)
        self.map: OccupancyGrid | None = None
        self.coverage: OccupancyGrid | None = None
        self._readers |= {
            "map": self._read_map,
            "map_update": self._read_map_update,
            "path": self._read_path,
            "coverage": self._read_coverage,
        }

    @property
    def path_ahead(self) -> NDArray[np.float64]:
        """The path still to drive, float64 (n, 2) [m], from the robot's position."""
        rest = np.array(self.walk.xy[self.walk.at + 1 :], np.float64).reshape(-1, 2)
        if not len(rest):
            return rest
        pose = self.pose
        here = self.walk.xy[self.walk.at] if pose is None else (pose.x, pose.y)
        return np.concatenate([np.array([here]), rest])

    def _read_map(self, sample: Sample, _: float) -> None:
        self.map = decode_occupancy_grid(sample.payload)

    def _read_map_update(self, sample: Sample, _: float) -> None:
        patch = decode_map_update(sample.payload)
        # Updates of a map that this process has not received are ignored.
        if self.map is not None:
            self.map = self.map.patched(patch)

    def _read_path(self, sample: Sample, now: float) -> None:
        about = decode_document(sample.attachment or b"{}", PathAttachment)
        self.walk = PathProgress(decode_path(sample.payload).xy, about.revision)
        steps = f"{about.steps} steps" if len(self.walk.xy) else "stop"
        self.events.add(now, f"path {about.revision}, {steps}: {about.reason}")

    def _read_coverage(self, sample: Sample, _: float) -> None:
        self.coverage = decode_occupancy_grid(sample.payload)
