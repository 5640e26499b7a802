"""The floor under a map that changes is, after each change, that of the new map alone."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.errors import MapTooLarge
from fasaco_edge.grid import floor_map
from fasaco_edge.grid.changes import LatticeChange
from fasaco_edge.grid.fine_raster import RobotDiscs
from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.lattice import UNKNOWN, CoverageLattice, Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.kernels.floor.bits import unpacked
from tests.grid.test_floor import room
from tests.support.grids import cropped

FOOTPRINT = Footprint(cell_m=0.276, robot_radius_m=0.18)
DISCS = RobotDiscs(radius_m=0.18, tool_m=0.3)
PLENTY = 10**6


def over(grid, keep_out=()):
    plain = CoverageLattice.from_map(grid, FOOTPRINT)
    return FloorMap(grid, plain, FOOTPRINT, DISCS, PLENTY, keep_out)


def assert_same(found, expected):
    assert (found.geometry.rows, found.geometry.cols) == (
        expected.geometry.rows,
        expected.geometry.cols,
    )
    assert (found.blocked == expected.blocked).all()
    assert (found.places == expected.places).all()
    assert np.array_equal(found.stands.stands, expected.stands.stands, equal_nan=True)
    assert np.array_equal(found.stands.bends, expected.stands.bends, equal_nan=True)
    for name in ("window", "states", "steps"):
        now, anew = (getattr(each.stands.lattice, name) for each in (found, expected))
        assert np.array_equal(now, anew) if name != "window" else now == anew


def pixels_of(floor):
    """Return what is blocked, and where the robot may be, bool (2, rows, cols)."""
    return np.stack([unpacked(bits, floor.geometry.cols) for bits in (floor.blocked, floor.places)])


def assert_touched(floor, before):
    """What is not as it was before, on pixels that have moved, lies in the part touched."""
    after = pixels_of(floor)
    _, rows, cols = before.shape
    old, new = Window(0, 0, rows, cols).moved(*floor.shift), Window(0, 0, *after.shape[1:])
    beyond = np.stack([np.ones(after.shape[1:], np.bool_), np.zeros(after.shape[1:], np.bool_)])
    common = old.intersection(new)
    beyond[(slice(None), *common.slices_in(new))] = before[(slice(None), *common.slices_in(old))]
    different = (beyond != after).any(axis=0)
    if floor.touched is not None:
        different[floor.touched.slices_in(new)] = False
    assert not different.any()


@pytest.mark.parametrize(
    ("chunk", "clearance_m"), [(64, 0.0), (32, 0.0), (1, 0.0), (64, 0.03), (64, 0.4)]
)
@pytest.mark.parametrize("yaw", [0.0, 0.3])
def test_changes_lead_where_a_new_look_does(yaw, chunk, clearance_m, monkeypatch):
    monkeypatch.setattr(floor_map, "CHUNK", chunk)
    monkeypatch.setattr(f"{__name__}.DISCS", replace(DISCS, clearance_m=clearance_m))
    rng = np.random.default_rng(7)
    whole = room(6.0, 5.0, yaw)
    known = cropped(whole, 3, 4, 90, 99)
    floor, plain = over(known), CoverageLattice.from_map(known, FOOTPRINT)
    seen = 0
    for number in range(24):
        if number % 6 == 5:
            most = 8 if number % 4 else 35
            low, high = rng.integers(0, most, 2), rng.integers(0, most, 2)
            cells = whole.cells.copy()
            new = cropped(OccupancyGrid(whole.geometry, cells), *low, *(cells.shape - high))
        else:
            cells = known.cells.copy()
            for row, col in rng.integers(0, min(cells.shape), (int(rng.integers(1, 3)), 2)):
                size = rng.integers(1, 9, 2)
                cells[row : row + size[0], col : col + size[1]] = rng.choice([0, 50, 100, -1])
            new = OccupancyGrid(known.geometry, cells)
        before, pixels = floor.stands.lattice, pixels_of(floor)
        plain = LatticeChange.between((known, new), plain, FOOTPRINT).after
        change = floor.change((known, new), plain)
        assert_same(floor, over(new))
        assert_touched(floor, pixels)
        assert change.before is before
        assert change.after is floor.stands.lattice
        expected = LatticeChange.to(before, over(new).stands.lattice)
        assert (change.cells == expected.cells).all()
        seen += len(change.cells)
        known = new
    assert seen > 100


@pytest.mark.parametrize("cell_m", [0.276, 0.3])
def test_how_an_origin_is_rounded_makes_no_difference(cell_m):
    """As of a mapper that computes it anew for each map, about the edges of cells."""
    footprint = Footprint(cell_m, DISCS.radius_m)
    hairs = [0.0, 1e-17, -1e-17, 1e-9, -1e-9, 1e-6, -1e-6, 9e-6, -9e-6]
    for seed in range(60):
        rng = np.random.default_rng(seed)
        cells = np.zeros(rng.integers(20, 70, 2), np.int8)
        cells[rng.random(cells.shape) < 0.02] = 100
        edge, (rows, cols) = int(rng.integers(-3, 4)) * cell_m, cells.shape
        grids = []
        for hair in rng.choice(hairs, (2, 2)).tolist():
            origin = Pose2D(edge + hair[0], edge + hair[1], 0.0)
            grids.append(OccupancyGrid(GridGeometry(rows, cols, 0.05, origin), cells.copy()))
            if seed % 2:
                cells[rng.integers(rows), rng.integers(cols)] ^= 100
        plains = [CoverageLattice.from_map(grid, footprint) for grid in grids]
        if grids[0].geometry.on_raster() != grids[1].geometry.on_raster():
            continue
        assert plains[0].window == plains[1].window
        floor = FloorMap(grids[0], plains[0], footprint, DISCS, PLENTY)
        floor.change((grids[0], grids[1]), plains[1])
        assert_same(floor, FloorMap(grids[1], plains[1], footprint, DISCS, PLENTY))


def test_a_map_that_grows_a_little_keeps_its_raster():
    """Else all that lies on the raster would move with each map."""
    whole = room(3.0, 2.0)
    known = cropped(whole, 10, 35, 20, 45)  # in rows 29 and columns 74 of the raster
    floor = over(known)
    blocked, geometry = floor.blocked, floor.geometry
    for by in range(1, 8):
        grown = cropped(whole, 10 - by, 35 - by, 20 + by, 45 + by)
        floor.change((known, grown), CoverageLattice.from_map(grown, FOOTPRINT))
        assert floor.shift == (0, 0)
        assert floor.geometry == geometry
        assert floor.blocked is blocked
        assert_same(floor, over(grown))
        known = grown


def test_a_map_that_grows_by_unknown_pixels_touches_little():
    """Growth on two sides once touched a box round all new cells, that is the whole map."""
    whole = room(3.0, 2.0)
    cells = np.pad(whole.cells, 60, constant_values=-1)
    x, y = whole.geometry.to_map(-60, -60)
    grown = OccupancyGrid(GridGeometry(*cells.shape, 0.05, Pose2D(x, y, 0.0)), cells)
    known = cropped(grown, 50, 50, *cells.shape)
    floor, plain = over(known), CoverageLattice.from_map(grown, FOOTPRINT)
    floor.change((known, grown), plain)
    assert floor.touched is None
    assert_same(floor, over(grown))
    # Nor does one that shows less of them.
    floor.change((grown, known), CoverageLattice.from_map(known, FOOTPRINT))
    assert floor.touched is None
    assert_same(floor, over(known))
    cells = known.cells.copy()
    cells[30, 40] = 100  # which the grown map shows no more
    known, floor = OccupancyGrid(known.geometry, cells), over(known)
    floor.change((known, grown), plain)
    assert floor.touched is not None
    assert 4 * floor.touched.rows * floor.touched.cols < floor.geometry.rows * floor.geometry.cols
    assert_same(floor, over(grown))


def test_unknown_floor_stays_unknown():
    grid = room(3.0, 2.0)
    cells = grid.cells.copy()
    cells[10:] = -1
    plain = CoverageLattice.from_map(OccupancyGrid(grid.geometry, cells), FOOTPRINT)
    states = over(OccupancyGrid(grid.geometry, cells)).stands.lattice.states
    assert (states[plain.states == UNKNOWN] != 1).any()
    assert (states[-3:] == UNKNOWN).all()


def test_a_robot_stands_clear_of_what_it_keeps_out_of():
    corner = (3.0, 1.4)
    zone = (corner, (4.0, 1.4), (4.0, 2.2), (3.0, 2.2))
    floor = over(room(3.0, 2.0), (zone,))
    rows, cols = np.nonzero(unpacked(floor.places, floor.geometry.cols))
    x0, y0 = floor.geometry.origin.x, floor.geometry.origin.y
    x, y = x0 + (cols + 0.5) * 0.025, y0 + (rows + 0.5) * 0.025
    apart = np.hypot(
        np.clip(3.0 - x, 0, None) + np.clip(x - 4.0, 0, None),
        np.clip(1.4 - y, 0, None) + np.clip(y - 2.2, 0, None),
    )
    assert apart.min() >= 0.18 - 1e-9
    assert apart.min() < 0.18 + 0.05


def test_the_floor_in_reach_of_some_cells():
    floor = over(room(3.0, 2.0))
    whole = Window(0, 0, floor.geometry.rows, floor.geometry.cols)
    every = np.ones(floor.stands.lattice.states.shape, bool)
    reached = floor.reached(every, whole)
    inner = (3.0 - 0.35) * (2.0 - 0.35)
    rim = 2 * 0.15 * (3.0 + 2.0 - 0.7) + math.pi * 0.15**2
    assert np.count_nonzero(reached) * 0.025**2 == pytest.approx(inner + rim, abs=0.03)
    part = Window(20, 30, 61, 77)
    assert (floor.reached(every, part) == reached[20:61, 30:77]).all()
    assert not floor.reached(~every, whole).any()


def test_a_raster_too_large_changes_nothing():
    grid = room(3.0, 2.0)
    plain = CoverageLattice.from_map(grid, FOOTPRINT)
    floor = FloorMap(grid, plain, FOOTPRINT, DISCS, 6_000)
    larger = room(5.0, 4.0)
    with pytest.raises(MapTooLarge, match="exceeds 6000 pixels"):
        floor.change((grid, larger), CoverageLattice.from_map(larger, FOOTPRINT))
    assert_same(floor, FloorMap(grid, plain, FOOTPRINT, DISCS, 6_000))
    assert floor.geometry.resolution == 0.05  # the pixels of the map, whole
