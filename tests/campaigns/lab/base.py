"""The lab's base: a differential robot with a lidar in ir-sim.

Its wheels slip for a moment now and then, and its odometry has a wrong wheel size and a wrong track
width. It touches walls, and people who walk about. It alone knows the true pose.
"""

from __future__ import annotations

import contextlib
import io
import math
import tempfile
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import yaml
from numpy.typing import NDArray
from PIL import Image
from shapely.strtree import STRtree

from fasaco_edge.follow.estimate import STAND, VelocityCommand, moved
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.motion import limited
from tests.campaigns.lab.building import Building
from tests.campaigns.lab.settings import (
    BEAMS,
    LEAST_RANGE_M,
    MOST_RANGE_M,
    TICK_S,
    LabSettings,
)

with contextlib.redirect_stdout(io.StringIO()):
    import irsim  # says which of the window systems it does not find

# A base stands without a command for so long [s].
PATIENCE_S = 0.5
ACCELERATION_M_S2, TURN_ACCELERATION_RAD_S2 = 0.6, 4.0
# Factors by which odometry's distance and turn are too large.
WAY_GAIN, TURN_GAIN = 1.012, 1.025
# Turn of the odometry on a straight drive [rad/m], and relative scatter of each step.
BIAS_RAD_M, SCATTER = 0.006, 0.02
# Noise of the true motion, in the form of ir-sim: from the speed, and from the turn rate.
MOTION_NOISE = (0.02, 0.0, 0.0, 0.02)
# Time of the first slip of the wheels, and mean time between two slips [s].
FIRST_SLIP_S, SLIP_EVERY_S = 10.0, 25.0
# Ranges of a slip's duration [s], and of the share of the wheels' speed that is left.
SLIP_S, GRIP = (0.2, 0.6), (0.3, 0.8)
PERSON_RADIUS_M, PERSON_M_S = 0.2, 0.4


class Base:
    """A base, moved tick by tick.

    Attributes:
        now: simulated time [s].
        truth: the true pose.
        odometry: the pose by its wheels; it coincides with the truth at the start.
        wheels: velocities of its wheels.
        grip: share of these that moves it.
        touches: whether the hull touches something.
        touches_person: whether that is a walking person: 0 no person, 1 beside or behind the
            robot, 2 in front of it.
    """

    def __init__(self, building: Building, settings: LabSettings) -> None:
        self.now = 0.0
        self.truth = self.odometry = building.start
        self.wheels = STAND
        self.grip = 1.0
        self.touches, self.touches_person = False, 0
        self._ideal = settings.ideal
        self._rng = np.random.default_rng(settings.seed)
        self._command, self._commanded_at = STAND, -math.inf
        self._tick = 0
        self._slips_until, self._next_slip = 0.0, FIRST_SLIP_S
        self._env = _environment(building, settings)
        (self._body,) = self._env.robot_list
        # A scan takes ten times as long as a step: it is made when it is asked for.
        self._lidar = self._body.lidar
        self._body.sensors = []

    def command(self, command: VelocityCommand) -> None:
        """Take in a command."""
        self._command, self._commanded_at = command, self.now

    def tick(self) -> None:
        """Move on by a tick."""
        told = self._command if self.now - self._commanded_at <= PATIENCE_S else STAND
        self.wheels = VelocityCommand(
            limited(self.wheels.speed, told.speed, ACCELERATION_M_S2 * TICK_S),
            limited(self.wheels.turn_rate, told.turn_rate, TURN_ACCELERATION_RAD_S2 * TICK_S),
        )
        self._slip()
        speed, turn_rate = self.wheels.speed, self.wheels.turn_rate
        self._env.step([np.array([[speed * self.grip], [turn_rate * self.grip]])])
        self.truth = Pose2D(*map(float, self._body.state[:3, 0]))
        touched = [
            c.b if c.a is self._body else c.a
            for c in self._env.contacts
            if self._body in (c.a, c.b)
        ]
        self.touches = bool(touched)
        people = [self._is_ahead(thing) for thing in touched if thing.shape == "circle"]
        self.touches_person = 1 + any(people) if people else 0
        self.odometry = moved(self.odometry, self._counted(), TICK_S)
        self._tick += 1
        self.now = self._tick * TICK_S

    def _is_ahead(self, thing: Any) -> bool:
        """Return whether the middle of something is in front of the robot's."""
        x, y = (float(value) for value in thing.state[:2, 0])
        along = math.cos(self.truth.yaw) * (x - self.truth.x)
        return along + math.sin(self.truth.yaw) * (y - self.truth.y) > 0.0

    def scan(self) -> NDArray[np.float64]:
        """Return the ranges of the lidar's beams, float64 (BEAMS,) [m]; 0 for no return.

        The beams go from -180 to 180 degrees against the robot's heading.
        """
        self._lidar.step(self._body.state[0:3])
        scan = self._lidar.get_scan()
        return np.where(scan["valid"], scan["ranges"], 0.0)

    def _slip(self) -> None:
        """Let the wheels lose their grip for a moment, now and then."""
        drives = abs(self.wheels.speed) + abs(self.wheels.turn_rate) > 0.05
        if not self._ideal and drives and self.now > self._next_slip:
            self.grip = float(self._rng.uniform(*GRIP))
            self._slips_until = self.now + float(self._rng.uniform(*SLIP_S))
            self._next_slip = self.now + float(self._rng.exponential(SLIP_EVERY_S))
        elif self.now >= self._slips_until:
            self.grip = 1.0

    def _counted(self) -> VelocityCommand:
        """Return the velocities that the wheels count."""
        speed, turn_rate = self.wheels.speed, self.wheels.turn_rate
        if self._ideal:
            return self.wheels
        way, turn = 1.0 + SCATTER * self._rng.standard_normal(2)
        counted = turn_rate * TURN_GAIN + speed * BIAS_RAD_M
        return VelocityCommand(float(speed * WAY_GAIN * way), float(counted * turn))


