"""A line put together of pieces of the one before, and of stands between them."""

import itertools
from itertools import pairwise

import numpy as np
import pytest

from fasaco_edge.mission.line.pieces import Joiner, Piece, kept_pieces
from fasaco_edge.mission.line.place_on_line import aligned, by_distance
from fasaco_edge.mission.line.polyline import POLISHED, RAW, Polyline


def cells(*places):
    return np.array(places, np.int32)


def lane(row, cols):
    return [(row, col) for col in cols]


BEFORE = cells(*lane(0, range(20)), *lane(1, range(19, -1, -1)))


def stand(cell):
    return 10.0 * np.asarray(cell, float)


def over(walk):
    return 10.0 * walk.astype(float), np.arange(len(walk))


def polished(walk):
    """Return a line a little beside the stands."""
    points, numbers = over(walk)
    return Polyline(points + np.array((0.5, 0.0)), numbers, np.full(len(walk), POLISHED, np.uint8))


def no_way(a, b):
    return np.empty((0, 2))


def join(walk, pieces, is_clear=lambda a, b: True, *, here=None, over=over, way=no_way):
    if here is None:
        here = Polyline(stand(walk[0])[None], np.array([0]), np.array([POLISHED], np.uint8))
    return Joiner(here, walk, 0, stand, over, is_clear, lambda cell: False, way).joined(pieces)


def whole(pieces):
    return pieces[0].line.joined(*(piece.line for piece in pieces[1:]))


def test_the_same_walk_keeps_the_line():
    line = polished(BEFORE)
    pieces = join(BEFORE, kept_pieces(line, BEFORE, BEFORE))
    assert (pieces[0].begin, len(pieces[0].line)) == (0, len(BEFORE) - 1)
    found = whole(pieces)
    assert (found.points[:-1] == line.points[:-1]).all()
    assert (found.cells == np.arange(len(BEFORE))).all()


def test_a_short_piece_just_ahead_of_the_robot_is_kept():
    """Where the walk changed within eight cells, the line began with stands all anew."""
    line = polished(BEFORE)
    after = cells(*lane(0, range(4)), *lane(1, range(3, -1, -1)))
    found = whole(join(after, kept_pieces(line, BEFORE, after)))
    assert (found.points[:3] == line.points[:3]).all()
    assert (found.points[3:] == stand(after[3:])).all()


def test_a_detour_between_pieces_goes_over_stands():
    detour = cells(*lane(0, range(10)), (1, 9), (2, 9), (2, 10), (1, 10), *lane(0, range(10, 20)))
    after = cells(*detour.tolist(), *lane(1, range(19, -1, -1)))
    line = polished(BEFORE)
    kept = kept_pieces(line, BEFORE, after)
    found = whole(join(after, kept))
    assert (np.diff(found.cells) >= 0).all()
    raw = found.points[found.state == RAW]
    assert {(20.0, 90.0), (20.0, 100.0)} <= set(map(tuple, raw.tolist()))
    assert np.count_nonzero(found.state == POLISHED) > 30
    for piece in kept:
        assert (piece.line.points == line.points[piece.begin :][: len(piece.line)]).all()


def test_a_part_driven_the_other_way_is_kept_backward():
    after = cells(*lane(0, range(5)), *lane(1, range(4, 20)), *lane(0, range(19, 4, -1)))
    line = polished(BEFORE)
    pieces = join(after, kept_pieces(line, BEFORE, after))
    found = whole(pieces)
    turned = [piece for piece in pieces if piece.backward]
    assert len(turned) == 1
    for piece in turned:
        there = line.points[piece.begin :][: len(piece.line)]
        assert (piece.line.points == there[::-1]).all()
    assert (np.diff(found.cells) >= 0).all()
    at = np.rint(found.points / 10.0 - np.array((0.05, 0.0))).astype(int)
    assert (at == after[found.cells]).all()


@pytest.mark.parametrize("seed", range(6))
def test_no_joint_leads_where_it_is_not_clear(seed):
    rng = np.random.default_rng(seed)
    walls = rng.random((60, 210)) < 0.02

    def is_clear(a, b):
        ways = np.linspace(a, b, 40)
        return not walls[tuple(np.rint(ways).astype(int).T)].any()

    order = rng.permutation(2)
    lanes = [lane(0, range(20)), lane(1, range(19, -1, -1))]
    after = cells(*lanes[order[0]], *lanes[order[1]])
    line = polished(BEFORE)
    pieces = join(after, kept_pieces(line, BEFORE, after), is_clear)
    for piece, behind in pairwise(pieces):
        if behind.begin >= 0:
            assert is_clear(piece.line.points[-1], behind.line.points[0])
    found = whole(pieces)
    assert (np.hypot(*np.diff(found.points, axis=0).T) >= 0.3).all()
    assert (np.diff(found.cells) >= 0).all()


def test_a_stand_is_left_out_only_if_the_way_past_it_is_clear():
    walk = cells(*lane(0, range(6)), (1, 5), (2, 5))
    line = polished(walk).part(0, 5)
    # All but where one stands in the last cell.
    line.points[4] = stand((0, 4)) + np.array((0.2, 0.0))
    beside = tuple(line.points[4].tolist())
    here = polished(walk[:1])
    blocked = {beside, tuple(stand((0, 5)).tolist())}

    def is_clear(a, b):
        return {tuple(a.tolist()), tuple(b.tolist())} != blocked

    found = whole(join(walk, [Piece(line, 0)], is_clear, here=here))
    ways = pairwise(found.points)
    assert all(is_clear(a, b) for a, b in ways)
    assert found.points[-1].tolist() == stand((2, 5)).tolist()


def test_pieces_without_a_stand_between_them_are_joined():
    walk = cells(*lane(0, range(6)))
    line = polished(walk)

    def without_corners(part):
        # Of a straight walk its ends are left.
        points, numbers = over(part)
        return points[[0, -1]][1:], numbers[[0, -1]][1:]

    here = polished(walk[:1])
    pieces = [Piece(line.part(0, 2), 0), Piece(line.part(4, 6), 4)]
    assert whole(join(walk, pieces, here=here, over=without_corners)).cells.tolist()[:4] == [
        0,
        1,
        4,
        5,
    ]


def test_a_walk_of_one_cell_is_a_line_of_one_stand():
    walk = cells((0, 0))
    here = polished(walk)
    # Not even its own stand can be driven to from where the robot is.
    assert whole(join(walk, [], lambda a, b: False, here=here)).points.tolist() == [[0.0, 0.0]]


def test_behind_a_pillar_the_line_begins_with_the_way_round_it():
    walk = cells(*lane(0, range(6)))
    here = Polyline(np.array([[-9.0, 0.0]]), np.array([0]), np.array([POLISHED], np.uint8))

    def is_clear(a, b):  # the robot's place sees a corner alone
        return (a != here.points[0]).any()

    line = whole(join(walk, [], is_clear, here=here, way=lambda a, b: a[None] + (0.0, -5.0)))
    assert line.points[:3].tolist() == [[-9.0, 0.0], [-9.0, -5.0], [0.0, 0.0]]
    assert line.cells[:3].tolist() == [0, 0, 0]
    assert (line.points[2:] == stand(walk)).all()


# Points of a line and the cells of its walk that they stand for.


def stands(*places):
    return np.array(places, float)


LANES = stands(*[(0, x) for x in range(10)], *[(1, x) for x in range(9, -1, -1)])


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
