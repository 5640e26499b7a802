"""What a mission says to be swept, against the true trail of a robot that its poses only guess."""

from __future__ import annotations

import numpy as np
import pytest

from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose
from fasaco_edge.grid.lattice import Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.judge.floor import SweepingRobot, judge_floor
from fasaco_edge.mission.config import MissionConfig, Sweeping
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.events import MapReceived, PoseReceived
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.line import LINES
from fasaco_edge.simulation.robot import SimulationConfig
from fasaco_edge.simulation.world import World
from tests.mission.world import answer

TOOL_M, RADIUS_M = 0.3, 0.18
MOST_S = 1500.0
START = Pose2D(0.75, 0.75)
CELLS = MissionConfig(Footprint(TOOL_M, RADIUS_M))
LINE = MissionConfig(
    Footprint(0.92 * TOOL_M, RADIUS_M),
    cost=CoverageCost.for_robot(0.92 * TOOL_M, 0.25, 1.5),
    sweeping=Sweeping(TOOL_M, 1_000_000, LINES["thorough"]),
)


def flat():
    """Return two rooms with a table each, 4.5 m x 3 m."""
    pixels = np.zeros((60, 90), np.int8)
    pixels[:2] = pixels[-2:] = pixels[:, :2] = pixels[:, -2:] = 100
    pixels[:36, 48:51] = 100
    pixels[24:34, 18:32] = pixels[14:26, 68:74] = 100
    return placed(pixels)


def small_flat():
    """Return a room with a table, and one without, 3 m x 2.1 m: a line takes long to polish."""
    pixels = np.zeros((42, 60), np.int8)
    pixels[:2] = pixels[-2:] = pixels[:, :2] = pixels[:, -2:] = 100
    pixels[:24, 38:41] = 100
    pixels[22:28, 16:24] = 100
    return placed(pixels)


def placed(pixels):
    return OccupancyGrid(GridGeometry(*pixels.shape, 0.05, Pose2D(0.0, 0.0)), pixels)


def driven(ground, config, noise_m, beside_m):
    """Let a robot carry out a mission; return the mission, and the robot's true track.

    Args:
        ground: the true map.
        config: of the mission.
        noise_m: standard deviation of each pose, along each axis.
        beside_m: how far it drives beside its path at most, along each axis.
    """
    rng = np.random.default_rng(5)
    mission = Mission(config)
    # Slimmer than it is planned for, by more than it drives beside along both axes at once.
    world = World(ground, START, SimulationConfig(robot_radius_m=RADIUS_M, padding_m=0.08))
    plan, ticks = None, round(MOST_S / world.config.tick_s)
    for tick in range(ticks):
        emitted = world.tick()
        events = [] if emitted.map is None else [MapReceived(emitted.map)]
        if emitted.pose is not None:
            x, y = rng.normal((emitted.pose.pose.x, emitted.pose.pose.y), noise_m).tolist()
            events.append(PoseReceived(StampedPose(Pose2D(x, y), "map", emitted.pose.stamp_ns)))
        if plan is not None:
            events.append(answer(plan))
        if not events:
            continue
        decision = mission.step(events, tick * world.config.tick_s)
        plan = decision.plan
        if decision.path is not None:
            xy = decision.path.xy
            if xy is None:
                xy = mission.lattice.centres(decision.path.cells)
            world.follow(beside(xy, beside_m))
        if mission.state == "done":
            return mission, world.track
    raise AssertionError(f"not done after {MOST_S:g} s: {mission.reason}")


def beside(xy, most_m):
    """Return a path that sways over some half a metre; it begins where it did."""
    phase = np.arange(len(xy)) * 0.6
    sway = np.column_stack((np.sin(phase), np.sin(1.37 * phase)))
    return xy + most_m * sway


@pytest.mark.parametrize(
    ("ground", "config", "noise_m", "beside_m", "right", "known"),
    [
        (flat(), CELLS, 0.0, 0.0, 0.999, 0.999),
        (flat(), CELLS, 0.03, 0.05, 0.995, 0.9),
        # At sharp corners exact poses, too, seem to scatter.
        (small_flat(), LINE, 0.0, 0.0, 0.999, 0.98),
        (small_flat(), LINE, 0.03, 0.05, 0.995, 0.9),
    ],
)
def test_floor_reported_as_swept_is_truly_swept(ground, config, noise_m, beside_m, right, known):
    mission, track = driven(ground, config, noise_m, beside_m)
    judged = judge_floor(ground, track, SweepingRobot(TOOL_M, RADIUS_M))
    said = mission.covered.floor.swept_on(judged.geometry) & judged.reachable
    print(f"{np.count_nonzero(said & judged.swept) / np.count_nonzero(said):.4f} of what it says,")
    print(f"{np.count_nonzero(said & judged.swept) / np.count_nonzero(judged.swept):.4f} of all")
    assert np.count_nonzero(said & judged.swept) >= right * np.count_nonzero(said)
    assert np.count_nonzero(said & judged.swept) >= known * np.count_nonzero(judged.swept)
