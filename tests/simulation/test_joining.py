"""Where a robot under way takes up a new path."""

from itertools import pairwise

import numpy as np

from fasaco_edge.simulation.robot import joined, passed_waypoints
from tests.simulation.rooms import CELL, centres


def clear(_start, _end):
    return True


def track(*corners):
    """A track over some corners, a point every 2 cm."""
    points = [np.asarray(corners[0], float)[np.newaxis]]
    for begin, end in pairwise(corners):
        count = max(1, round(np.hypot(*np.subtract(end, begin)) / 0.02))
        points.append(np.linspace(begin, end, count + 1)[1:])
    return np.vstack(points)


def at(row, col):
    return tuple(centres((row, col))[0])


def points(*cells):
    return np.round(centres(*cells), 6).tolist()


def route(path, came, is_clear=clear):
    found = joined(path, came, is_clear)
    return None if found is None else np.round(found, 6).tolist()


def test_waypoints_passed_on_the_way_are_left_out():
    path = centres((0, 0), (0, 1), (0, 2), (1, 2))
    x, y = at(0, 1)
    assert route(path, track(at(0, 0), (x + 0.13, y))) == points((0, 2), (1, 2))
    assert route(path, track(at(0, 0), (x, y))) == points((0, 2), (1, 2))
    assert route(path, track(at(0, 0), at(0, 2), at(1, 2))) == []
    assert route(centres((3, 3)), track(at(0, 0))) == points((3, 3))
    assert route(np.empty((0, 2)), track((1.0, 1.0))) == []


def test_a_dead_end_is_not_skipped_because_the_way_back_is_here():
    x, y = at(0, 1)
    into_and_back = centres((0, 1), (0, 0), (0, 1), (0, 2), (1, 2))
    # On the way to the dead end, a little short of the first waypoint.
    assert route(into_and_back, track(at(0, 2), (x + 0.05, y)))[0] == points((0, 0))[0]
    # It had been here some time before, on the way out.
    before = track((x, y), at(0, 2), (x + 0.05, y))
    assert route(into_and_back, before)[0] == points((0, 0))[0]


def test_only_the_latest_visit_to_the_first_waypoint_counts():
    path = centres((0, 0), (0, 1), (0, 2))
    assert passed_waypoints(path, track(at(0, 0), at(0, 2))) == 3
    assert passed_waypoints(path, track(at(0, 0), at(0, 2), at(0, 0))) == 1
    assert passed_waypoints(path, track(at(0, 2), at(0, 1))) == 0
    # In order: the way from the second to the first is not the way there.
    assert passed_waypoints(path, track(at(0, 1), at(0, 0))) == 1


def test_without_a_clear_way_it_drives_back_along_its_track():
    path = centres((0, 0), (0, 1))
    came = track(at(1, 0), at(1, 1), at(1, 2), at(2, 2))

    def only_from_the_corner(start, end):
        return np.allclose(start, at(1, 1)) and np.allclose(end, at(0, 0))

    assert route(path, came, only_from_the_corner) == points((1, 2), (1, 1), (0, 0), (0, 1))
    assert route(path, came, lambda _start, _end: False) is None


def test_as_a_last_resort_waypoints_are_skipped():
    path = centres((0, 0), (0, 1), (0, 2), (0, 3), *[(0, col) for col in range(4, 20)])

    def no_way_to_the_first(_start, end):
        return end[0] > CELL

    assert route(path, track(at(1, 0)), no_way_to_the_first) == points((0, 1), (0, 19))

    def no_way_to_the_first_metres(_start, end):
        return end[0] > 3.0

    assert route(path, track(at(1, 0)), no_way_to_the_first_metres) is None
