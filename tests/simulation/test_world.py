"""The whole simulated robot, without a bus."""

import numpy as np
import pytest

from fasaco_edge.errors import StartBlocked, StartOutsideMap
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.simulation.robot import SimulationConfig
from fasaco_edge.simulation.world import Activity, World
from tests.simulation.rooms import building, centres, distances_to, serpentine


def run(world, ticks=100_000):
    emissions = []
    for _ in range(ticks):
        emissions.append(world.tick())
        if world.activity is not Activity.DRIVING:
            break
    return emissions


def ticks(world, count):
    return [world.tick() for _ in range(count)]


def started(truth, start, config=None):
    world = World(truth, start, config or SimulationConfig())
    world.tick()
    return world


def test_a_serpentine_is_driven_to_its_end_on_the_line():
    world = started(building(4.4, 4.0, origin=Pose2D(-0.4, -0.4)), Pose2D(0.25, 0.12, 2.0))
    path = serpentine(range(8), range(9))
    world.follow(path)
    run(world)
    assert world.activity is Activity.IDLE
    assert world.collisions == 0
    track = world.track
    assert distances_to(track, path).max() < 0.03
    on_the_path = track[np.flatnonzero(distances_to(path, track) < 1e-6)[0] :]
    assert distances_to(path, on_the_path).max() < 0.03
    length = np.hypot(*np.diff(path, axis=0).T).sum()
    assert world.distance_m == pytest.approx(length, abs=0.15)
    assert np.hypot(*np.diff(track, axis=0).T).sum() == pytest.approx(world.distance_m, abs=0.01)


def test_a_robot_stops_before_a_wall_that_its_path_leads_through():
    config = SimulationConfig()
    world = started(building(6, 2, (3.0, 0.0, 3.1, 2.0)), Pose2D(1.0, 1.0), config)
    through = centres(*[(2, col) for col in range(2, 12)])
    world.follow(through)
    run(world)
    assert world.activity is Activity.STOPPED
    # It looks once for another way, and comes to rest there again.
    ticks(world, 600)
    assert world.activity is Activity.STOPPED
    assert (world.stops, world.collisions) == (2, 0)
    assert 3.0 - config.hull_radius_m - 0.01 < world.pose.x <= 3.0 - config.hull_radius_m + 1e-9
    # Another path takes it away again.
    world.follow(through[3::-1])
    run(world)
    assert world.activity is Activity.IDLE
    assert (world.stops, world.collisions) == (2, 0)
    assert world.longest_stand_s > 1.0
    assert world.pose.x == pytest.approx(1.0, abs=0.01)


def test_a_robot_that_just_missed_a_corner_detours_and_arrives():
    config = SimulationConfig()
    hull_m, corner = config.hull_radius_m, (3.0, 1.0)
    world = started(building(6, 3, (*corner, 3.1, 3.0)), Pose2D(1.0, 0.6), config)
    # Past the corner, by less than what a look every half pixel makes sure of.
    y = corner[1] - hull_m + 0.0004
    path = np.array([(1.0, 0.6), (1.6, 0.6), (5.0, 0.6)])
    world.follow(path)
    run(world, 100)
    world._corners = [(5.0, 0.6), (3.4, y), (2.0, y)]
    run(world)
    assert world.activity is Activity.STOPPED
    ticks(world, 2000)
    assert world.activity is Activity.IDLE
    assert (world.stops, world.collisions) == (1, 0)
    assert world.longest_stand_s < 1.0
    assert world.pose.x == pytest.approx(5.0, abs=0.01)


def test_a_robot_that_is_pushed_into_a_wall_collides():
    world = started(building(6, 2, (3.0, 0.0, 3.1, 2.0)), Pose2D(2.5, 1.0))
    for _ in range(200):
        world.move(0.2, 0.0)
        world.tick()
    assert world.stops == 0
    assert world.collisions >= 1
    assert world.activity is Activity.COLLIDED


def test_a_robot_that_is_pushed_along_a_wall_slides():
    world = started(building(6, 2), Pose2D(1.0, 0.3, -0.3))
    for _ in range(400):
        world.move(0.2, 0.0)
        world.tick()
    assert world.activity is Activity.COLLIDED
    assert world.collisions == 1
    assert world.pose.x > 1.8
    assert world.pose.yaw == -0.3


def test_a_new_path_along_the_old_one_is_joined_without_a_stop():
    world = started(building(8, 4), Pose2D(1.0, 1.0))
    lane = centres(*[(2, col) for col in range(2, 18)])
    world.follow(lane)
    run(world, 300)
    before = world.distance_m
    world.follow(lane[3:])
    run(world, 100)
    assert world.distance_m - before == pytest.approx(100 * 0.02 * 0.25, rel=1e-6)
    # An empty path halts it.
    world.follow(np.empty((0, 2)))
    assert world.activity is Activity.IDLE
    ticks(world, 50)
    halted = world.pose
    ticks(world, 50)
    assert world.pose == halted


