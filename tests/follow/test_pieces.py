"""Pieces of paths, against their definition: all pairs of poses looked at."""

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fasaco_edge.follow.pieces import APART, LEAST_M, MOST_M, STEP_M, PathByLength, end_of_piece
from fasaco_edge.grid.geometry import Pose2D

NEAR = 0.225


def line_of(*points):
    return PathByLength(Pose2D(x, y) for x, y in points)


def pieces_of(line, near=NEAR):
    pieces, start = [], 0.0
    while start < line.length(1e6) - LEAST_M:
        end = end_of_piece(line, start, near)
        pieces.append((start, end))
        assert end > start
        start = end
    return pieces


def is_simple(line, start, end, near=NEAR):
    ways = line.ways(start, end)
    points = [line.at(way) for way in ways]
    return all(
        math.dist(points[i], points[j]) >= near
        for j in range(len(ways))
        for i in range(j)
        if ways[j] - ways[i] > APART * near + 1e-9
    )


@given(
    st.lists(
        st.tuples(st.integers(-8, 8), st.integers(-8, 8)).map(lambda p: (p[0] * 0.3, p[1] * 0.3)),
        min_size=2,
        max_size=12,
    )
)
@settings(deadline=None, max_examples=150)
def test_pieces_are_simple_and_leave_nothing_out(points):
    line = line_of(*points)
    pieces = pieces_of(line)
    whole = line.length(1e6)
    assert not pieces or (pieces[0][0] == 0.0 and abs(pieces[-1][1] - whole) <= LEAST_M)
    assert all(a[1] == b[0] for a, b in pairwise(pieces))
    for start, end in pieces:
        assert end - start <= MOST_M + 1e-9
        assert is_simple(line, start, end)
        ways = line.ways(start, end)
        assert max(b - a for a, b in pairwise(ways)) <= STEP_M + 1e-9


def test_lanes_beside_each_other_are_one_piece():
    lanes = [(0.0, 0.0), (4.0, 0.0), (4.0, 0.276), (0.0, 0.276), (0.0, 0.552), (4.0, 0.552)]
    line = line_of(*lanes)
    assert pieces_of(line) == [(0.0, pytest.approx(12.552))]


def test_a_piece_that_begins_later_may_be_longer():
    """Sent ahead: the crossed part is behind the robot by then."""
    line = line_of((0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (2.0, 2.0), (2.0, -2.0))
    first = end_of_piece(line, 0.0, NEAR)
    assert end_of_piece(line, first - 1.0, NEAR) == line.length(1e6)


def test_the_nearest_place_is_looked_for_between_two():
    line = line_of((0.0, 0.0), (3.0, 0.0), (0.0, 0.0))
    assert line.nearest((1.0, 0.1), 0.0, 3.0) == (pytest.approx(1.0), pytest.approx(0.1))
    assert line.nearest((1.0, 0.1), 3.0, 6.0) == (pytest.approx(5.0), pytest.approx(0.1))
    assert line.nearest((1.0, 0.0), 0.0, 6.0)[0] == pytest.approx(1.0)
