"""The simulated robot on a real bus; a session in the test stands for the planner."""

import itertools
import signal
import subprocess
import threading
import time
import tracemalloc
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.cli import main
from fasaco_edge.errors import BusUnavailable
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.planners.grids import start_point
from fasaco_edge.simulation.node import Pace, run_simulation
from fasaco_edge.simulation.robot import SimulationConfig
from fasaco_edge.simulation.world import Activity, World
from fasaco_edge.wire import topics
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.base import Velocity, encode_velocity
from fasaco_edge.wire.messages.maps import decode_occupancy_grid
from fasaco_edge.wire.messages.paths import encode_path
from fasaco_edge.wire.messages.poses import decode_pose
from tests.simulation.rooms import building, centres, distances_to, serpentine
from tests.support.forked import ENVIRONMENT
from tests.support.processes import PROGRAM, free_endpoint
from tests.support.waiting import until


def new_world():
    return World(building(6.0, 4.0), Pose2D(1.0, 1.0), SimulationConfig())


class Planner:
    def __init__(self, robot):
        self.endpoint, self.keys = free_endpoint(), Keys(robot)
        self.maps, self.poses, self.reports = [], [], []
        self.bus = open_bus(BusSettings(mode="router", connect=(), listen=(self.endpoint,)))
        self.bus.listen(self.keys, topics.MAP, self.maps.append)
        self.bus.listen(self.keys, topics.POSE, self.poses.append)
        self._path = self.bus.advertise(self.keys, topics.PATH)

    def run(self, world, is_done, **options):
        settings, ends = BusSettings(connect=(self.endpoint,)), time.monotonic() + 60.0
        run_simulation(
            world, self.keys, settings, **options, report=self.reports.append,
            should_stop=lambda: is_done() or time.monotonic() > ends,
        )  # fmt: skip

    @property
    def refused(self):
        return self.reports[-1].refused if self.reports else 0

    def send(self, xy, frame="map"):
        self._path.put(encode_path(xy, np.zeros(len(xy)), frame, 1))

    def send_rubbish(self):
        self._path.put(b"\x00\x01\x00\x00rubbish")

    def pose(self):
        sample = self.poses[-1]
        return decode_pose(sample.payload, sample.schema)

    def map(self):
        return decode_occupancy_grid(self.maps[-1].payload)


@pytest.fixture
def planner():
    planner = Planner("r1")
    yield planner
    planner.bus.close()


def test_it_drives_along_a_path_and_ignores_bad_ones(planner):
    world, path = new_world(), serpentine(range(2, 6), range(2, 10))
    stages = [
        (lambda: world.stamp_ns > 0, planner.send_rubbish),
        (lambda: planner.refused == 1, lambda: planner.send(path, frame="odom")),
        (lambda: planner.refused == 2, lambda: planner.send(path)),
        (lambda: world.activity is Activity.DRIVING, lambda: None),
        (lambda: world.activity is Activity.IDLE, lambda: None),
    ]

    def finished():
        if stages and stages[0][0]():
            stages.pop(0)[1]()
        return not stages

    planner.run(world, finished, speed=20.0)
    assert stages == []
    # The last messages are the final state, and the map has grown.
    until(lambda: planner.pose().stamp_ns == planner.map().stamp_ns == world.stamp_ns)
    known = [
        np.count_nonzero(decode_occupancy_grid(each.payload).cells != -1)
        for each in (planner.maps[0], planner.maps[-1])
    ]
    assert known[0] < known[1]
    assert world.collisions == 0
    assert distances_to(world.track, np.vstack([world.track[:1], path])).max() < 0.03
    assert planner.refused == 2
    assert world.track[-1] == pytest.approx(path[-1], abs=2e-3)
    assert all(0.0 < report.speed < 40.0 for report in planner.reports[1:])


def test_velocities_drive_it_and_it_stops_by_itself_without_them(planner):
    world = new_world()
    velocities = planner.bus.advertise(planner.keys, topics.CMD_VEL)

    def driven():
        # A path is nothing to it, nor is what is no velocity.
        planner.send(centres((2, 2), (2, 5)))
        velocities.put(b"rubbish")
        velocities.put(encode_velocity(Velocity(99.0, 0.0)))
        return world.distance_m > 0.5

    planner.run(world, driven, driver="follow")
    driven_m, seconds = world.distance_m, 1e-9 * world.stamp_ns
    assert planner.refused > 0
    # No faster than it can.
    assert 0.5 < driven_m <= world.config.speed_m_s * seconds
    planner.run(world, lambda: 1e-9 * world.stamp_ns > seconds + 2.0, driver="follow")
    assert world.activity is Activity.IDLE
    # Half a second at full speed, and the way to rest.
    assert world.distance_m - driven_m < 0.25 * 0.55 + 0.25**2 / 1.0 + 0.01


