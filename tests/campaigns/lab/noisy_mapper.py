"""A mapper that makes the map of a building out of noisy scans, as a scan matcher does.

Each pixel is decided by the rays that end in it and those that pass it, as in OpenKarto's grid: so
walls get thicker and thinner by a pixel, thin legs come and go, and specks appear and are passed.
The poses of scans are not matched: they are the true ones with an error.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np
from numpy.random import PCG64, Generator, SeedSequence
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Point, Pose2D, StampedPose, Window
from fasaco_edge.grid.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from fasaco_edge.kernels.lattice.areas import find_areas
from fasaco_edge.kernels.lattice.raycast import Scanner
from fasaco_edge.simulation.mapper import Mapper
from fasaco_edge.simulation.robot import SimulationConfig
from fasaco_edge.simulation.world import Emission, World
from tests.campaigns.lab.rays import count_rays, ranges_of
from tests.support.poses import composed, inverse

# Rays of a scan, as of an LDS-01.
RAYS = 360
# A scan is added after driving this far [m] or turning this much [rad].
TRAVEL_M, TURN_RAD = 0.3, 0.35
# Pixels are known after this many rays, and occupied if more than this share of them ended there.
LEAST_PASSES, HITS = 2, 0.1
# Limit on the pixels of a leg.
LEG_PX = 4
# Margin around the building for pixels that are mapped beside it [m].
MARGIN_M = 0.6
# A wall begins this far behind its face [pixels], so that noisy rays still end in it.
INTO_PX = 1e-3
# Number of scans between two searches for a loop.
LOOP_EVERY = 3
# Scans to close a loop with: least age [scans], and distance [m].
LOOP_AGE, LOOP_NEAR_M = 40, 1.5
# Least motion of the robot for which a loop is closed [m, rad].
LOOP_LEAST_M, LOOP_LEAST_RAD = 0.03, 0.01


SHARES = ("specks", "leg_misses", "jumps")


@dataclass(frozen=True, slots=True)
class MapperNoise:
    """How far a mapper's maps and poses are from the truth.

    The defaults are about those of a scan matcher with a lidar of 12 mm, on pixels of 5 cm.

    Attributes:
        seed: of all noise.
        range_m: standard deviation of the scanner's ranges [m].
        specks: share of its rays that end in free space, before a wall.
        leg_misses: share of its rays that miss thin legs, of a few pixels.
        shift_m: largest offset of the map's pixels from the building's, along each axis.
        match_m, match_rad: standard deviation of the pose at which a scan is added, along each
            axis.
        drift_m, drift_rad: standard deviation of the drift of the pose, and of newly mapped parts,
            after a metre's way; after n metres it is sqrt(n) times as large.
        closes_loops: whether the drift is corrected, in the map too, when the robot returns to a
            place mapped long ago.
        jumps: share of scans that are added at a wrong pose; the pose of the next scan is right
            again.
        jump_m: error of such a pose [m].
        late_s: age of a pose when it is published [s].
    """

    seed: int = 0
    range_m: float = 0.012
    specks: float = 0.0005
    leg_misses: float = 0.5
    shift_m: float = 0.05
    match_m: float = 0.006
    match_rad: float = 0.002
    drift_m: float = 0.005
    drift_rad: float = 0.0015
    closes_loops: bool = True
    jumps: float = 0.0
    jump_m: float = 0.1
    late_s: float = 0.05

    def times(self, level: float) -> Self:
        """Return the noise with all amounts multiplied by a factor, 0 for none; shares up to 1."""
        amounts = {
            field.name: level * getattr(self, field.name)
            for field in fields(self)
            if field.name not in ("seed", "closes_loops")
        }
        return replace(self, **{n: min(a, 1.0) if n in SHARES else a for n, a in amounts.items()})


@dataclass(slots=True)
class _Scan:
    """An added scan: its true pose, its pose on the map, and the lengths of its rays [pixels]."""

    pose: Pose2D
    there: Pose2D
    ways: NDArray[np.float64]


class NoisyMapper(Mapper):
    """A scanner in a ground-truth map, and the robot's own noisy map of it."""

    def __init__(self, truth: OccupancyGrid, config: SimulationConfig, noise: MapperNoise) -> None:
        super().__init__(truth, config)
        self.loops = 0
        of_rays, of_poses, of_raster = map(PCG64, SeedSequence(noise.seed).spawn(3))
        self._noise, self._rng = noise, Generator(of_rays)
        # The error of the pose: that of the map's frame, which drifts with the way; and that of the
        # newest scan alone.
        self._frame = self._match = Pose2D(0.0, 0.0)
        self._poses_rng = Generator(of_poses)
        self._geometry = _beside(truth.geometry, noise.shift_m * Generator(of_raster).random(2))
        shape = self._geometry.rows, self._geometry.cols
        self._known = np.full(shape, UNKNOWN, np.int8)
        self._hits, self._passes = np.zeros(shape, np.int32), np.zeros(shape, np.int32)
        self._thin = _legs(truth.cells > config.free_at_most)
        self._scans: list[_Scan] = []
        self._at: Pose2D | None = None

    def estimated(self, pose: Pose2D) -> Pose2D:
        """Return the estimated pose of a robot at ``pose``."""
        drifted, match = composed(self._frame, pose), self._match
        yaw = math.remainder(drifted.yaw + match.yaw, math.tau)
        return Pose2D(drifted.x + match.x, drifted.y + match.y, yaw)

    def true_place(self, x: float, y: float) -> Point:
        """Return the true position of a place on its map [m]."""
        pose = composed(inverse(self._frame), Pose2D(x - self._match.x, y - self._match.y))
        return pose.x, pose.y

    def scan(self, pose: Pose2D) -> Window | None:
        """Add a scan as ``Mapper`` does, if it is far enough from the one before."""
        at, self._at = self._at or pose, pose
        if way_m := math.hypot(pose.x - at.x, pose.y - at.y):
            self._drift(pose, way_m)
        if self._scans and not _is_away(pose, self._scans[-1].pose):
            return None
        self._match = self._drawn_match()
        scan = _Scan(pose, self.estimated(pose), self._ways(pose))
        self._scans.append(scan)
        changed = self._count(scan, 1)
        if len(self._scans) % LOOP_EVERY == 0 and self._noise.closes_loops:
            changed = Window.around(changed, self._close_loop())
        if changed is not None:
            self._draw(changed)
            self._extent = Window.around(self._extent, changed)
        return changed

    def _drift(self, pose: Pose2D, way_m: float) -> None:
        """Let the frame drift while the robot drives on to ``pose``; it turns about the robot."""
        x, y, yaw = (math.sqrt(way_m) * self._poses_rng.standard_normal(3)).tolist()
        noise, at = self._noise, composed(self._frame, pose)
        moved = Pose2D(
            at.x + noise.drift_m * x, at.y + noise.drift_m * y, at.yaw + noise.drift_rad * yaw
        )
        self._frame = composed(moved, inverse(pose))

    def _drawn_match(self) -> Pose2D:
        """Return the error of another scan's pose."""
        noise, (x, y, yaw) = self._noise, self._poses_rng.standard_normal(3).tolist()
        chance, toward = (self._poses_rng.random(2) * (1.0, math.tau)).tolist()
        jump_m = noise.jump_m if chance < noise.jumps else 0.0
        return Pose2D(
            noise.match_m * x + jump_m * math.cos(toward),
            noise.match_m * y + jump_m * math.sin(toward),
            noise.match_rad * yaw,
        )

    def _ways(self, pose: Pose2D) -> NDArray[np.float64]:
        """Return the lengths of a scan's rays, float64 (RAYS,) [pixels]; below 0: no return."""
        noise, geometry = self._noise, self._truth.geometry
        goes_by, is_speck, speck = self._rng.random((3, RAYS))
        scatter = self._rng.standard_normal(RAYS)
        x, y = geometry.to_pixels(pose.x, pose.y)
        ways = ranges_of(
            self._truth.cells,
            self._thin,
            Scanner(x, y, self._reach_px, self._free_at_most),
            _directions(pose.yaw - geometry.origin.yaw),
            goes_by < noise.leg_misses,
        )
        noisy = ways + INTO_PX + noise.range_m / geometry.resolution * scatter
        ways = np.where(ways > 0.0, np.maximum(noisy, INTO_PX), ways)
        return np.where(is_speck < noise.specks, np.abs(ways) * speck, ways)

    def _count(self, scan: _Scan, times: int) -> Window | None:
        """Add a scan to the counts, or remove it again; return the changed window."""
        x, y = self._geometry.to_pixels(scan.there.x, scan.there.y)
        directions = _directions(scan.there.yaw - self._geometry.origin.yaw)
        ends = (x, y) + np.abs(scan.ways)[:, np.newaxis] * directions
        counted = count_rays(self._hits, self._passes, (x, y), ends, scan.ways > 0.0, times)
        return Window.around(Window(*map(int, counted)))

    def _draw(self, part: Window) -> None:
        """Decide the pixels of a part of the map by their counts."""
        window = slice(part.row0, part.row1), slice(part.col0, part.col1)
        hits, passes = self._hits[window], self._passes[window]
        drawn = np.where(hits > HITS * passes, OCCUPIED, FREE)
        self._known[window] = np.where(passes < LEAST_PASSES, UNKNOWN, drawn)

    def _close_loop(self) -> Window | None:
        """Align the newest scan with an old one nearby, and correct those between accordingly."""
        *older, newest = self._scans
        far = [math.dist((s.pose.x, s.pose.y), (newest.pose.x, newest.pose.y)) for s in older]
        old = min(range(len(far) - LOOP_AGE), key=far.__getitem__, default=-1)
        if old < 0 or far[old] > LOOP_NEAR_M:
            return None
        frame = composed(older[old].there, inverse(older[old].pose))
        better = composed(frame, newest.pose)
        dx, dy = better.x - newest.there.x, better.y - newest.there.y
        turn = math.remainder(better.yaw - newest.there.yaw, math.tau)
        if math.hypot(dx, dy) <= LOOP_LEAST_M and abs(turn) <= LOOP_LEAST_RAD:
            return None
        self.loops += 1
        changed = None
        for number, scan in enumerate(self._scans[old + 1 :], 1):
            share, was = number / (len(older) - old), scan.there
            taken_out = self._count(scan, -1)
            scan.there = Pose2D(was.x + share * dx, was.y + share * dy, was.yaw + share * turn)
            changed = Window.around(changed, taken_out, self._count(scan, 1))
        self._frame = composed(better, inverse(newest.pose))
        return changed


