"""Polygons on the lattice, against plain arithmetic cell by cell."""

import math

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.polygons import polygon_flaw
from fasaco_edge.mission.orders.zones import cells_inside, counts_in, near_polygons, without
from tests import naive
from tests.mission import world
from tests.support.examples import examples

CELL_M = 0.3
# Of ten cells by ten, some of them beyond the origin.
WINDOW = Window(-3, -2, 7, 8)
ALL_CELLS = world.cells(-3, -2, 7, 8)

points = st.tuples(st.integers(-12, 30), st.integers(-12, 30)).map(
    lambda point: (point[0] / 10 + 0.00311, point[1] / 10 - 0.00717)
)
polygons = st.lists(points, min_size=3, max_size=7).map(tuple)


def centre(row, col):
    return (col + 0.5) * CELL_M, (row + 0.5) * CELL_M


def is_inside(point, polygon):
    """Whether the angles to the corners add up to a full turn."""
    turn = 0.0
    for here, there in zip(polygon, (*polygon[1:], polygon[0]), strict=True):
        first = math.atan2(here[1] - point[1], here[0] - point[0])
        second = math.atan2(there[1] - point[1], there[0] - point[0])
        turn += (second - first + math.pi) % (2 * math.pi) - math.pi
    return abs(turn) > math.pi


def comes_near(point, polygon, reach):
    """Whether some of many points along the border lies in the square around ``point``."""
    for (x0, y0), (x1, y1) in zip(polygon, (*polygon[1:], polygon[0]), strict=True):
        steps = math.ceil(math.hypot(x1 - x0, y1 - y0) / 0.002)
        along = np.linspace(0, 1, steps + 1)
        x, y = x0 + along * (x1 - x0), y0 + along * (y1 - y0)
        if ((abs(x - point[0]) < reach) & (abs(y - point[1]) < reach)).any():
            return True
    return is_inside(point, polygon)


def cells(mask):
    return {(int(r) + WINDOW.row0, int(c) + WINDOW.col0) for r, c in np.argwhere(mask)}


@examples(150)
@given(polygons)
def test_a_zone_holds_the_cells_whose_centre_it_holds(polygon):
    assume(not polygon_flaw(polygon))
    expected = {cell for cell in ALL_CELLS if is_inside(centre(*cell), polygon)}
    assert cells(cells_inside(polygon, WINDOW, CELL_M)) == expected
    backwards = cells_inside(polygon[::-1], WINDOW, CELL_M)
    assert cells(backwards) == expected


@examples(80)
@given(polygons, st.sampled_from([0.15, 0.18, 0.4]))
def test_near_is_what_the_polygon_touches(polygon, reach):
    assume(not polygon_flaw(polygon))
    near = cells(near_polygons((polygon,), WINDOW, CELL_M, reach))
    sure = {cell for cell in ALL_CELLS if comes_near(centre(*cell), polygon, reach - 0.004)}
    possible = {cell for cell in ALL_CELLS if comes_near(centre(*cell), polygon, reach + 0.004)}
    assert sure <= near <= possible


@examples(40)
@given(polygons, st.sampled_from([0.18, 0.4]))
def test_a_robot_touches_no_keep_out_zone_on_its_way(polygon, radius):
    assume(not polygon_flaw(polygon))
    free = CoverageLattice.from_free(np.ones((WINDOW.rows, WINDOW.cols), bool), CELL_M)
    free = CoverageLattice(WINDOW, CELL_M, free.states.copy(), free.steps.copy())
    lattice = without(free, near_polygons((polygon,), WINDOW, CELL_M, radius))
    border = [
        (x0 + t * (x1 - x0), y0 + t * (y1 - y0))
        for (x0, y0), (x1, y1) in zip(polygon, (*polygon[1:], polygon[0]), strict=True)
        for t in np.linspace(0, 1, 60)
    ]
    xs, ys = np.array(border).T
    for here, around in naive.neighbours(lattice.steps).items():
        for there in around.values():
            ends = [centre(r + WINDOW.row0, c + WINDOW.col0) for r, c in (here, there)]
            for t in np.linspace(0, 1, 5):
                x, y = (a + t * (b - a) for a, b in zip(*ends, strict=True))
                assert np.hypot(xs - x, ys - y).min() > radius - 1e-6
                assert not is_inside((x, y), polygon)


