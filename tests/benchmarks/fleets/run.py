"""Robots of one fleet in an unknown building, in simulated time.

Real missions plan for simulated robots, all in one process, so that the same options give the same
run. Once a period, robots receive each other's messages, unless ``hears`` prevents this.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeVar

import numpy as np

from fasaco_edge.fleet.mission.kind import FleetKind, giving_way_of
from fasaco_edge.fleet.mission.message import Messages
from fasaco_edge.fleet.review.report import find_again
from fasaco_edge.fleet.review.tracks import RobotTrack
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.lattice import Cell, Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.kernels.floor.turning import proportional_turning
from fasaco_edge.mission.config import MissionConfig, Sweeping
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.coverage.ledger import CoverageLedger
from fasaco_edge.mission.events import (
    Event,
    MapReceived,
    MemberReceived,
    PlanReady,
    PlanRequest,
    PoseReceived,
)
from fasaco_edge.mission.path.plan_requests import most_s
from fasaco_edge.planners.cost import CoverageCost, SearchWork
from fasaco_edge.planners.line import LINES
from fasaco_edge.planners.planner import WorkLimit
from fasaco_edge.planners.search.near_optimal import NearOptimal
from fasaco_edge.simulation.robot import SimulationConfig
from fasaco_edge.simulation.world import World
from fasaco_edge.states import State

TOOL_M, RADIUS_M, OVERLAP = 0.3, 0.18, 0.08
SPEED_M_S, TURN_S = 0.25, 1.5
PROPOSALS = 1_000_000
# Of an attempt at a better path by repairs; a search of the rest has as many as a needed plan.
REPAIR_PROPOSALS = 200_000
SPARE_SHARE = 0.05
MOST_TILES = 4
# A run that is not over by then has failed, in simulated time [s].
LONGEST_S = 20_000.0


Result = TypeVar("Result")


def _timed(times_ms: list[float], call: Callable[[], Result]) -> Result:
    began = time.process_time()
    result = call()
    times_ms.append(1e3 * (time.process_time() - began))
    return result


@dataclass(frozen=True, slots=True)
class Fleet:
    """What robots do in a building.

    Attributes:
        truth: the building.
        starts: where they start, x, y [m].
        line: "cells" or "thorough", as ``planner.line``.
        period_s: how often they tell each other of themselves [s].
        speed_m_s: how fast they drive.
        radius_m: of each.
    """

    truth: OccupancyGrid
    starts: Sequence[tuple[float, float]]
    line: str = "thorough"
    period_s: float = 1.0
    speed_m_s: float = SPEED_M_S
    radius_m: float = RADIUS_M

    @property
    def cell_m(self) -> float:
        """Edge of a cell [m]."""
        return TOOL_M if self.line == "cells" else TOOL_M * (1.0 - OVERLAP)

    def config(self) -> MissionConfig:
        """Return the configuration of a mission."""
        cell_m = self.cell_m
        cost = CoverageCost.for_robot(cell_m, self.speed_m_s, TURN_S)
        sweeping = None
        if self.line != "cells":
            turning = proportional_turning(TURN_S)
            line = replace(LINES[self.line], speed_m_s=self.speed_m_s, turning=turning)
            sweeping = Sweeping(TOOL_M, 25_000_000, line)
        footprint = Footprint(cell_m, self.radius_m)
        return MissionConfig(
            footprint,
            cost=cost,
            sweeping=sweeping,
            spare_share=SPARE_SHARE,
        )


@dataclass(slots=True)
class FleetRobot:
    """A robot, its mission, and what was noted of it.

    ``step_ms``, ``plan_ms``: processor time of each step of the mission, and of each plan [ms].
    ``swept_ms``: the cells it swept, and when [ms]; ``passes``: the cells it came into, in order.
    """

    name: str
    mission: Mission
    world: World
    ledger: CoverageLedger
    messages: Messages
    done_s: float = 0.0
    plans: int = 0
    is_dead: bool = False
    step_ms: list[float] = field(default_factory=list)
    plan_ms: list[float] = field(default_factory=list)
    swept_ms: dict[Cell, int] = field(default_factory=dict)
    passes: list[tuple[int, int, int]] = field(default_factory=list)
    inbox: list[MemberReceived] = field(default_factory=list)

    def report(self) -> MemberReceived | None:
        """Return what it tells the others."""
        return self.messages.next(self.mission, MOST_TILES, MOST_TILES)


class FleetRun:
    """Robots under way in a building.

    Attributes:
        robots: by number.
        now: simulated time [s].
        hears: whether a message from one comes to another.
    """

    def __init__(self, fleet: Fleet) -> None:
        self.fleet = fleet
        names = [f"r{number}" for number in range(1, len(fleet.starts) + 1)]
        simulated = SimulationConfig(
            speed_m_s=fleet.speed_m_s, robot_radius_m=fleet.radius_m, padding_m=0.01
        )
        self.robots = []
        for name, (x, y) in zip(names, fleet.starts, strict=True):
            mission = Mission(fleet.config(), kind=FleetKind(name))
            mission.covered.shared.begin_epoch(1)
            world = World(fleet.truth, Pose2D(x, y), simulated)
            ledger, messages = CoverageLedger(fleet.cell_m), Messages(name, fleet.radius_m)
            self.robots.append(FleetRobot(name, mission, world, ledger, messages))
        self.now = 0.0
        self.hears: Callable[[str, str], bool] = lambda speaker, listener: True
        self._swept_by: dict[Cell, set[str]] = {}
        self._planner, self._limit = NearOptimal(), WorkLimit(SearchWork(proposals=PROPOSALS))
        self._repair_limit = WorkLimit(SearchWork(proposals=REPAIR_PROPOSALS))
        self._next_report = [
            number * fleet.period_s / len(self.robots) for number in range(len(self.robots))
        ]

    @property
    def alive(self) -> list[FleetRobot]:
        """The robots that are not dead."""
        return [robot for robot in self.robots if not robot.is_dead]

    def run(self, act: Callable[[FleetRun], None] = lambda _: None) -> None:
        """Let time pass until all are done."""
        while not all(robot.mission.state is State.DONE for robot in self.alive):
            if self.now > LONGEST_S:
                raise RuntimeError(
                    f"not done after {LONGEST_S:g} s: "
                    + "; ".join(robot.mission.reason for robot in self.alive)
                )
            act(self)
            self.tick()

    def tick(self) -> None:
        """Let one tick of the simulation pass."""
        for robot in self.alive:
            robot.world.others = {
                other.name: (other.world.pose.x, other.world.pose.y)
                for other in self.robots
                if other is not robot
            }
            heard = robot.world.tick()
            self.now = robot.world.stamp_ns * 1e-9
            events: list[Event] = [*robot.inbox]
            robot.inbox.clear()
            if heard.map is not None:
                events.append(MapReceived(heard.map))
            if heard.pose is not None:
                events.append(PoseReceived(heard.pose))
                self._note(robot, heard.pose.pose)
            if events:
                self._step(robot, events)
            if robot.mission.state is not State.DONE:
                robot.done_s = self.now
        if len(self.robots) > 1:
            self._tell()

    def _step(self, robot: FleetRobot, events: list[Event]) -> None:
        decision = _timed(robot.step_ms, partial(robot.mission.step, events, self.now))
        while True:
            if decision.path is not None:
                xy = decision.path.xy
                if xy is None:
                    xy = (decision.path.cells[:, ::-1].astype(np.float64) + 0.5) * self.fleet.cell_m
                robot.world.follow(xy)
            if decision.plan is None:
                return
            ready = self._planned(robot, decision.plan)
            decision = _timed(robot.step_ms, partial(robot.mission.step, [ready], self.now))

    def _planned(self, robot: FleetRobot, request: PlanRequest) -> PlanReady:
        problem = request.problem
        if problem.only_better:
            limit = self._limit if problem.is_full else self._repair_limit
            path = self._planner.plan(problem, limit)
            return PlanReady(request.number, path, most_s(problem))
        robot.plans += 1
        path = _timed(robot.plan_ms, partial(self._planner.plan, problem, self._limit))
        return PlanReady(request.number, path, 0.0)

    def _tell(self) -> None:
        for number, speaker in enumerate(self.robots):
            due = self._next_report[number]
            if giving_way_of(speaker.mission).is_near:
                due -= self.fleet.period_s * 0.75
            if speaker.is_dead or self.now < due:
                continue
            self._next_report[number] = self.now + self.fleet.period_s
            report = speaker.report()
            for listener in self.alive:
                if report and listener is not speaker and self.hears(speaker.name, listener.name):
                    listener.inbox.append(report)

    def _note(self, robot: FleetRobot, pose: Pose2D) -> None:
        """Note the cells that it sweeps, and the one it comes into."""
        at_ms, cell_m = round(1000 * self.now), self.fleet.cell_m
        place = math.floor(pose.y / cell_m), math.floor(pose.x / cell_m)
        if not robot.passes or robot.passes[-1][1:] != place:
            robot.passes.append((at_ms, *place))
        for cell in robot.ledger.record(pose):
            robot.swept_ms.setdefault(cell, at_ms)
            self._swept_by.setdefault(cell, set()).add(robot.name)

    @property
    def cells(self) -> int:
        """Cells swept."""
        return len(self._swept_by)

    @property
    def again(self) -> float:
        """Cells that robots swept after others, beyond their shortest ways through these."""
        tracks = [
            RobotTrack(robot.name, 0, [], robot.swept_ms, np.array(robot.passes, np.int64))
            for robot in self.robots
        ]
        find_again(tracks, np.array(sorted(self._swept_by), np.int64))
        return sum(sum(track.again.values()) for track in tracks)

    @property
    def twice(self) -> int:
        """Cells that two or more robots swept."""
        return sum(len(by) > 1 for by in self._swept_by.values())
