"""A mission whose lines keep a clearance from walls and furniture, but for floor worth it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.daemon.loop.loader import mission_config
from fasaco_edge.judge.floor import judge_floor
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.events import MapReceived
from fasaco_edge.planners.search.near_optimal import NearOptimal
from tests.grid.test_floor import room
from tests.mission.test_line import CONFIG, RADIUS_M, ROBOT, Robot, with_obstacle

CLEARANCE_M = 0.02


def driven(clearance_m):
    """Return the room, and the way that a robot has driven in it until its mission was done."""
    grid = with_obstacle(room(3.0, 2.4), 28, 30, 2)
    sweeping = replace(CONFIG.sweeping, clearance_m=clearance_m)
    robot = Robot(Mission(replace(CONFIG, sweeping=sweeping)))
    robot.tell(MapReceived(grid))
    robot.finish()
    return grid, np.array(robot.trail)


def near_share(grid, trail):
    """Return the share of points of a way without clearance, but for a rounding."""
    rows, cols = np.nonzero((grid.cells < 0) | (grid.cells > 25))
    near = 0
    for x, y in trail.tolist():
        col, row = grid.geometry.to_pixels(x, y)
        off = np.maximum(np.abs(np.stack([cols + 0.5 - col, rows + 0.5 - row])) - 0.5, 0.0)
        apart_m = np.hypot(*off).min() * grid.geometry.resolution
        near += apart_m < RADIUS_M + 0.75 * CLEARANCE_M
    return near / len(trail)


def test_a_mission_keeps_its_clearance_and_sweeps_nearly_all():
    (grid, without), (_, kept) = driven(0.0), driven(CLEARANCE_M)
    assert near_share(grid, kept) < 0.3 * near_share(grid, without)
    swept = [judge_floor(grid, trail, ROBOT).figures.swept_share for trail in (without, kept)]
    assert swept[1] > swept[0] - 0.04


def test_the_configured_clearance_is_that_of_the_mission():
    config = DaemonConfig(robot=RobotConfig(clearance_m=0.03))
    assert mission_config(config, NearOptimal()).sweeping.clearance_m == 0.03
