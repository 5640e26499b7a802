"""Points of a line and the cells of its walk that they stand for."""

import itertools

import numpy as np
import pytest

from fasaco_edge.mission.line.place_on_line import aligned, by_distance


def stands(*places):
    return np.array(places, float)


LANES = stands(*[(0, x) for x in range(10)], *[(1, x) for x in range(9, -1, -1)])


def test_points_beside_their_stands_find_them():
    points = LANES[[0, 4, 9, 10, 17, 19]] + 0.2
    assert aligned(points, LANES).tolist() == [0, 4, 9, 10, 17, 19]


def test_a_lane_in_place_of_two_stands_for_both_in_order():
    points = stands((0, 0), (0.5, 9), (0.5, 4), (1, 0))
    found = aligned(points, LANES).tolist()
    assert found == sorted(found)
    assert found[1] in (9, 10)
    assert found[2] == 15


@pytest.mark.parametrize("seed", range(30))
def test_the_sum_of_squared_distances_is_the_least(seed):
    rng = np.random.default_rng(seed)
    count, cells = int(rng.integers(2, 5)), int(rng.integers(1, 6))
    points, places = rng.random((count, 2)), rng.random((cells, 2))
    inner = itertools.combinations_with_replacement(range(cells), count - 2)
    orders = [np.array([0, *order, cells - 1]) for order in inner]

    def apart(order):
        return ((points - places[order]) ** 2)[1:].sum()

    assert apart(aligned(points, places)) == pytest.approx(min(map(apart, orders)))


def test_a_cell_without_a_stand_gets_no_point():
    places = LANES[:10].copy()
    places[3:6] = np.nan
    assert aligned(LANES[[0, 4, 9]], places)[1] in (2, 6)
    nearest = by_distance(LANES[4], places).tolist()
    assert nearest[:2] == [2, 6]
    assert nearest[-3:] == [3, 4, 5]