def test_a_new_path_that_turns_off_behind_is_fetched():
    world = started(building(8, 4), Pose2D(1.0, 1.0))
    world.follow(centres(*[(2, col) for col in range(2, 18)]))
    run(world, 400)
    behind = int(world.pose.x / 0.4)
    off = centres((2, behind), *[(row, behind) for row in range(3, 8)])
    world.follow(off)
    run(world)
    assert world.activity is Activity.IDLE
    assert world.collisions == 0
    assert distances_to(world.track, off).max() < 0.03


def test_a_path_that_starts_metres_behind_is_joined_at_the_robot():
    world = started(building(8, 4), Pose2D(1.0, 1.0))
    path = np.array([(1.0, 1.0), (3.0, 1.0), (3.0, 2.0), (7.0, 2.0)])
    world.follow(path)
    run(world, 1400)
    x, y = world.pose.x, world.pose.y
    assert x > 4.5
    assert y == pytest.approx(2.0, abs=0.01)
    driven = len(world.track)
    # It was under way for so long that it begins more than 4 m behind the robot.
    world.follow(np.vstack((path, [(7.0, 1.0)])))
    run(world)
    assert world.track[driven:, 0].min() > x - 0.1, "it does not turn back"
    assert world.activity is Activity.IDLE
    assert (world.pose.x, world.pose.y) == pytest.approx((7.0, 1.0), abs=0.01)


def test_without_a_clear_way_it_waits_with_that_activity():
    world = World(building(8, 4, (3.0, 0.0, 3.1, 4.0)), Pose2D(1.0, 1.0), SimulationConfig())
    # Before the first scan nothing is clear.
    world.follow(centres((2, 2), (2, 3)))
    assert world.activity is Activity.NO_WAY
    world.tick()
    assert world.activity is Activity.DRIVING
    world.follow(centres((2, 12), (2, 13)))
    ticks(world, 100)
    assert world.activity is Activity.NO_WAY
    assert world.pose.x == pytest.approx(1.0, abs=0.01)


def test_map_and_pose_come_at_their_rates_with_simulated_stamps():
    world = World(building(8, 4), Pose2D(1.0, 1.0), SimulationConfig(map_hz=4.0, pose_hz=10.0))
    emissions = ticks(world, 500)
    maps = [emission.map.stamp_ns for emission in emissions if emission.map is not None]
    poses = [emission.pose.stamp_ns for emission in emissions if emission.pose is not None]
    assert len(poses) == 100
    assert set(np.diff(poses)) == {100_000_000}
    assert maps[0] == poses[0] == 20_000_000
    assert len(maps) == pytest.approx(40, abs=2)
    assert world.stamp_ns == 10_000_000_000


def test_two_runs_are_equal_bit_for_bit():
    def once():
        world = started(building(6, 4, (2.4, 1.6, 2.8, 2.0)), Pose2D(0.63, 0.71, 0.4))
        world.follow(serpentine(range(1, 3), range(1, 13)))
        emissions = run(world, 2000)
        world.follow(serpentine(range(2, 7), range(1, 5)))
        emissions += run(world)
        return world, emissions

    (one, ones), (other, others) = once(), once()
    assert one.track.tobytes() == other.track.tobytes()
    assert [emission.pose for emission in ones] == [emission.pose for emission in others]
    maps = [(a.map, b.map) for a, b in zip(ones, others, strict=True) if a.map is not None]
    assert len(maps) > 20
    assert all(a.geometry == b.geometry for a, b in maps)
    assert all(a.cells.tobytes() == b.cells.tobytes() for a, b in maps)


def test_an_impossible_start_is_an_error():
    truth = building(4, 4, (2.0, 2.0, 2.5, 2.5))
    with pytest.raises(StartOutsideMap):
        World(truth, Pose2D(9.0, 1.0), SimulationConfig())
    with pytest.raises(StartBlocked):
        World(truth, Pose2D(1.9, 2.2), SimulationConfig())


def test_the_battery_drains_on_the_way_and_charges_at_the_start():
    config = SimulationConfig(battery_min=1.0)
    world = started(building(6, 2), Pose2D(0.6, 1.0), config)
    world.follow(centres((2, 1), (2, 9)))
    heard = [each.battery for each in run(world) if each.battery is not None]
    drove_s = 1e-9 * world.stamp_ns
    assert world.battery.level == pytest.approx(1 - drove_s / 60, abs=0.01)
    assert len(heard) == pytest.approx(drove_s, abs=1.5)
    world.follow(centres((2, 9), (2, 1)))
    run(world)
    empty = world.battery.lowest
    assert not world.battery.is_charging or world.battery.level > empty
    ticks(world, 50)
    assert world.battery.is_charging
    assert world.battery.level == pytest.approx(empty + 4 * 50 * config.tick_s / 60, abs=0.01)


def test_with_an_empty_battery_it_stands():
    world = started(building(6, 2), Pose2D(0.6, 1.0), SimulationConfig(battery_min=0.1))
    world.follow(centres((2, 1), (2, 12)))
    run(world)
    assert world.battery.level == 0.0
    assert world.distance_m < 2.0
