"""Missions of a base that cannot turn on the spot: its paths are curves just ahead of it."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from fasaco_edge.follow.supervision import State as Following
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.judge.driven_line import ArcBends
from fasaco_edge.judge.floor import SweepingRobot, judge_floor
from fasaco_edge.mission.core.events import MapReceived, State
from fasaco_edge.mission.line.curver import Curver
from fasaco_edge.planners.curve_config import CurveConfig
from fasaco_edge.planners.curves import STEP_M
from tests.mission.curve_base import CONFIG, RADIUS_M, TOOL_M, TURN_M, CurvedMission
from tests.simulation.rooms import building

ROOM = building(4.5, 3.5)
START = Pose2D(1.0, 1.0)
# What a robot has of its path at least before the next one comes [m].
AHEAD_M = 2.0


@pytest.fixture(scope="module")
def driven():
    """A mission with reversing, until it is done."""
    run = CurvedMission(ROOM, START)
    run.run(600.0)
    return run


def judged(run):
    """The floor that the planner holds for reachable, and what was swept of it."""
    return judge_floor(ROOM, run.track, SweepingRobot(TOOL_M, RADIUS_M), stands_at=(1.0, 1.0))


def test_a_mission_sweeps_a_room_without_a_turn_on_the_spot(driven):
    assert driven.mission.state is State.DONE
    assert driven.loop.world.collisions == 0
    assert set(driven.standing_s) <= {Following.EMPTY_PATH}
    assert judged(driven).figures.swept_share > 0.94
    hull = SweepingRobot(TOOL_M, CONFIG.hull_radius_m)
    assert judge_floor(ROOM, driven.track, hull).figures.illegal_share == 0.0


def test_a_path_is_a_curve_at_its_beginning(driven):
    for now, path in driven.paths[:-1]:
        ways = np.diff(path.xy, axis=0)
        lengths = np.hypot(*ways.T)
        near = np.cumsum(lengths) <= AHEAD_M
        lengths[0] = max(lengths[0], STEP_M)  # the rest of a chord
        along = np.arctan2(ways[near, 1], ways[near, 0])
        bends = np.degrees(np.abs((np.diff(along) + np.pi) % (2.0 * np.pi) - np.pi))
        arcs = ArcBends.of(lengths[near], bends, TURN_M)
        assert not arcs.spots.any(), (now, path.reason)
        # Headings are those of the robot, also where it drives backward.
        pose = driven.loop.truth_at[max(round(now / CONFIG.tick_s) - 1, 0)]
        assert abs(math.remainder(path.yaw[0] - pose.yaw, math.tau)) < 0.2, (now, path.reason)
        off = np.cos(path.yaw[:-1][near] - along)
        assert (np.abs(off) > 0.99).all()
    assert len(driven.paths) > 5


def test_it_drives_backward_but_not_forward_only(driven):
    def backward_m(run):
        poses = run.loop.truth_at
        ways = ((a.x, a.y, a.yaw, b.x - a.x, b.y - a.y) for a, b in pairwise(poses))
        along = (dx * math.cos(yaw) + dy * math.sin(yaw) for _, _, yaw, dx, dy in ways)
        return -sum(way for way in along if way < 0.0)

    assert backward_m(driven) > 1.0
    ahead = CurvedMission(ROOM, START, reverses=False)
    ahead.run(240.0)
    assert backward_m(ahead) == 0.0
    assert ahead.loop.world.collisions == 0
    assert judged(ahead).figures.swept_share > 0.8


def test_without_a_radius_a_path_has_no_headings_of_its_own():
    run = CurvedMission(ROOM, START, turn_m=0.0)
    run._step([MapReceived(ROOM)])
    run._step([])
    (_, path), *_ = run.paths
    assert path.xy is not None
    assert path.yaw is None


def test_headings_turn_round_where_the_robot_changes_its_direction():
    xy = np.array([(0.0, 0.0), (1.0, 0.0), (0.5, 0.0), (0.4, 0.1), (1.4, 0.1)])
    both, ahead = (
        Curver(CurveConfig(TURN_M, reverses, 0.25, 0.25, 0.5, 200.0)) for reverses in (True, False)
    )
    back = math.remainder(math.atan2(0.1, -0.1) + math.pi, math.tau)
    told = both.yaw(xy, Pose2D(0.0, 0.0, 0.3))
    assert np.cos(told - [0.0, 0.0, back, 0.0, 0.0]) == pytest.approx(np.ones(5))
    # It stands the other way round.
    told = both.yaw(xy, Pose2D(0.0, 0.0, 3.0))
    assert np.cos(told - [math.pi, math.pi, back + math.pi, math.pi, math.pi]) == pytest.approx(
        np.ones(5)
    )
    told = ahead.yaw(xy, Pose2D(0.0, 0.0, 3.0))
    assert np.cos(told[[0, 1, 3, 4]] - [0.0, math.pi, 0.0, 0.0]) == pytest.approx(np.ones(4))
    assert both.yaw(xy[:1], Pose2D(0.0, 0.0, 0.3)).tolist() == [0.3]
