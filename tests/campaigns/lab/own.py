"""The project's own simulation in the lab: its base, and its noisy mapper, in place of others'.

They need nothing that has to be installed, and take a tenth of the time. Wheels do not slip, and
poses are not searched for: their error is drawn.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.follow.estimate import STAND, VelocityCommand
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid
from fasaco_edge.kernels.lattice.raycast import Scanner
from fasaco_edge.simulation.robot import SimulationConfig
from fasaco_edge.simulation.world import Activity, World
from tests.campaigns.lab.building import Building
from tests.campaigns.lab.noisy_mapper import MapperNoise, NoisyMapper, NoisyWorld
from tests.campaigns.lab.rays import ranges_of
from tests.campaigns.lab.settings import BEAMS, MOST_RANGE_M, TICK_S, LabSettings, stamp_ns

FRAME = "map"
MAP_EVERY_S = 3.0
# Rough: twice as much of all, legs that are seldom seen, and jumps.
NOISES: dict[str, MapperNoise | None] = {
    "none": None,
    "usual": MapperNoise(),
    "range": replace(MapperNoise().times(0.0), range_m=0.02, shift_m=0.05),
    "legs": replace(MapperNoise().times(0.0), leg_misses=0.9, specks=0.002, shift_m=0.05),
    "drift": replace(MapperNoise(), drift_m=0.015, drift_rad=0.005),
    "jumps": replace(MapperNoise(), jumps=0.03),
    "late": replace(MapperNoise(), late_s=0.3),
    "rough": replace(MapperNoise().times(2.0), leg_misses=0.85, jumps=0.02),
}


class OwnBase:
    """A base in a world, and the poses and maps of the mapper there; as ``Base``.

    Attributes:
        wheels, grip, touches, touches_person, odometry: as of ``Base``; odometry is the truth.
    """

    grip = 1.0
    touches_person = False

    def __init__(self, building: Building, settings: LabSettings) -> None:
        cells = np.where(building.occupied, OCCUPIED, FREE).astype(np.int8)
        cells[building.unknown] = UNKNOWN
        robot = settings.robot
        config = SimulationConfig(
            speed_m_s=settings.speed_m_s,
            turn_rad_s=math.radians(robot.turning_deg_s()),
            acceleration_m_s2=0.6,
            turn_acceleration_rad_s2=4.0,
            robot_radius_m=settings.radius_m,
            padding_m=settings.radius_m - settings.hull_m,
            range_m=MOST_RANGE_M,
            tick_s=TICK_S,
            scan_hz=settings.scan_hz,
            map_hz=1.0 / MAP_EVERY_S,
            pose_hz=1.0 / TICK_S,
            turn_radius_m=settings.turn_radius_m,
        )
        noise = NOISES[settings.own]
        truth, start = OccupancyGrid(building.geometry, cells, FRAME), building.start
        if noise is None:
            self.world = World(truth, start, config)
        else:
            self.world = NoisyWorld(truth, start, config, replace(noise, seed=settings.seed))
        self._truth = truth
        self._noise_m, self._rng = settings.noise_m, np.random.default_rng(settings.seed)
        self.wheels, self.touches = STAND, False
        self.pose = building.start
        self.map: OccupancyGrid | None = None

    @property
    def now(self) -> float:
        """Simulated time [s]."""
        return self.world.stamp_ns * 1e-9

    @property
    def truth(self) -> Pose2D:
        """The true pose."""
        return self.world.pose

    odometry = truth

    def command(self, command: VelocityCommand) -> None:
        """Take in a command."""
        self.world.move(command.speed, command.turn_rate)

    def tick(self) -> None:
        """Move on by a tick."""
        emission = self.world.tick()
        self.wheels = VelocityCommand(self.world.drive.speed, self.world.drive.turn_rate)
        self.touches = self.world.activity is Activity.COLLIDED
        self.pose = emission.pose.pose if emission.pose is not None else self.pose
        self.map = emission.map or self.map

    def scan(self) -> NDArray[np.float64]:
        """Return the ranges of the beams of a lidar; as of ``Base``. The mapper has its own."""
        grid, truth = self._truth.geometry, self.truth
        angles = np.linspace(-math.pi, math.pi, BEAMS) + (truth.yaw - grid.origin.yaw)
        scanner = Scanner(*grid.to_pixels(truth.x, truth.y), MOST_RANGE_M / grid.resolution, FREE)
        directions = np.column_stack((np.cos(angles), np.sin(angles)))
        cells, nothing = self._truth.cells, np.zeros(self._truth.cells.shape, bool)
        ways = ranges_of(cells, nothing, scanner, directions, np.zeros(BEAMS, bool))
        noisy = ways * grid.resolution + self._rng.normal(0.0, self._noise_m, BEAMS)
        return np.where(ways > 0.0, np.maximum(noisy, 0.0), 0.0)


class OwnMapper:
    """The mapper in a world; as ``Mapper``."""

    def __init__(self, base: OwnBase) -> None:
        self._base = base

    @property
    def loops(self) -> int:
        """How many loops were closed."""
        mapper = self._base.world.mapper
        return mapper.loops if isinstance(mapper, NoisyMapper) else 0

    def corrected(self, _odometry: Pose2D) -> Pose2D:
        """Return the newest pose that the mapper has published."""
        return self._base.pose

    def wants(self, _odometry: Pose2D) -> bool:
        """Return False: it takes scans by itself."""
        return False

    def take(self, _ranges: NDArray[np.float64], _odometry: Pose2D) -> None:
        """Take nothing."""

    def map_due(self, now: float) -> OccupancyGrid | None:
        """Return the map that has just been published, if any."""
        grid, self._base.map = self._base.map, None
        return None if grid is None else replace(grid, stamp_ns=stamp_ns(now))
