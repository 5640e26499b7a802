"""A mission of a base that cannot turn on the spot: mission, follower and world in one process."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from fasaco_edge.daemon.loop.outbox import headings
from fasaco_edge.follow.supervision import FollowerState
from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.grid.lattice import Footprint
from fasaco_edge.mission.config import MissionConfig, MissionPolicy, Sweeping
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.events import MapReceived, PlanReady, PoseReceived, State
from fasaco_edge.planners.cost import CoverageCost, SearchWork
from fasaco_edge.planners.curve_config import CurveConfig
from fasaco_edge.planners.line import LINES
from fasaco_edge.planners.planner import WorkLimit
from fasaco_edge.planners.search.near_optimal import NearOptimal
from fasaco_edge.wire.messages.paths import encode_path
from tests.follow.closed_loop import CONFIG, ClosedLoop

TOOL_M, RADIUS_M, CLEARANCE_M, TURN_M = 0.3, 0.2, 0.02, 0.4
CELL_M = TOOL_M * 0.92
SPEED_M_S = CONFIG.speed_m_s
PLANNED = WorkLimit(SearchWork(proposals=20_000))


def configured(*, reverses=True, turn_m=TURN_M):
    line = replace(LINES["thorough"], speed_m_s=SPEED_M_S)
    curves = CurveConfig(turn_m, reverses, SPEED_M_S, SPEED_M_S, 0.5, line.price_s_m2)
    return MissionConfig(
        Footprint(CELL_M, RADIUS_M),
        cost=CoverageCost.for_robot(CELL_M, SPEED_M_S, 1.5),
        policy=MissionPolicy(retries=1, retry_s=2.0),
        sweeping=Sweeping(TOOL_M, 1_000_000, line, 0.0, CLEARANCE_M, curves if turn_m else None),
        speed_m_s=SPEED_M_S,
    )


class CurvedMission:
    """A mission on a known map, and a base with a turning radius that drives its paths.

    Attributes:
        mission, loop: the mission, and the closed loop of follower and base.
        paths: all paths published.
        states: seconds that the follower was in each state.
        longest_s: the longest step of the mission [s].
    """

    def __init__(self, ground, start: Pose2D, **options):
        self.mission = Mission(configured(**options))
        self.loop = ClosedLoop(ground, start, delay_s=0.05, turn_m=TURN_M)
        self.paths, self.longest_s, self._plan = [], 0.0, None
        self._ground = ground

    def run(self, most_s):
        """Drive until the mission is done, or for so long [s]."""
        ticks = 0
        while self.mission.state is not State.DONE and self.loop.now < most_s:
            if ticks % 10 == 0:
                self._step([MapReceived(self._ground)] if not ticks else [])
            self.loop._step()
            ticks += 1

    def _step(self, events):
        now = self.loop.now
        events.append(PoseReceived(StampedPose(self.loop.world.pose, "map", round(1e9 * now))))
        if self._plan is not None:
            path = NearOptimal().plan(self._plan.problem, PLANNED)
            events.append(PlanReady(self._plan.number, path, 0.0))
        begun = time.perf_counter()
        decision = self.mission.step(events, now)
        self.longest_s = max(self.longest_s, time.perf_counter() - begun)
        self._plan = decision.plan
        if decision.path is not None:
            xy = np.empty((0, 2)) if decision.path.xy is None else decision.path.xy
            yaw = headings(xy) if decision.path.yaw is None else decision.path.yaw
            self.paths.append((now, decision.path))
            self.loop.follower.take_path(encode_path(xy, yaw, "map", round(1e9 * now)))

    @property
    def standing_s(self):
        """Seconds that the follower stood with a path to drive, by state."""
        return {
            state: count * 0.05
            for state, count in self.loop.states.items()
            if state not in (FollowerState.DRIVING, FollowerState.DRIVEN, FollowerState.NO_PATH)
        }
