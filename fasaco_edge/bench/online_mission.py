"""A whole mission in simulated time: the real ``Mission.step``, and a robot that does as told.

After every leg the robot looks around; what is new goes to the mission with its pose, and its
decision is carried out before the next leg. The time that takes is measured, but the robot
does not stand meanwhile, unless planning is to take its time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fasaco_edge.bench.online_buildings import Building
from fasaco_edge.bench.online_robot import Pace, Robot
from fasaco_edge.bench.online_seat import PlannerSeat
from fasaco_edge.bench.online_sight import Senses, Sight
from fasaco_edge.bench.online_watch import NEXT_M, Elapsed, Stopwatch, Watch, is_legal
from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.mission.events import Decision, Event, PlanReady, PoseReceived
from fasaco_edge.mission.mission import Mission, MissionConfig
from fasaco_edge.mission.progress import State
from fasaco_edge.planners.cost import CoverageCost

# A robot without a way to go looks again after so long [s].
TICK_S = 0.1
# One that stood for so long will not go on any more [s]; nor one that drove each cell so often.
PATIENCE_S, MOST_VISITS = 60.0, 20
# Plans that a mission may ask for before the robot goes on.
PLANS_AT_ONCE = 5


@dataclass(frozen=True, slots=True)
class Conditions:
    """What a mission takes place under.

    Attributes:
        senses: what the robot sees.
        pace: how fast it is.
        cost: what its walks are to have little of.
        seat: who plans.
        planning_takes_time: whether the robot drives on, or stands, while a plan is made.
    """

    senses: Senses
    pace: Pace
    cost: CoverageCost
    seat: PlannerSeat
    planning_takes_time: bool = False


class OnlineMission:
    """A robot in a building it does not know.

    Attributes:
        building: where it is.
        sight: what is there, and what the robot knows of it.
        robot: where it is and has been.
        watch: what was noted.
        now: simulated time [s].
    """

    def __init__(self, building: Building, conditions: Conditions) -> None:
        self.building = building
        self.sight = Sight(building, conditions.senses)
        cell_m = building.footprint.cell_m
        centre = building.lattice.centres(np.array([building.start], np.int32))
        (x, y), *_ = centre.tolist()
        self.robot = Robot(self.sight.geometry.to_pixels(x, y), cell_m)
        self.watch = Watch(max(round(NEXT_M / cell_m), 1))
        self.now = 0.0
        self._conditions = conditions
        self._mission = Mission(MissionConfig(building.footprint, cost=conditions.cost))
        # A plan that takes its time, and when it will be there.
        self._on_its_way: tuple[PlanReady, float] | None = None
        self._stale = False

    @property
    def done(self) -> bool:
        """Whether the mission says that all is covered."""
        return self._mission.state is State.DONE

    @property
    def state(self) -> str:
        """The mission's own words for how it is."""
        return f"{self._mission.state}: {self._mission.reason}"

    def run(self, act: Callable[[OnlineMission], None] = lambda _: None) -> None:
        """Drive until the mission is done, or nothing is to be hoped for any more.

        Args:
            act: called before each leg; may change what is there.
        """
        most = MOST_VISITS * int(np.count_nonzero(self.building.reachable)) + 1000
        moved_at = self.now
        self.sense()
        while not self.done and len(self.robot.trail) < most:
            act(self)
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
        until = self.now + TICK_S
        if self._on_its_way is not None and leg is None:
            until = max(self._on_its_way[1], self.now)
        self.watch.waiting_s += until - self.now
        self.now = until
        return False

    def sense(self) -> None:
        """Look around, tell the mission, and do what it decides."""
        self.sight.look(self.robot.at)
        news = self.sight.news()
        pose = StampedPose(self.robot.pose(self.sight), self.building.truth.frame)
        events: list[Event] = [] if news is None else [news]
        events.append(PoseReceived(pose))
        if self._on_its_way is not None and self._on_its_way[1] <= self.now:
            events.append(self._on_its_way[0])
            self._on_its_way = None
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
            planning = stopwatch.read()
            spent.append(planning)
            if self._conditions.planning_takes_time or answers == PLANS_AT_ONCE:
                takes_ms = planning.wall_ms if self._conditions.planning_takes_time else 0.0
                self._on_its_way = ready, self.now + 1e-3 * takes_ms
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