def test_a_polygon_far_away_or_around_everything():
    far = ((1e5, 1e5), (1e6, 1e5), (1e6, 1e6))
    around = ((-1e6, -1e6), (1e6, -1e6), (1e6, 1e6), (-1e6, 1e6))
    for count in (cells_inside, lambda polygon, *args: near_polygons((polygon,), *args, 0.15)):
        assert not count(far, WINDOW, CELL_M).any()
        assert count(around, WINDOW, CELL_M).all()
    assert cells_inside(around, Window(0, 0, 0, 3), CELL_M).shape == (0, 3)
    assert near_polygons((around,), Window(0, 0, 3, 0), CELL_M, 0.15).shape == (3, 0)


def test_a_sliver_between_centres_is_no_zone_but_keeps_out():
    sliver = ((0.0, 0.31), (2.0, 0.31), (2.0, 0.32), (0.0, 0.32))
    assert not cells_inside(sliver, WINDOW, CELL_M).any()
    assert cells(near_polygons((sliver,), WINDOW, CELL_M, 0.15)) == {(1, col) for col in range(7)}


def brute_crossing(polygon):
    """Whether two edges that are no neighbours meet, or neighbours lie on each other."""
    edges = list(zip(polygon, (*polygon[1:], polygon[0]), strict=True))

    def side(a, b, c):
        value = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        return (value > 0) - (value < 0)

    def between(a, b, c):
        return min(a[0], b[0]) <= c[0] <= max(a[0], b[0]) and (
            min(a[1], b[1]) <= c[1] <= max(a[1], b[1])
        )

    for i, (a, b) in enumerate(edges):
        for j, (c, d) in enumerate(edges):
            if (j - i) % len(edges) in (0, 1, len(edges) - 1):
                continue
            sides = side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b)
            if sides[0] * sides[1] < 0 and sides[2] * sides[3] < 0:
                return True
            ends = ((a, b, c), (a, b, d), (c, d, a), (c, d, b))
            if any(not s and between(*end) for s, end in zip(sides, ends, strict=True)):
                return True
        c = edges[(i + 1) % len(edges)][1]
        if not side(a, b, c) and (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]) < 0:
            return True
    return False


small = st.tuples(st.integers(0, 4), st.integers(0, 4)).map(lambda p: (float(p[0]), float(p[1])))


@examples(400)
@given(st.lists(small, min_size=3, max_size=7).map(tuple))
def test_polygons_that_cross_or_touch_themselves_are_refused(polygon):
    said = polygon_flaw(polygon)
    assume("twice in a row" not in said)
    assume("repeat its first" not in said)
    assert ("crosses" in said) == brute_crossing(polygon)
    if not said:
        twice = sum(
            x0 * y1 - x1 * y0
            for (x0, y0), (x1, y1) in zip(polygon, (*polygon[1:], polygon[0]), strict=True)
        )
        assert twice != 0


def test_steps_to_cells_taken_away_are_gone():
    free = CoverageLattice.from_free(np.ones((3, 4), bool))
    gone = np.zeros((3, 4), bool)
    assert without(free, gone) is free
    gone[1, 2] = True
    left = ~gone
    lattice, expected = without(free, gone), CoverageLattice.from_free(left)
    assert np.array_equal(lattice.states, expected.states)
    assert np.array_equal(lattice.steps, expected.steps)
    assert free.states.all()


@examples(100)
@given(st.lists(polygons, max_size=4).map(tuple), st.integers(0, 2**32))
def test_cells_in_many_polygons_are_counted_as_in_each(zones, seed):
    marked = np.random.default_rng(seed).random((WINDOW.rows, WINDOW.cols)) < 0.5
    expected = [int((cells_inside(zone, WINDOW, CELL_M) & marked).sum()) for zone in zones]
    assert counts_in(zones, WINDOW, CELL_M, marked) == expected
