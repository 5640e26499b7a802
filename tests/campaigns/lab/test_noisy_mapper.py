"""The noisy mapper: what its map and its poses have of a real one's, each by itself."""

from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.simulation.mapper import Mapper
from fasaco_edge.simulation.robot import SimulationConfig
from tests.campaigns.lab.noisy_mapper import MapperNoise, NoisyMapper, NoisyWorld
from tests.simulation.rooms import RESOLUTION, building

CONFIG = SimulationConfig(range_m=6.0)
NONE = MapperNoise().times(0.0)
LEG = (1.5, 1.5, 1.55, 1.55)


def rounds(times=1, step_m=0.1):
    """Poses along a square of 2 m, again and again."""
    side = np.arange(0.0, 2.0, step_m)
    for _ in range(times):
        for turn, (x0, y0), (dx, dy) in (
            (0.0, (0.5, 0.5), (1, 0)),
            (0.5, (2.5, 0.5), (0, 1)),
            (1.0, (2.5, 2.5), (-1, 0)),
            (-0.5, (0.5, 2.5), (0, -1)),
        ):
            for way in side.tolist():
                yield Pose2D(x0 + way * dx, y0 + way * dy, turn * np.pi)


def mapped(noise, times=1, truth=None):
    """Return the mapper after some rounds, its newest map, and all maps on its raster."""
    mapper = NoisyMapper(truth or building(3, 3, LEG), CONFIG, noise)
    maps = []
    for pose in rounds(times):
        if mapper.scan(pose) is not None:
            maps.append(mapper._known.copy())
    return mapper, mapper.snapshot(1), np.array(maps)


def test_a_mapper_that_only_counts_rays_places_walls_correctly():
    # A ray in ten thousand that goes by nothing: it is a noisy one, but for that.
    noise = replace(NONE, leg_misses=1e-9)
    truth = building(3, 3, LEG)
    _, grid, _ = mapped(noise, 4, truth)
    ideal = Mapper(truth, CONFIG)
    for pose in rounds(1, 0.02):
        ideal.scan(pose)
    col, row = truth.geometry.to_pixels(grid.geometry.origin.x, grid.geometry.origin.y)
    col, row = round(col), round(row)
    known = np.full((84, 84), -1, np.int8)
    known[12:72, 12:72] = ideal.snapshot(0).cells
    own = known[12 + row : 12 + row + grid.geometry.rows, 12 + col : 12 + col + grid.geometry.cols]
    both = (own != -1) & (grid.cells != -1)
    assert (own[both] == grid.cells[both]).all()
    assert np.count_nonzero(grid.cells == 0) > 0.99 * np.count_nonzero(own == 0)


@pytest.mark.parametrize(
    "noise",
    [
        replace(NONE, range_m=0.012),
        replace(NONE, shift_m=0.05),
        replace(NONE, range_m=0.012, shift_m=0.05, match_m=0.006),
    ],
)
def test_walls_get_thicker_and_thinner_by_a_pixel_and_no_more(noise):
    truth = building(3, 3)
    _, grid, maps = mapped(noise, 6, truth)
    # Of the free floor, seen from pixel centres, a frame of less than two pixels may be lost.
    geometry = grid.geometry
    x, y = geometry.to_map(*(axis + 0.5 for axis in np.indices(grid.cells.shape)[::-1]))
    into = np.minimum.reduce([x - 0.05, 2.95 - x, y - 0.05, 2.95 - y]) / RESOLUTION
    assert (grid.cells[into > 1.5] == 0).all()
    assert not (grid.cells[into < -1.5] == 0).any()
    if noise.match_m:
        flips = (maps[:-1] != maps[1:]) & (maps[:-1] >= 0) & (maps[1:] >= 0)
        assert flips[20:].sum() > 20


def test_a_thin_leg_comes_and_goes_and_a_wall_does_not():
    noise = replace(NONE, leg_misses=0.9)
    truth = building(3, 3, LEG)
    _, _, maps = mapped(noise, 8, truth)
    at = 12 + 30
    leg, wall = maps[:, at, at], maps[20:, 12, at]
    assert {0, 100} <= set(leg.tolist())
    assert set(wall.tolist()) == {100}
    # Five pixels are no leg.
    table = building(3, 3, (1.5, 1.5, 1.75, 1.55))
    _, _, maps = mapped(noise, 8, table)
    assert set(maps[20:, at, at].tolist()) == {100}


