"""Robot of a daemon under measurement, and the map that it publishes.

The map is of a fully known building, 50 m x 50 m, with halls of ten metres. A crate in it moves.
"""

from __future__ import annotations

import queue
import time
from dataclasses import replace

import numpy as np

from fasaco_edge.bench.processes import LOOK_EVERY_S, START_TIMEOUT_S, DaemonProcess
from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.publisher import Publisher
from fasaco_edge.bus.session import Bus
from fasaco_edge.errors import BusUnavailable, NotYet
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose
from fasaco_edge.grid.occupancy import FREE, OCCUPIED, OccupancyGrid
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.json_text import decode_tolerant
from fasaco_edge.wire.documents.path_documents import PathAttachment
from fasaco_edge.wire.messages.maps import encode_occupancy_grid
from fasaco_edge.wire.messages.poses import encode_pose_stamped

RESOLUTION_M = 0.05
HALL_PX, WALL_PX, DOOR_PX, CRATE_PX = 200, 4, 30, 16
# Number of places of the crate, and their spacing, less than its width [pixels].
CRATE_PLACES, CRATE_STEP_PX = 12, 12
# Timeout of a path [s]: before the first one, a slow computer takes long to load the kernels.
PATH_TIMEOUT_S = 300.0


def building(side_px: int = 1000) -> OccupancyGrid:
    """Return a fully known building of ``side_px`` x ``side_px`` pixels of 0.05 m."""
    cells = np.full((side_px, side_px), FREE, np.int8)
    walls = range(0, side_px, HALL_PX)
    for wall in walls:
        cells[wall : wall + WALL_PX] = OCCUPIED
        cells[:, wall : wall + WALL_PX] = OCCUPIED
    for wall in walls[1:]:
        for hall in walls:
            door = slice(hall + (HALL_PX - DOOR_PX) // 2, hall + (HALL_PX + DOOR_PX) // 2)
            cells[wall : wall + WALL_PX, door] = FREE
            cells[door, wall : wall + WALL_PX] = FREE
    cells[-WALL_PX:] = cells[:, -WALL_PX:] = OCCUPIED
    geometry = GridGeometry(side_px, side_px, RESOLUTION_M, Pose2D(0.0, 0.0))
    return OccupancyGrid(geometry, cells)


def with_crate(grid: OccupancyGrid, number: int, stamp_ns: int) -> OccupancyGrid:
    """Return the building with a crate in the hall farthest from the robot.

    Crates of successive numbers stand at different places, so that each map gains and loses
    coverable cells.
    """
    side = grid.geometry.rows
    row, col = side - HALL_PX // 2, side - HALL_PX + 2 * CRATE_PX
    col += CRATE_STEP_PX * (number % CRATE_PLACES)
    cells = grid.cells.copy()
    cells[row : row + CRATE_PX, col : col + CRATE_PX] = OCCUPIED
    return replace(grid, cells=cells, stamp_ns=stamp_ns)


def robot_pose(stamp_ns: int) -> StampedPose:
    """Return the pose of a robot in the building's first hall."""
    return StampedPose(Pose2D(2.5, 2.5), stamp_ns=stamp_ns)


class MapSource:
    """Publishes maps and the pose to a daemon, and receives its paths."""

    def __init__(self, daemon: DaemonProcess, bus: Bus) -> None:
        keys = daemon.keys
        self._daemon = daemon
        self._maps = bus.advertise(keys, topics.MAP)
        self._poses = bus.advertise(keys, topics.POSE)
        self._arrivals = queue.SimpleQueue[tuple[float, Sample]]()
        bus.subscribe(
            keys.of(topics.PATH), lambda sample: self._arrivals.put((time.monotonic(), sample))
        )
        for publisher in (self._maps, self._poses):
            self._await_listener(publisher)

    def put_pose(self, pose: StampedPose) -> None:
        """Publish a pose."""
        self._poses.put(encode_pose_stamped(pose))

    def put_map(self, grid: OccupancyGrid) -> float:
        """Publish a map; return the time of that [s, monotonic]."""
        payload = encode_occupancy_grid(grid)
        at = time.monotonic()
        self._maps.put(payload)
        return at

    def wait_path(self, map_stamp_ns: int) -> tuple[float, float]:
        """Return the arrival [s, monotonic] of the first path planned on the map with this stamp,
        and its time of planning [ms].

        Paths without a plan, which only end before a new obstacle, are skipped.

        Raises:
            NotYet: no path came in time.
            ProcessEnded: the daemon has ended.
        """
        deadline = time.monotonic() + PATH_TIMEOUT_S
        while time.monotonic() < deadline:
            try:
                at, sample = self._arrivals.get(timeout=0.5)
            except queue.Empty:
                self._daemon.check()
                continue
            about = decode_tolerant(sample.attachment, PathAttachment)
            if about.map_stamp_ns == map_stamp_ns and about.planner is not None:
                return at, about.plan_ms
        raise NotYet(
            f"no path for a map after {PATH_TIMEOUT_S:.0f} s", hint="is the machine overloaded?"
        )

    def _await_listener(self, publisher: Publisher) -> None:
        deadline = time.monotonic() + START_TIMEOUT_S
        while not publisher.has_listeners():
            if time.monotonic() > deadline:
                raise BusUnavailable("the daemon does not subscribe to maps and poses")
            time.sleep(LOOK_EVERY_S)
