"""Mission in simulated time: the real ``Mission.step``, and a robot that executes its decisions.

After every leg the robot scans. The mission receives the changes and the pose, and its decision is
executed before the next leg. The time of the decision is measured, but the robot does not wait.

A daemon's planner has a time limit. Here it has a limit on the moves that it tries, so that every
machine reproduces the same mission. The record of a mission has times, the share of each path that
the next one keeps, and outdated plans.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.mission.config import NO_PATIENCE, BatteryPolicy, MissionPolicy
from fasaco_edge.mission.core.mission import Mission, MissionConfig
from fasaco_edge.mission.events import (
    Decision,
    Event,
    PlanReady,
    PlanRequest,
    PoseReceived,
)
from fasaco_edge.planners.cost import CoverageCost, SearchWork
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import WorkLimit, ignore
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.states import State
from tests.benchmarks.harness import planner_for
from tests.benchmarks.judge import MOVES
from tests.benchmarks.online.buildings import Building
from tests.benchmarks.online.contenders import CONTENDERS, DAEMON
from tests.benchmarks.online.robot import Pace, Robot
from tests.benchmarks.online.sight import Sight

# How far ahead of the robot a path is to hold still [m].
NEXT_M = 5.0


class Elapsed(NamedTuple):
    """How long something took: by the clock, and of processors [ms].

    On a quiet machine both are the same, as there is one thread at work.
    """

    wall_ms: float
    cpu_ms: float


class Stopwatch:
    """Runs from its making on."""

    def __init__(self) -> None:
        self._wall_s, self._cpu_s = time.perf_counter(), time.process_time()

    def read(self) -> Elapsed:
        """Return how long it has run."""
        wall_s, cpu_s = time.perf_counter() - self._wall_s, time.process_time() - self._cpu_s
        return Elapsed(1e3 * wall_s, 1e3 * cpu_s)


@dataclass(slots=True)
class Watch:
    """Figures of a mission so far.

    Attributes:
        next_cells: so many steps are the next NEXT_M.
        ingests: of each step with a map, how long it took up to the decision.
        replans: of each path but the first, how long it took from the decision to it.
        kept: of each path that took the place of one still valid, the share of the next
            steps that stayed the same up to the first that did not.
        updates: of each map that left the next steps valid, whether they stayed the same.
        paths: how many were published.
        requests: how many plans were asked for.
        waiting_s: how long the robot stood without a way to go [s].
        held_up: how often it stood before an obstacle that its path led into.
        stale_m: way driven on a path that the newest map had blocked further on [m].
        faults: what the mission refused, and why.
    """

    next_cells: int
    ingests: list[Elapsed] = field(default_factory=list)
    replans: list[Elapsed] = field(default_factory=list)
    kept: list[float] = field(default_factory=list)
    updates: list[bool] = field(default_factory=list)
    paths: int = 0
    requests: int = 0
    waiting_s: float = 0.0
    held_up: int = 0
    stale_m: float = 0.0
    faults: list[str] = field(default_factory=list)

    def compare(
        self,
        before: NDArray[np.int32],
        after: NDArray[np.int32],
        lattice: CoverageLattice,
        *,
        with_path: bool,
        with_map: bool,
    ) -> None:
        """Note what is kept of the way ahead, from the robot's cell on.

        Args:
            before, after: int32 (n, 2), the way ahead then and now.
            lattice: as it is now.
            with_path, with_map: whether a path was published, and a map came.
        """
        last, then = before[: self.next_cells + 1], after[: self.next_cells + 1]
        if len(last) < 2 or not len(then) or not is_legal(last, lattice):
            return
        common = min(len(last), len(then))
        same = (last[:common] == then[:common]).all(axis=1)
        kept = max((common if same.all() else int(np.argmin(same))) - 1, 0) / (len(last) - 1)
        if with_path:
            self.kept.append(kept)
        if with_map:
            self.updates.append(kept == 1.0)


def is_legal(walk: NDArray[np.int32], lattice: CoverageLattice) -> bool:
    """Tell whether each step of a walk, int32 (n, 2), is allowed on ``lattice``."""
    window = lattice.window
    cells = walk - (window.row0, window.col0)
    if not ((cells >= 0) & (cells < lattice.steps.shape)).all():
        return False
    moves = np.diff(cells, axis=0)
    allowed = lattice.steps[tuple(cells[:-1].T)]
    legal = np.zeros(len(moves), bool)
    for direction, move in enumerate(MOVES):
        legal |= (moves == move).all(axis=1) & (allowed >> direction & 1).astype(bool)
    return bool(legal.all())


# Takes the place of the daemon's planning thread.
PlannerSeat = Callable[[PlanRequest], PlanReady]

# Proposals of a reference per cell, and at least in all.
REFERENCE_PER_CELL, REFERENCE_LEAST = 10_000, 5_000_000


@dataclass(frozen=True, slots=True)
class CountedPlanning:
    """A planner, by default the daemon's, with work for a budget.

    Attributes:
        seed: of all random streams.
        proposals: moves that a search may try; a repair ends long before, ants try none.
        planner: one of ``CONTENDERS``.
    """

    seed: int
    proposals: int
    planner: str = DAEMON

    def __call__(self, request: PlanRequest) -> PlanReady:
        """Answer a request."""
        path, elapsed = self.timed(request.problem)
        return PlanReady(request.number, path, 1e-3 * elapsed.wall_ms)

    def timed(self, problem: CoverageProblem) -> tuple[CoveragePath, Elapsed]:
        """Return a plan and how long it took."""
        limit = WorkLimit(SearchWork(proposals=self.proposals))
        stopwatch = Stopwatch()
        contender = CONTENDERS[self.planner]
        if not contender.on_trail:
            problem = replace(problem, trail=None)
        path = contender.make(self.seed).plan(problem, limit, ignore)
        return path, stopwatch.read()


def near_optimal(problem: CoverageProblem) -> CoveragePath:
    """Return the walk of a robot that knew the building: what missions are measured against."""
    proposals = max(REFERENCE_PER_CELL * problem.cells, REFERENCE_LEAST)
    return planner_for(0).plan(problem, WorkLimit(SearchWork(proposals=proposals)))


# A robot without a way to go looks again after so long [s].
TICK_S = 0.1
# Standstill after which a mission is given up [s].
PATIENCE_S = 60.0
# Visits per cell after which a mission is given up.
MOST_VISITS = 20
# Plans that a mission may ask for before the robot goes on.
PLANS_AT_ONCE = 5


@dataclass(frozen=True, slots=True)
class Conditions:
    """What a mission takes place under.

    Attributes:
        range_m: reach of the robot's scanner [m].
        pace: how fast it is.
        cost: what its walks are to have little of.
        seat: who plans.
        policy, battery, spare_share: see ``MissionConfig``.
    """

    range_m: float
    pace: Pace
    cost: CoverageCost
    seat: PlannerSeat
    policy: MissionPolicy = NO_PATIENCE
    battery: BatteryPolicy | None = None
    spare_share: float = 0.0


class OnlineMission:
    """A robot in a building unknown to it.

    Attributes:
        building: where it is.
        sight: what is there, and what the robot knows of it.
        robot: where it is and has been.
        watch: what was noted.
        now: simulated time [s].
    """

    def __init__(self, building: Building, conditions: Conditions) -> None:
        self.building = building
        self.sight = Sight(building, conditions.range_m)
        cell_m = building.footprint.cell_m
        centre = building.lattice.centres(np.array([building.start], np.int32))
        (x, y), *_ = centre.tolist()
        self.robot = Robot(self.sight.geometry.to_pixels(x, y), cell_m)
        self.watch = Watch(max(round(NEXT_M / cell_m), 1))
        self.now = 0.0
        self._conditions = conditions
        config = MissionConfig(
            building.footprint,
            cost=conditions.cost,
            policy=conditions.policy,
            battery=conditions.battery,
            spare_share=conditions.spare_share,
        )
        self._mission = Mission(config)
        # The answer that comes with the next step.
        self._late: PlanReady | None = None
        self._stale = False

    @property
    def done(self) -> bool:
        """Whether the mission says that all is covered."""
        return self._mission.state is State.DONE

    @property
    def state(self) -> str:
        """The mission's own words for how it is."""
        return f"{self._mission.state}: {self._mission.reason}"

    def run(self) -> None:
        """Drive until the mission is done, or nothing is to be hoped for any more."""
        most = MOST_VISITS * int(np.count_nonzero(self.building.reachable)) + 1000
        moved_at = self.now
        self.sense()
        while not self.done and len(self.robot.trail) < most:
            if self._go():
                moved_at = self.now
            elif self.now - moved_at > PATIENCE_S:
                return
            self.sense()

    def _go(self) -> bool:
        """Drive a leg, or stand for a tick; tell which."""
        leg = self.robot.next_leg(self.sight)
        if leg is not None and self.sight.is_clear(self.robot.at, leg.end):
            self.now += self._conditions.pace.seconds(leg.distance_m, leg.quarters)
            self.robot.drive(leg, self.now)
            self.watch.stale_m += leg.distance_m if self._stale else 0.0
            return True
        self.watch.held_up += leg is not None
        self.watch.waiting_s += TICK_S
        self.now += TICK_S
        return False

    def heard(self) -> Sequence[Event]:
        """Return what else the mission hears of, beside map and pose."""
        return ()

    def sense(self) -> None:
        """Look around, tell the mission, and do what it decides."""
        self.sight.look(self.robot.at)
        news = self.sight.news()
        pose = StampedPose(self.robot.pose(self.sight), self.building.truth.frame)
        events: list[Event] = [] if news is None else [news]
        events += [PoseReceived(pose), *self.heard()]
        if self._late is not None:
            events.append(self._late)
            self._late = None
        before, paths = self.robot.ahead, self.watch.paths
        self._decide(events, with_map=news is not None)
        lattice, ahead = self._mission.lattice, self.robot.ahead
        with_map, with_path = news is not None, self.watch.paths > paths
        if lattice is not None and (with_map or with_path):
            self._stale = len(ahead) > 1 and not is_legal(ahead, lattice)
            self.watch.compare(before, ahead, lattice, with_path=with_path, with_map=with_map)

    def _decide(self, events: list[Event], *, with_map: bool) -> None:
        decision, stepping = self._step(events)
        if with_map:
            self.watch.ingests.append(stepping)
        # A path that the mission has itself come to with the map is one, too.
        spent = [stepping] if _planned(decision) and with_map else []
        first, answers = not self.watch.requests, 0
        while decision.plan is not None:
            self.watch.requests += 1
            answers += 1
            stopwatch = Stopwatch()
            ready = self._conditions.seat(decision.plan)
            spent.append(stopwatch.read())
            if answers == PLANS_AT_ONCE:
                self._late = ready
                break
            decision, stepping = self._step([ready])
            spent.append(stepping)
        if spent and not first:
            wall_ms, cpu_ms = (sum(times) for times in zip(*spent, strict=True))
            self.watch.replans.append(Elapsed(wall_ms, cpu_ms))

    def _step(self, events: list[Event]) -> tuple[Decision, Elapsed]:
        """Step the mission and follow its path; return how long the step took."""
        stopwatch = Stopwatch()
        decision = self._mission.step(events, self.now)
        stepping = stopwatch.read()
        self.watch.faults += [str(fault) for fault in decision.faults]
        if decision.path is not None:
            self.watch.paths += 1
            self.robot.follow(decision.path.cells)
        return decision, stepping


def _planned(decision: Decision) -> bool:
    return decision.path is not None and decision.path.plan is not None
