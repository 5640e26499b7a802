"""The lab's mapper: SLAM as slam_toolbox does it, around OpenKarto's scan matcher.

A scan is matched to the last ones, then to old ones nearby: a loop, whose error is spread over the
scans between, in place of a pose graph. The map is Karto's occupancy grid of all scans kept.
"""

from __future__ import annotations

import math
from typing import Any

import karto_scanmatcher as karto
import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from tests.campaigns.lab.settings import (
    BEAMS,
    LEAST_RANGE_M,
    MOST_RANGE_M,
    RESOLUTION_M,
    stamp_ns,
)
from tests.support.poses import composed, inverse

FRAME = "map"
MAP_EVERY_S = 3.0
# A scan is added after driving this far [m] or turning this much [rad].
TRAVEL_M, TURN_RAD = 0.3, 0.35
# Match with the last scans: their number, search range [m], and least accepted response.
NEAR_SCANS, NEAR_M, NEAR_RESPONSE = 15, 0.4, 0.25
# Number of scans between two searches for a loop.
LOOP_EVERY = 3
# Scans to close a loop with: least age [scans], number, and distance [m].
LOOP_AGE, LOOP_SCANS, LOOP_NEAR_M = 40, 15, 1.5
# Match of a loop: search range [m], and least accepted response.
LOOP_M, LOOP_RESPONSE = 0.8, 0.55
# Least motion of the robot for which a loop is closed [m, rad].
LOOP_LEAST_M, LOOP_LEAST_RAD = 0.03, 0.01
# Values of Karto's picture of its grid.
DRAWN_FREE, DRAWN_OCCUPIED = 255, 0
# Beams are used up to this range [m]; a beam without a return is longer.
USED_RANGE_M, NO_RETURN_M = 7.5, 100.0


class Mapper:
    """Scans and odometry in, a map and its place in odometry's frame out.

    Attributes:
        correction: pose of odometry's frame in the map's.
        loops: how many loops were closed.
    """

    def __init__(self) -> None:
        self.correction = Pose2D(0.0, 0.0)
        self.loops = 0
        self._near, self._far = _matcher(NEAR_M), _matcher(LOOP_M)
        step = math.tau / (BEAMS - 1)
        self._laser = karto.LaserScanConfig(
            -math.pi, math.pi, step, LEAST_RANGE_M, MOST_RANGE_M, USED_RANGE_M, "laser"
        )
        self._odometry: Pose2D | None = None
        self._scans: list[Any] = []
        self._poses: list[Pose2D] = []
        self._ranges: list[list[float]] = []
        self._next_map = 0.0
        # The newest map, until a scan changes it.
        self._map: tuple[GridGeometry, NDArray[np.int8]] | None = None

    def corrected(self, odometry: Pose2D) -> Pose2D:
        """Return the pose in the map frame."""
        return composed(self.correction, odometry)

    def wants(self, odometry: Pose2D) -> bool:
        """Return whether a scan from here would be kept."""
        last = self._odometry
        if last is None:
            return True
        moved = math.hypot(odometry.x - last.x, odometry.y - last.y)
        turned = abs(math.remainder(odometry.yaw - last.yaw, math.tau))
        return moved > TRAVEL_M or turned > TURN_RAD

    def take(self, ranges: NDArray[np.float64], odometry: Pose2D) -> None:
        """Take in a scan, and correct the robot's pose by it.

        Args:
            ranges: float64 (BEAMS,) [m]; 0 for no return.
            odometry: where it was made, in odometry's frame.
        """
        self._odometry = odometry
        beams = np.where(ranges > 0.0, ranges, NO_RETURN_M).tolist()
        pose = self.corrected(odometry)
        if self._scans:
            pose = self._matched(beams, pose)
            pose = self._closed(beams, pose)
            self.correction = composed(pose, inverse(odometry))
        self._scans.append(self._scan(beams, pose, len(self._scans)))
        self._poses.append(pose)
        self._ranges.append(beams)
        self._map = None

    def map_due(self, now: float) -> OccupancyGrid | None:
        """Return the map if it is due at ``now`` [s], else None."""
        if not self._scans or now < self._next_map:
            return None
        self._next_map = now + MAP_EVERY_S
        if self._map is None:
            self._map = self._drawn()
        return OccupancyGrid(*self._map, FRAME, stamp_ns(now))

    def _matched(self, beams: list[float], guess: Pose2D) -> Pose2D:
        """Return the pose that fits the last scans best."""
        scan = self._scan(beams, guess, len(self._scans))
        result = self._near.match_scan(scan, self._scans[-NEAR_SCANS:], True, True)
        return guess if result.response < NEAR_RESPONSE else _pose(result.best_pose)

    def _closed(self, beams: list[float], pose: Pose2D) -> Pose2D:
        """Return the pose that fits old scans nearby best; if it is another, move later ones."""
        count = len(self._scans)
        if count % LOOP_EVERY:
            return pose
        far = {i: _apart(self._poses[i], pose) for i in range(count - LOOP_AGE)}
        nearest = sorted((i for i in far if far[i] < LOOP_NEAR_M), key=lambda i: far[i])
        old = sorted(nearest[:LOOP_SCANS])
        if not old:
            return pose
        scan = self._scan(beams, pose, count)
        result = self._far.match_scan(scan, [self._scans[i] for i in old], True, True)
        better = _pose(result.best_pose)
        turn = math.remainder(better.yaw - pose.yaw, math.tau)
        is_moved = _apart(better, pose) > LOOP_LEAST_M or abs(turn) > LOOP_LEAST_RAD
        if result.response <= LOOP_RESPONSE or not is_moved:
            return pose
        self.loops += 1
        for i in range(old[-1] + 1, count):
            share = (i - old[-1]) / (count - old[-1])
            was = self._poses[i]
            self._poses[i] = Pose2D(
                was.x + share * (better.x - pose.x),
                was.y + share * (better.y - pose.y),
                was.yaw + share * turn,
            )
            self._scans[i] = self._scan(self._ranges[i], self._poses[i], i)
        return better

    def _scan(self, beams: list[float], pose: Pose2D, number: int) -> Any:
        at = karto.Pose2(pose.x, pose.y, pose.yaw)
        return karto.LocalizedRangeScan(self._laser, beams, at, at, number, float(number))

    def _drawn(self) -> tuple[GridGeometry, NDArray[np.int8]]:
        grid = karto.create_occupancy_grid(self._scans, RESOLUTION_M, USED_RANGE_M)
        drawn: NDArray[np.uint8] = np.array(grid.image)
        cells = np.full(drawn.shape, UNKNOWN, np.int8)
        cells[drawn == DRAWN_FREE] = FREE
        cells[drawn == DRAWN_OCCUPIED] = OCCUPIED
        origin = Pose2D(grid.offset.x, grid.offset.y)
        return GridGeometry(grid.height, grid.width, RESOLUTION_M, origin), cells


def _apart(a: Pose2D, b: Pose2D) -> float:
    return math.hypot(a.x - b.x, a.y - b.y)


def _pose(pose: Any) -> Pose2D:
    return Pose2D(pose.x, pose.y, pose.yaw)


def _matcher(search_m: float) -> Any:
    config = karto.ScanMatcherConfig()
    config.search_size, config.smear_deviation = search_m, 0.05
    config.range_threshold = USED_RANGE_M
    return karto.Wrapper(config)