def test_a_fast_robot_waits_for_what_drives_it(planner):
    """At forty times the speed the robot drives 1 m in 0.1 s, and is given the time for a command.

    Without that the robot drove on for half a second by each velocity, past its stops.
    """
    world, gone = new_world(), []
    velocities = planner.bus.advertise(planner.keys, topics.CMD_VEL)

    def told_ten_times():
        if not gone or world.stamp_ns > gone[-1]:
            time.sleep(0.1)
            gone.append(world.stamp_ns)
            velocities.put(encode_velocity(Velocity(0.25, 0.0)))
        return len(gone) >= 10 and world.distance_m > 0.0

    planner.run(world, told_ten_times, speed=40.0, driver="follow")
    moved_s = [(after - before) * 1e-9 for before, after in itertools.pairwise(gone)]
    assert max(moved_s[2:]) <= 0.13, moved_s
    # Nobody tells it any more: it goes on without, and comes to rest.
    ends_ns = world.stamp_ns + 2_000_000_000
    planner.run(world, lambda: world.stamp_ns > ends_ns, speed=40.0, driver="follow")
    assert world.activity is Activity.IDLE


def test_it_runs_outside_the_main_thread_without_signal_handlers(planner):
    before, world = signal.getsignal(signal.SIGTERM), new_world()
    run = partial(planner.run, world, lambda: world.stamp_ns >= 2_000_000_000, speed=10.0)
    thread = threading.Thread(target=run)
    thread.start()
    thread.join(20)
    assert not thread.is_alive()
    assert world.stamp_ns >= 2_000_000_000
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_simulation_without_a_bus_is_an_error():
    with pytest.raises(BusUnavailable):
        run_simulation(new_world(), Keys(), BusSettings(connect=("tcp/127.0.0.1:1",)))


def test_the_robot_is_that_of_the_configuration(tmp_path, monkeypatch):
    """On a map of one's own it begins where it fits: a corner of the walls is often at (0, 0)."""
    floor = np.full((40, 60), 255, np.uint8)
    floor[[0, -1], :] = floor[:, [0, -1]] = 0
    Image.fromarray(floor).save(tmp_path / "room.png")
    house = tmp_path / "room.yaml"
    house.write_text("{image: room.png, resolution: 0.1, origin: [0, 0, 0], negate: 0}")
    config = tmp_path / "robot.yaml"
    config.write_text("robot: {radius_m: 0.3, speed_m_s: 0.4, time_scale: 5}")
    started = []
    monkeypatch.setattr(
        "fasaco_edge.simulation.node.run_simulation",
        lambda world, *_, speed, **__: started.append((world, speed)),
    )
    for more in ([], ["--robot-radius", "0.2", "--speed", "2"]):
        assert main(["simulate", str(house), "--config", str(config), *more]) == 0
    sizes = [(world.config.robot_radius_m, world.config.speed_m_s) for world, _ in started]
    assert sizes == [(0.3, 0.4), (0.2, 0.4)]
    assert [speed for _, speed in started] == [5.0, 2.0]
    pose = started[0][0].pose
    assert 0.3 < pose.x < 1.0
    assert 0.3 < pose.y < 1.0


def test_a_start_on_a_large_map_takes_no_memory():
    """Distances of all pixels took 216 MB on a map of 25 million."""
    geometry = GridGeometry(2000, 2000, 0.05, Pose2D(-50.0, -50.0))
    hall = OccupancyGrid(geometry, np.zeros((2000, 2000), np.int8))
    tracemalloc.start()
    try:
        assert start_point(Path("hall.yaml"), hall, 0.18) == (0.0, 0.0)
        assert tracemalloc.get_traced_memory()[1] < 4e6
    finally:
        tracemalloc.stop()


def test_it_waits_for_a_bus_that_is_not_there_yet():
    """As the daemon and `follow` do: a bare base's manual starts the robot first."""
    endpoint, heard = free_endpoint(), threading.Event()
    words = [*PROGRAM, "simulate", "office", "--connect", endpoint]
    with subprocess.Popen(words, stderr=subprocess.PIPE, env=ENVIRONMENT) as robot:
        assert b"waiting for the bus at " + endpoint.encode() in robot.stderr.readline()
        with open_bus(BusSettings(mode="router", connect=(), listen=(endpoint,))) as bus:
            bus.listen(Keys(), topics.MAP, lambda _: heard.set())
            assert heard.wait(30.0)
            robot.terminate()
            assert robot.wait(30.0) == 0


def ticks_until(pace, begin_s, end_s, cost_s):
    now_s, count = begin_s, 0
    while now_s < end_s:
        if pace.behind_s(now_s) >= 0.0:
            pace.note_tick(now_s)
            now_s += cost_s
            count += 1
        else:
            now_s -= min(pace.behind_s(now_s), -1e-4)
    return count


def test_a_fast_machine_keeps_the_speed_and_a_slow_one_falls_behind():
    pace = Pace(20.0, 0.02, 100.0)
    assert ticks_until(pace, 100.0, 110.0, 1e-4) * 0.02 == pytest.approx(200.0, rel=0.01)
    pace = Pace(10.0, 0.02, 0.0)
    assert ticks_until(pace, 0.0, 10.0, 0.01) == pytest.approx(1000, abs=2)
    # 80 s of simulated time were lost; at most a tenth of a second's worth is made good.
    after = ticks_until(pace, 10.0, 12.0, 1e-5)
    assert after * 0.02 == pytest.approx(20.0 + 0.1 * 10.0, rel=0.02)