def _environment(building: Building, settings: LabSettings) -> Any:
    """Return ir-sim with a building, a robot and people."""
    with tempfile.TemporaryDirectory() as folder:
        walls, world = Path(folder, "walls.png"), Path(folder, "world.yaml")
        pixels = np.where(building.occupied, 0, 255).astype(np.uint8)
        Image.fromarray(np.flipud(pixels)).save(walls)
        described = _world(building, settings, walls)
        world.write_text(yaml.safe_dump(described), encoding="utf-8")
        env = irsim.make(str(world), headless=True, seed=settings.seed, log_level="ERROR")
    for thing in env.objects:
        if thing.shape == "map":
            # Thousands of pixels' edges: where those in a line are joined, scans take a tenth.
            thing.linestrings = _segments(thing.linestrings)
            thing.geometry_tree = STRtree(thing.linestrings)
    return env


def _world(building: Building, settings: LabSettings, walls: Path) -> dict[str, Any]:
    geometry, start = building.geometry, building.start
    lidar = {
        "type": "lidar2d",
        "range_min": LEAST_RANGE_M,
        "range_max": MOST_RANGE_M,
        "angle_range": math.tau,
        "number": BEAMS,
        "noise": True,
        "std": settings.noise_m,
        "angle_std": 0.002,
    }
    robot = {
        "kinematics": {"name": "diff", "noise": not settings.ideal, "alpha": list(MOTION_NOISE)},
        "shape": {"name": "circle", "radius": settings.hull_m},
        "state": [start.x, start.y, start.yaw],
        "vel_max": [2, 6],
        "vel_min": [-2, -6],
        "sensors": [lidar],
    }
    world = {
        "height": geometry.rows * geometry.resolution,
        "width": geometry.cols * geometry.resolution,
        "offset": [geometry.origin.x, geometry.origin.y],
        "step_time": TICK_S,
        "sample_time": TICK_S,
        "collision_mode": "contact",
        "obstacle_map": str(walls),
    }
    people = [_people(building, settings)] if settings.people else []
    return {"world": world, "robot": [robot], **({"obstacle": people} if people else {})}


def _people(building: Building, settings: LabSettings) -> dict[str, Any]:
    """Return people who walk about in a rectangle: around each other, and around nothing else."""
    x1, y1, x2, y2 = settings.walk or _middle(building)
    area = {"range_low": [x1, y1, -math.pi], "range_high": [x2, y2, math.pi]}
    return {
        "number": settings.people,
        "distribution": {"name": "random", **area},
        "kinematics": {"name": "omni"},
        "shape": [{"name": "circle", "radius": PERSON_RADIUS_M}],
        "behavior": {"name": "dash", "wander": True, **area},
        "vel_max": [PERSON_M_S, PERSON_M_S],
        "vel_min": [-PERSON_M_S, -PERSON_M_S],
    }


def _middle(building: Building) -> tuple[float, float, float, float]:
    """Return the middle half of what is known of a building, each way: x1, y1, x2, y2 [m]."""
    rows, cols = np.nonzero(~building.unknown)
    (row0, row1), (col0, col1) = (np.quantile(axis, (0.25, 0.75)).tolist() for axis in (rows, cols))
    return (*building.geometry.to_map(col0, row0), *building.geometry.to_map(col1, row1))


def _segments(outlines: list[Any]) -> list[Any]:
    """Return the straight pieces of outlines, as long as they go."""
    joined = shapely.line_merge(shapely.unary_union([shapely.simplify(g, 1e-6) for g in outlines]))
    segments = []
    for line in getattr(joined, "geoms", [joined]):
        points = np.array(shapely.simplify(line, 1e-6).coords)
        segments += [shapely.LineString(pair) for pair in pairwise(points)]
    return segments
