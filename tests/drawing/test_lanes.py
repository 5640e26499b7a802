"""A walk drawn to the right of itself."""

import numpy as np
import pytest

from fasaco_edge.drawing.pictures import arrow_places, directions, in_pieces, lanes


def walk(*points):
    return np.array(points, np.float64)


def joined(starts, ends):
    np.testing.assert_allclose(starts[1:], ends[:-1])
    return np.vstack([starts[:1], ends]).tolist()


@pytest.mark.parametrize(("north", "corner"), [(1, [1.25, -0.25]), (-1, [0.75, -0.25])])
def test_lanes_meet_beside_a_corner(north, corner):
    line = joined(*lanes(walk((0, 0), (1, 0), (1, north)), 0.25))
    assert line[1] == corner


def test_there_and_back_are_two_lanes_joined_beyond_the_end():
    line = joined(*lanes(walk((0, 0), (1, 0), (0, 0)), 0.25))
    assert line == [[0, -0.25], [1.25, -0.25], [1.25, 0.25], [0, 0.25]]


def test_arrows_stand_on_straight_stretches():
    points = walk(*[(x, 0) for x in range(10)], (9, 1), (8, 1), (8, 2))
    places = arrow_places(points, 4.0)
    assert len(places) == 2
    assert places.max() < 9
    assert len(arrow_places(walk((0, 0), (1, 0), (1, 1), (2, 1)), 0.5)) == 0


def test_lanes_of_any_angle_stay_as_far_beside_the_line():
    points = walk((0, 0), (4, 0), (6, 3), (7, 2), (8, -3), (9, -3.01))
    starts, ends = lanes(points, 0.25)
    joined(starts, ends)
    for (ax, ay), way, start, end in zip(
        points[:-1], directions(points), starts, ends, strict=True
    ):
        for x, y in (start, end):
            assert way[0] * (y - ay) - way[1] * (x - ax) == pytest.approx(-0.25)


def test_a_line_is_divided_evenly_where_it_is_long():
    line = in_pieces(walk((0, 0), (3, 4), (3, 4.9), (3, 4.9)), 1.0)
    assert line[:6].tolist() == pytest.approx(np.linspace((0, 0), (3, 4), 6))
    assert line[6:].tolist() == [[3, 4.9], [3, 4.9]]
    assert in_pieces(walk((3, 4)), 1.0).tolist() == [[3, 4]]
