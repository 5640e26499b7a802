"""The lab's base and mapper, in a hall."""

import math

import numpy as np
import pytest

from fasaco_edge.follow.estimate import VelocityCommand

pytest.importorskip("karto_scanmatcher", reason="needs the extra 'lab'")
pytestmark = pytest.mark.filterwarnings("default")


@pytest.fixture(scope="module", autouse=True)
def _simulator():
    pytest.importorskip("irsim", reason="needs the extra 'lab'")


def base_in(length_m=4.0, width_m=1.0, yaw=0.0, **settings):
    from tests.campaigns.lab.base import Base
    from tests.campaigns.lab.halls import hall
    from tests.campaigns.lab.settings import LabSettings

    building = hall(length_m, width_m, yaw)
    return building, Base(building, LabSettings(**settings))


def apart(a, b):
    return math.hypot(a.x - b.x, a.y - b.y)


def test_an_ideal_base_has_exact_odometry_and_stops_uncommanded():
    _, base = base_in(ideal=True)
    for _ in range(40):
        base.command(VelocityCommand(0.3, 0.0))
        base.tick()
    assert base.wheels.speed == pytest.approx(0.3)
    assert apart(base.truth, base.odometry) < 1e-9
    for _ in range(30):
        base.tick()
    # 2 s with commands, 0.5 s without until it brakes; as long as it takes to speed up and brake.
    assert base.wheels.speed == 0.0
    assert base.truth.x == pytest.approx(0.5 + 0.3 * 2.5, abs=0.03)


def test_wheels_slip_and_odometry_drifts():
    _, base = base_in(length_m=20.0)
    for _ in range(800):
        base.command(VelocityCommand(0.3, 0.0))
        base.tick()
    grips = base.odometry.x - base.truth.x
    assert 0.02 < grips < 1.0
    assert base.odometry.yaw != base.truth.yaw


def test_it_scans_walls_and_touches_them():
    _, base = base_in(ideal=True, noise_m=0.0)
    ranges = base.scan()
    middle = len(ranges) // 2
    assert ranges[middle] == pytest.approx(3.5, abs=0.01)
    assert ranges[0] == pytest.approx(0.5, abs=0.01)
    assert ranges[middle + middle // 2] == pytest.approx(0.5, abs=0.01)
    for _ in range(300):
        base.command(VelocityCommand(0.5, 0.0))
        base.tick()
    assert base.touches
    assert base.truth.x == pytest.approx(4.0 - 0.17, abs=0.01)


def test_people_walk_about_in_the_middle():
    _, base = base_in(6.0, 6.0, people=2)
    base.tick()
    assert not base.touches


def test_the_mapper_corrects_odometry_and_draws_the_hall():
    from tests.campaigns.lab.mapper import Mapper

    _, base = base_in(3.0, 2.0)
    mapper = Mapper()
    for tick in range(1200):
        ahead, beside = 1.5 - base.truth.x, 1.0 - base.truth.y
        toward = math.atan2(beside, ahead) - base.truth.yaw
        # Around the middle, at some distance from it.
        bend = math.remainder(toward - math.pi / 2, math.tau)
        base.command(VelocityCommand(0.2, 2.0 * bend + 0.2))
        base.tick()
        if tick % 8 == 0 and mapper.wants(base.odometry):
            mapper.take(base.scan(), base.odometry)
    corrected = apart(mapper.corrected(base.odometry), base.truth)
    assert corrected < 0.08
    assert corrected < 0.5 * apart(base.odometry, base.truth)
    grid = mapper.map_due(base.now)
    assert grid is not None
    assert mapper.map_due(base.now) is None
    assert np.count_nonzero(grid.cells == 0) * 0.05**2 == pytest.approx(6.0, rel=0.1)