def test_specks_appear_and_are_passed():
    _, _, maps = mapped(replace(NONE, specks=0.02), 4, building(6, 6))
    inside = maps[:, 14:130, 14:130] == 100
    assert inside.any(axis=0).sum() > 10
    assert inside[-1].sum() < inside.any(axis=0).sum() / 2


def far_off(noise, times):
    """Return how far the poses were off [m], float64 (n,), and the mapper."""
    mapper = NoisyMapper(building(3, 3, LEG), CONFIG, noise)
    errors = []
    for pose in rounds(times):
        mapper.scan(pose)
        there = mapper.estimated(pose)
        errors.append(np.hypot(there.x - pose.x, there.y - pose.y))
        back = mapper.true_place(there.x, there.y)
        assert np.hypot(back[0] - pose.x, back[1] - pose.y) < 1e-9
    return np.array(errors), mapper


def test_poses_drift_and_loops_take_that_back_from_the_map_too():
    noise = replace(NONE, seed=3, drift_m=0.01, drift_rad=0.003)
    lost, alone = far_off(replace(noise, closes_loops=False), 8)
    errors, mapper = far_off(noise, 8)
    assert alone.loops == 0
    assert mapper.loops > 3
    # 64 m: without loops it is at sqrt(64) cm or so.
    assert np.median(errors) < np.median(lost)
    # The map is drawn anew: it is that of the scans where they are placed now.
    counted = mapper._hits.copy(), mapper._passes.copy()
    for scan in mapper._scans:
        mapper._count(scan, -1)
    assert counted[0].sum() > 1000
    assert not mapper._hits.any()
    assert not mapper._passes.any()


def test_a_match_is_off_by_a_little_and_a_wrong_one_by_much_once():
    errors, _ = far_off(replace(NONE, match_m=0.006), 4)
    assert 0.003 < np.median(errors) < 0.015
    errors, _ = far_off(replace(NONE, jumps=0.1, jump_m=0.1, closes_loops=False), 8)
    jumps = errors > 0.05
    assert 0.02 < jumps.mean() < 0.4
    assert np.allclose(errors[jumps], 0.1)
    assert (errors[~jumps] < 1e-9).all()


@pytest.mark.parametrize("pose_hz", [1.0, 5.0, 50.0])
def test_late_poses_are_those_of_before_at_their_rate(pose_hz):
    config = replace(CONFIG, pose_hz=pose_hz)
    worlds = [
        NoisyWorld(building(3, 3), Pose2D(0.7, 0.7), config, replace(NONE, late_s=late_s))
        for late_s in (0.0, 0.3)
    ]
    came = [{}, {}]
    for tick in range(500):
        for world, poses in zip(worlds, came, strict=True):
            if (pose := world.tick().pose) is not None:
                poses[tick] = pose
            if tick == 3:
                world.follow(np.array([[0.7, 0.7], [2.3, 0.7]]))
    punctual, late = came
    assert len(punctual) == pytest.approx(10 * pose_hz, abs=1)
    assert late == {tick + 15: pose for tick, pose in punctual.items() if tick + 15 < 500}


def test_the_robot_follows_its_own_map_to_the_end_of_the_path():
    noise = MapperNoise(seed=5, specks=0.0)
    world = NoisyWorld(building(4, 3), Pose2D(0.7, 0.7), CONFIG, noise)
    world.tick()
    world.follow(np.array([[0.7, 0.7], [3.2, 0.7], [3.2, 2.2], [0.7, 2.2]]))
    for _ in range(4000):
        world.tick()
    assert np.hypot(world.estimated_pose.x - 0.7, world.estimated_pose.y - 2.2) < 0.002
    assert np.hypot(world.pose.x - 0.7, world.pose.y - 2.2) > 0.005
    assert world.collisions == world.stops == 0


def test_a_level_multiplies_amounts_and_shares_up_to_one():
    assert MapperNoise().times(3.0).leg_misses == 1.0
    noise = MapperNoise(seed=4, closes_loops=False).times(2.0)
    assert (noise.seed, noise.closes_loops, noise.shift_m) == (4, False, 0.1)
