"""A simulation's time as a follower takes it from its poses."""

import pytest

from fasaco_edge.follow.inputs import LEAD_S, Clock

SECOND = 1_000_000_000


def test_time_goes_as_the_simulation_does_and_never_back():
    """Twenty times the speed was asked for; the computer does five."""
    clock = Clock(20.0)
    times, begun = [], clock.take_stamp(0, 100.0)
    for pose in range(1, 101):
        at = 100.0 + 0.02 * pose
        times += [
            clock.at(at - 0.01),
            clock.at(at - 0.001),
            clock.take_stamp(pose * SECOND // 10, at),
        ]
        # Poses come at the times that they say.
        assert times[-1] - begun == pytest.approx(0.1 * pose)
    assert times == sorted(times)


def test_the_clock_runs_on_between_two_poses():
    clock = Clock(20.0)
    begun = clock.take_stamp(0, 100.0)
    assert clock.at(100.002) - begun == pytest.approx(0.04)
    assert clock.at(100.4) - begun == pytest.approx(LEAD_S)
    # Poses that stay away grow old, so that the robot is stopped.
    assert clock.at(103.0) - begun > 15.0
    # And where they come again, time goes on from there.
    later = clock.at(103.0)
    assert clock.take_stamp(SECOND // 10, 103.0) == later
    assert clock.take_stamp(2 * SECOND // 10, 103.01) >= later


def test_another_simulation_begins_where_the_last_one_was():
    clock = Clock(10.0)
    clock.take_stamp(50 * SECOND, 100.0)
    before = clock.take_stamp(51 * SECOND, 100.1)
    assert before == pytest.approx(clock.at(100.1))
    assert clock.take_stamp(0, 100.2) - before == pytest.approx(LEAD_S)
