"""A robot that drives the line of a mission as it is published, on maps that the test hands in."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.daemon.ledger.codec import decode_ledger, encode_ledger
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose
from fasaco_edge.grid.lattice import Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.config import MissionConfig, Sweeping
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.core.path_exit import PathExit
from fasaco_edge.mission.events import (
    CommandReceived,
    Event,
    MapReceived,
    PlanReady,
    PlanRequest,
    PoseReceived,
)
from fasaco_edge.mission.orders.keep_outs import KeepOut
from fasaco_edge.mission.orders.order import CommandName
from fasaco_edge.mission.work.order_state import OrderState
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.line import LINES
from tests.mission.world import answer

TOOL_M, RADIUS_M, PIXEL_M = 0.3, 0.18, 0.05
CELL_M = 0.92 * TOOL_M
CONFIG = MissionConfig(
    Footprint(CELL_M, RADIUS_M),
    cost=CoverageCost.for_robot(CELL_M, 0.25, 1.5),
    sweeping=Sweeping(TOOL_M, 1_000_000, LINES["quick"]),
)
SPEED_M_S = 0.25


def map_of(pixels: NDArray[np.int8]) -> OccupancyGrid:
    """Return a map whose corner lies at (0, 0)."""
    return OccupancyGrid(GridGeometry(*pixels.shape, PIXEL_M, Pose2D(0.0, 0.0)), pixels)


class LineRobot:
    """A mission, and a robot that drives its line exactly.

    Attributes:
        config: of the mission.
        mission: the mission.
        now: its time [s].
        x, y: the robot's position [m].
        path: the points still to be driven.
        paths: all paths that were published, with their times.
        track: where the robot was at each tick.
        is_stuck: whether its wheels turn in vain.
        tick_s: time between two of its poses [s].
    """

    tick_s = 0.2

    def __init__(
        self, pixels: NDArray[np.int8], start: tuple[float, float], config: MissionConfig = CONFIG
    ) -> None:
        self.config = config
        self.mission = Mission(config)
        self.exit = PathExit()
        self.now, self.yaw = 0.0, 0.0
        self.x, self.y = start
        self.is_stuck = False
        self.path: list[tuple[float, float]] = []
        self.paths: list[tuple[float, NDArray[np.float64], str]] = []
        self.track: list[tuple[float, float]] = []
        self._plan = None
        self._commands = 0
        self.step(MapReceived(map_of(pixels)))

    def step(self, *events: Event) -> None:
        """Let a tick pass: drive, report the pose, and take the path."""
        self.now += self.tick_s
        self._drive(0.0 if self.is_stuck else SPEED_M_S * self.tick_s)
        self.track.append((self.x, self.y))
        stamp_ns = round(self.now * 1e9)
        pose = PoseReceived(StampedPose(self.reported, "map", stamp_ns))
        plans = [] if self._plan is None else [self.planned(self._plan)]
        decision = self.mission.step(self.arrived([*events, pose, *plans]), self.now)
        self._plan = decision.plan
        self.exit.follow(self.mission, decision.path)
        sent = self.exit.send(lambda path: True)
        if sent is not None:
            self.paths.append((self.now, sent.xy, sent.reason))
            self.path = [(x, y) for x, y in sent.xy.tolist()]

    def planned(self, request: PlanRequest) -> PlanReady:
        """Answer a request for a plan."""
        return answer(request)

    @property
    def reported(self) -> Pose2D:
        """The pose that its localiser reports."""
        return Pose2D(self.x, self.y, self.yaw)

    def arrived(self, events: list[Event]) -> list[Event]:
        """Return which events of a tick come to the mission."""
        return events

    def show(self, pixels: NDArray[np.int8]) -> None:
        """Let a tick pass in which a map comes."""
        self.step(MapReceived(map_of(pixels)))

    def restart(self, pixels: NDArray[np.int8]) -> None:
        """Let another mission go on from what is kept, on a map that comes first."""
        kept = self.mission.snapshot()
        self.mission, self.exit = Mission(self.config), PathExit()
        self.mission.restore(
            decode_ledger(encode_ledger(kept), kept.cell_m), OrderState.from_json(kept.note)
        )
        self.path, self._plan = [], None
        self.show(pixels)

    def command(self, name: CommandName, keep_out: KeepOut | None = None) -> None:
        """Give a command."""
        self._commands += 1
        self.step(CommandReceived(self._commands, name, keep_out=keep_out, discard=True))

    def wait(self, seconds: float, until: Callable[[LineRobot], bool]) -> bool:
        """Let time pass until something holds; return whether it does."""
        end = self.now + seconds
        while self.now < end:
            if until(self):
                return True
            self.step()
        return until(self)

    def _drive(self, way: float) -> None:
        while self.path and way > 1e-9:
            x, y = self.path[0]
            far = math.dist((x, y), (self.x, self.y))
            if far > 1e-6:
                self.yaw = math.atan2(y - self.y, x - self.x)
            if far <= way:
                self.x, self.y = x, y
                del self.path[0]
            else:
                self.x += way * math.cos(self.yaw)
                self.y += way * math.sin(self.yaw)
            way -= min(far, way)
