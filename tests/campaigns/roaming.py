"""A simulated robot on a bus that outlives every daemon, and its true trail."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial

from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.map_files import find_map, read_map, suggested_start
from fasaco_edge.simulation.node import SimulatedRobot
from fasaco_edge.simulation.robot import SimulationConfig
from fasaco_edge.simulation.world import Emission, World
from fasaco_edge.wire.keys import Keys
from tests.support.ledgers import CELL_M, Cell
from tests.support.processes import free_endpoint

RADIUS_M = 0.18
# Simulated seconds per second: 2 m/s, some six cells a second.
SPEED = 8.0

# When [s, monotonic], x, y [m], and whether it was published.
Point = tuple[float, float, float, bool]


@dataclass
class Trail:
    """Where the robot truly was, tick by tick, and which of it was published."""

    lock: threading.Lock = field(default_factory=threading.Lock)
    points: list[Point] = field(default_factory=list)

    def add(self, pose: Pose2D, published: bool) -> None:
        """Note where the robot is now."""
        with self.lock:
            self.points.append((time.monotonic(), pose.x, pose.y, published))

    def between(self, start_s: float, end_s: float) -> list[Point]:
        """Return (when, x, y, published) of all points in a span of time, in order."""
        with self.lock:
            return [point for point in self.points if start_s <= point[0] <= end_s]


class Robot(SimulatedRobot):
    """A robot on a thread of its own, on a bus that outlives every daemon: it drives on."""

    def __init__(self, bus: Bus, world: World) -> None:
        super().__init__(world, Keys(), bus)
        self.trail = Trail()
        self._ended = threading.Event()
        drive = partial(self.drive, SPEED, self._ended.is_set)
        self._thread = threading.Thread(target=drive, name="robot")

    def __enter__(self) -> Robot:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def publish(self, emission: Emission) -> None:
        super().publish(Emission(map=emission.map))
        self.trail.add(self._world.pose, emission.pose is not None)
        super().publish(Emission(pose=emission.pose))


def entries(points: Iterable[Point], doubt_m: float) -> dict[Cell, float]:
    """Return when the tool first passed over the centre of each cell.

    Args:
        points: (when, x, y, ...) of a drive; between them it was straight.
        doubt_m: the tool's radius is taken to be so much smaller [m].
    """
    found: dict[Cell, float] = {}
    before: tuple[float, float] | None = None
    reach = 0.5 * CELL_M - doubt_m
    for at, x, y, *_ in points:
        # A tick, or a pose, is a few centimetres: small steps find what lies between.
        steps = math.ceil(math.dist(before or (x, y), (x, y)) / 0.002)
        bx, by = before or (x, y)
        for step in range(steps + 1):
            share = step / steps if steps else 1.0
            px, py = bx + share * (x - bx), by + share * (y - by)
            cell = (math.floor(py / CELL_M), math.floor(px / CELL_M))
            if cell not in found:
                centre = ((cell[1] + 0.5) * CELL_M, (cell[0] + 0.5) * CELL_M)
                if math.dist(centre, (px, py)) < reach:
                    found[cell] = at
        before = (x, y)
    return found


@contextmanager
def roaming_robot(map_name: str) -> Iterator[tuple[Robot, str]]:
    """Let a robot drive through a building; yield it, and the endpoint daemons connect to."""
    file, endpoint = find_map(map_name), free_endpoint()
    start = suggested_start(file)
    assert start is not None
    world = World(read_map(file), Pose2D(*start), SimulationConfig(robot_radius_m=RADIUS_M))
    with (
        open_bus(BusSettings("peer", (), (endpoint,))) as bus,
        Robot(bus, world) as robot,
    ):
        yield robot, endpoint
