"""A base that drives beside its line and tells its pose seldom or roughly, and the truth of it.

It follows the newest path at once, at one speed, and turns on the spot.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from fasaco_edge.daemon.loop.mission_reports import floor_report
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose
from fasaco_edge.grid.lattice import Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.judge.floor import SweepingRobot, judge_floor
from fasaco_edge.mission.config import MissionConfig, MissionPolicy, Sweeping
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.events import MapReceived, PlanReady, PoseReceived, State
from fasaco_edge.planners.cost import CoverageCost, SearchWork
from fasaco_edge.planners.line import LINES
from fasaco_edge.planners.planner import WorkLimit
from fasaco_edge.planners.search.near_optimal import NearOptimal

TOOL_M, RADIUS_M, CELL_M = 0.3, 0.18, 0.276
STEP_S, QUARTER_TURN_S, MOST_S = 0.1, 0.5, 1500.0
# Largest distance of the base from the part of a new path that it skips [m].
NEAR_M = 0.05
# Largest length of that part beyond the distance driven meanwhile [m].
BEHIND_M = 0.15
START = (1.0, 1.0)


def bare_room(x=0.0, y=0.0):
    """Return a room of 3 m x 3 m whose map begins at x, y [m]."""
    pixels = np.zeros((62, 62), np.int8)
    pixels[[0, -1]] = pixels[:, [0, -1]] = 100
    return OccupancyGrid(GridGeometry(*pixels.shape, 0.05, Pose2D(x, y)), pixels)


def small_flat():
    """Return a room with a table, and one without, 3 m x 2.1 m: a line takes long to polish."""
    pixels = np.zeros((42, 60), np.int8)
    pixels[:2] = pixels[-2:] = pixels[:, :2] = pixels[:, -2:] = 100
    pixels[:24, 38:41] = 100
    pixels[22:28, 16:24] = 100
    return OccupancyGrid(GridGeometry(*pixels.shape, 0.05, Pose2D(0.0, 0.0)), pixels)


def configured(speed_m_s):
    """Return the configuration of the mission of a robot with this speed."""
    line = replace(LINES["thorough"], speed_m_s=speed_m_s)
    return MissionConfig(
        Footprint(CELL_M, RADIUS_M),
        cost=CoverageCost.for_robot(CELL_M, speed_m_s, 1.5),
        policy=MissionPolicy(retries=1, retry_s=2.0),
        sweeping=Sweeping(TOOL_M, 1_000_000, line),
        speed_m_s=speed_m_s,
    )


@dataclass
class Base:
    """A base whose tool is ``left_m`` to the left of the point that it leads along the line."""

    speed_m_s: float
    left_m: float
    x: float = START[0]
    y: float = START[1]
    yaw: float = 0.0
    ahead: list[tuple[float, float]] = field(default_factory=list)
    turns_s: float = 0.0

    @property
    def place(self):
        return (
            self.x - self.left_m * math.sin(self.yaw),
            self.y + self.left_m * math.cos(self.yaw),
        )

    def follow(self, xy, driven_m):
        """Take a path that was laid ``driven_m`` ago."""
        points, along, nearest = [tuple(point) for point in xy.tolist()], 0.0, (NEAR_M, 0)
        for number, (a, b) in enumerate(pairwise(points)):
            length = max(math.dist(a, b), 1e-9)
            share = (self.x - a[0]) * (b[0] - a[0]) + (self.y - a[1]) * (b[1] - a[1])
            share = min(max(share / length**2, 0.0), 1.0)
            at = a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
            if along + share * length <= driven_m + BEHIND_M:
                nearest = min(nearest, (math.dist(at, (self.x, self.y)), number + 1))
            along += length
        self.ahead = points[nearest[1] :]

    def go(self, seconds):
        while self.ahead and seconds > 1e-9:
            if self.turns_s > 0.0:
                spent = min(self.turns_s, seconds)
                self.turns_s, seconds = self.turns_s - spent, seconds - spent
                continue
            to_x, to_y = self.ahead[0]
            far = math.dist((self.x, self.y), self.ahead[0])
            if far > 1e-6:
                before, self.yaw = self.yaw, math.atan2(to_y - self.y, to_x - self.x)
                turned = abs(math.remainder(self.yaw - before, math.tau))
                if turned > 0.02:
                    self.turns_s = QUARTER_TURN_S * turned / (0.5 * math.pi)
                    continue
            step = min(far, self.speed_m_s * seconds)
            self.x += step * math.cos(self.yaw)
            self.y += step * math.sin(self.yaw)
            seconds -= step / self.speed_m_s
            if far <= step + 1e-9:
                del self.ahead[0]


@dataclass(frozen=True)
class Outcome:
    """What a mission came to.

    Attributes:
        mission: at its end.
        seconds: until then.
        swept, known, claimed: shares of the reachable floor: swept in truth, swept by the record,
            and all that the status does not tell as left.
        false: share that the record holds for swept, and is not.
        troubles: text of each trouble met, by its code.
    """

    mission: Mission
    seconds: float
    swept: float
    known: float
    claimed: float
    false: float
    troubles: dict[str, str]


def driven(
    ground, *, speed_m_s=0.3, left_m=0.0, poses_hz=10.0, noise_m=0.0, most_s=MOST_S, tick_s=0.1
):
    """Let a base carry out a mission on a known map; return its outcome.

    Args:
        ground: the map.
        speed_m_s, left_m: of the base.
        poses_hz: how many poses it tells in a second.
        noise_m: standard deviation of each, along each axis.
        most_s: limit on the time of the mission.
        tick_s: time between two looks at the base.
    """
    rng, base, mission = np.random.default_rng(5), Base(speed_m_s, left_m), None
    mission = Mission(configured(speed_m_s))
    plan, told_at, track, troubles = None, 0.0, [base.place], {}
    between, every = round(1.0 / poses_hz / tick_s), round(STEP_S / tick_s)
    for tick in range(round(most_s / tick_s)):
        now, events = tick * tick_s, []
        base.go(tick_s)
        track.append(base.place)
        if not tick:
            events.append(MapReceived(ground))
        if tick % between == 0:
            pose = Pose2D(*rng.normal(base.place, noise_m).tolist(), base.yaw)
            events.append(PoseReceived(StampedPose(pose, "map", round(1e9 * now))))
            told_at = now
        if plan is not None:
            limit = WorkLimit(SearchWork(proposals=20_000))
            path = NearOptimal().plan(plan.problem, limit)
            events.append(PlanReady(plan.number, path, 0.0))
        elif not events and tick % every:
            continue
        decision = mission.step(events, now)
        plan = decision.plan
        if decision.path is not None:
            base.follow(decision.path.xy, speed_m_s * (now - told_at))
        troubles |= {trouble.code: trouble.text for trouble in mission.troubles}
        if mission.state is State.DONE:
            break
    judged = judge_floor(ground, np.array(track), SweepingRobot(TOOL_M, RADIUS_M), stands_at=START)
    known = mission.covered.floor.swept_on(judged.geometry) & judged.reachable
    told, whole = floor_report(mission), np.count_nonzero(judged.reachable)
    return Outcome(
        mission,
        now,
        judged.figures.swept_share,
        np.count_nonzero(known) / whole,
        told.reached_m2 / told.reachable_m2,
        np.count_nonzero(known & ~judged.swept) / whole,
        troubles,
    )
