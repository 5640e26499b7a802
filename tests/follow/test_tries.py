"""Tries count by place and direction; nothing but progress forgets them."""

import math

import pytest

from fasaco_edge.follow.standstill import Tries

HERE = (1.0, 2.0)


def tried(times, toward=0.0, **limits):
    tries = Tries(**{"far": 0.1, "pause": 2.0, "longest": 30.0} | limits)
    for _ in range(times):
        tries.failed(HERE, toward, 0.0)
    return tries


def pause_s(tries):
    """Return the seconds until the next try, to 0.1 s."""
    return next(tenth / 10 for tenth in range(10_000) if tries.may_try(0.0, tenth / 10))


def test_each_pause_is_twice_as_long_up_to_the_longest():
    assert [pause_s(tried(times)) for times in range(7)] == [0.0, 2.0, 4.0, 8.0, 16.0, 30.0, 30.0]
    assert pause_s(tried(5000)) == 30.0


def test_after_the_last_try_no_time_is_long_enough():
    tries = tried(3, most=3)
    assert not tries.may_try(0.0, 1e9)
    tries.moved_to((HERE[0] + 0.09, HERE[1]))
    assert not tries.may_try(0.0, 1e9)
    tries.moved_to((HERE[0] + 0.11, HERE[1]))
    assert tries.may_try(0.0, 0.0)
    assert tries.tries(0.0) == 0


def test_the_place_is_that_of_the_first_failure():
    """A robot that creeps on has made progress; one that rocks to and fro has not."""
    tries = tried(0)
    for step in range(10):
        x = 1.0 + 0.09 * (step % 2)
        tries.moved_to((x, 2.0))
        tries.failed((x, 2.0), 0.0, 0.0)
    assert tries.tries(0.0) == 10
    tries.moved_to((1.11, 2.0))
    assert tries.tries(0.0) == 0


@pytest.mark.parametrize("turn_deg", [-40, -10, 10, 40, 360])
def test_nearly_the_same_direction_is_the_same(turn_deg):
    tries = tried(3, most=3)
    assert not tries.may_try(math.radians(turn_deg), 1e9)


def test_another_direction_has_its_own_tries():
    tries = tried(3, most=3)
    assert tries.may_try(math.pi / 2, 0.0)
    tries.failed(HERE, math.pi / 2, 0.0)
    assert (tries.tries(math.pi / 2), tries.tries(0.0)) == (1, 3)


def test_directions_that_turn_on_and_on_are_bounded():
    tries, count = Tries(0.1, 2.0, math.inf, 3), 0
    for degree in range(0, 3600, 7):
        toward = math.radians(degree)
        while tries.may_try(0.0, 1e9):
            tries.failed(HERE, toward, 0.0)
            count += 1
            assert count <= 8 * 3