class NoisyWorld(World):
    """A robot in a building with such a mapper; its poses are published late."""

    def __init__(
        self, truth: OccupancyGrid, start: Pose2D, config: SimulationConfig, noise: MapperNoise
    ) -> None:
        super().__init__(truth, start, config, NoisyMapper(truth, config, noise))
        self._late_ns = round(noise.late_s / config.tick_s) * config.tick_ns
        self._poses: deque[StampedPose] = deque()

    def tick(self) -> Emission:
        """Let one time step pass."""
        emission = super().tick()
        if emission.pose is not None:
            self._poses.append(emission.pose)
        is_ripe = self._poses and self._poses[0].stamp_ns <= self.stamp_ns - self._late_ns
        return replace(emission, pose=self._poses.popleft() if is_ripe else None)


def _beside(geometry: GridGeometry, shift_m: NDArray[np.float64]) -> GridGeometry:
    """Return a raster around a building, whose pixels are slightly offset from the building's."""
    margin = math.ceil(MARGIN_M / geometry.resolution)
    right, up = (shift_m / geometry.resolution).tolist()
    origin = Pose2D(*geometry.to_map(right - margin, up - margin), geometry.origin.yaw)
    shape = geometry.rows + 2 * margin, geometry.cols + 2 * margin
    return GridGeometry(*shape, geometry.resolution, origin)


def _legs(blocked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the pixels of small obstacles, bool (rows, cols)."""
    areas = find_areas(blocked.view(np.uint8))
    is_small = np.append(False, areas.cells <= LEG_PX)
    return is_small[areas.labels]


def _directions(yaw: float) -> NDArray[np.float64]:
    """Return the directions of a scan's rays, unit vectors, float64 (RAYS, 2)."""
    angles = np.arange(RAYS) * (math.tau / RAYS) + yaw
    return np.column_stack((np.cos(angles), np.sin(angles)))


def _is_away(pose: Pose2D, other: Pose2D) -> bool:
    turned = abs(math.remainder(pose.yaw - other.yaw, math.tau))
    return math.hypot(pose.x - other.x, pose.y - other.y) > TRAVEL_M or turned > TURN_RAD
