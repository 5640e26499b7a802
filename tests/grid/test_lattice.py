"""The lattice is anchored to the map frame: what a cell is does not depend on the message."""

import math
import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.errors import MapTooLarge
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.lattice import COVERABLE, UNKNOWN, CoverageLattice, Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from tests import naive
from tests.support.examples import examples
from tests.support.grids import cropped, footprints, grid, occupancy_grids, on_raster


def cells_and_centres(window, cell_m):
    for row in range(window.row0, window.row1):
        for col in range(window.col0, window.col1):
            yield (row, col), ((col + 0.5) * cell_m, (row + 0.5) * cell_m)


@examples(200)
@given(data=st.data(), whole=occupancy_grids(max_side=30))
def test_a_cell_is_the_same_in_a_map_that_has_grown(data, whole):
    rows, cols = whole.cells.shape
    row0, row1 = sorted(data.draw(st.tuples(st.integers(0, rows), st.integers(0, rows))))
    col0, col1 = sorted(data.draw(st.tuples(st.integers(0, cols), st.integers(0, cols))))
    part = cropped(whole, row0, col0, row1, col1)
    footprint = data.draw(footprints(whole.geometry.resolution))
    after = CoverageLattice.from_map(whole, footprint)
    before = CoverageLattice.from_map(part, footprint)
    common = before.window.intersection(after.window)
    if common is None:
        assert not before.coverable.any()
        return
    reach = footprint.robot_radius_m / whole.geometry.resolution
    for cell, centre in cells_and_centres(common, footprint.cell_m):
        old, new = before.states[before.local(cell)], after.states[after.local(cell)]
        # What was seen stays true, whatever comes into sight around it ...
        assert old in (UNKNOWN, new)
        steps = int(before.steps[before.local(cell)])
        assert steps & int(after.steps[after.local(cell)]) == steps
        # ... and where the robot saw all under its disc, nothing is left to come.
        col, row = part.geometry.to_pixels(*centre)
        if reach <= col <= col1 - col0 - reach and reach <= row <= row1 - row0 - reach:
            assert new == old


@examples(100)
@given(data=st.data(), occupancy=occupancy_grids(max_side=10))
def test_no_coverable_cell_lies_beyond_the_window(data, occupancy):
    footprint = data.draw(footprints(occupancy.geometry.resolution))
    lattice = CoverageLattice.from_map(occupancy, footprint)
    window = lattice.window
    wider = Window(window.row0 - 1, window.col0 - 1, window.row1 + 1, window.col1 + 1)
    twin = naive.classify(occupancy.cells, on_raster(occupancy.geometry), wider, footprint)
    beyond = np.ones((wider.rows, wider.cols), bool)
    beyond[1:-1, 1:-1] = False
    assert not (twin.states[beyond] == COVERABLE).any()


def test_a_cell_is_where_its_index_says():
    lattice = CoverageLattice.from_map(grid(np.zeros((30, 40)), 0.1, -1.45, 0.62), CELL)
    assert lattice.window == Window(2, -5, 13, 9)
    for cell, (x, y) in cells_and_centres(lattice.window, CELL.cell_m):
        assert lattice.cell_at(x, y) == cell
        assert lattice.contains(cell)
        assert lattice.centres(np.array([cell], np.int32))[0] == pytest.approx((x, y))
    assert lattice.cell_at(0.0, 0.0) == (0, 0)
    assert lattice.cell_at(-1e-9, -1e-9) == (-1, -1)
    assert not lattice.contains((13, 0))
    assert not lattice.contains((2, 9))
    assert lattice.local((2, -5)) == (0, 0)


CELL = Footprint(0.3, 0.12)


def known_cells(lattice):
    """State and steps of what is not unknown; a rounded corner may span a border more."""
    window = lattice.window
    return {
        (row + window.row0, col + window.col0): (lattice.states[row, col], lattice.steps[row, col])
        for row, col in np.argwhere(lattice.states != UNKNOWN).tolist()
    }


@pytest.mark.parametrize(
    "geometry",
    [
        GridGeometry(3000, 3000, 100.0, Pose2D(0, 0)),
        GridGeometry(1, 1, 1e300, Pose2D(0, 0)),
        GridGeometry(3, 3, math.nan, Pose2D(0, 0)),
        GridGeometry(3, 3, math.inf, Pose2D(0, 0)),
        GridGeometry(3, 3, 0.1, Pose2D(math.nan, 0)),
        GridGeometry(3, 3, 0.1, Pose2D(0, 0, math.nan)),
        GridGeometry(3, 3, 0.1, Pose2D(-math.inf, 0)),
    ],
    ids=lambda geometry: f"{geometry.resolution}, {geometry.origin}",
)
def test_a_lattice_beyond_the_limit_is_refused_before_allocation(geometry):
    cells = np.zeros((geometry.rows, geometry.cols), np.int8)
    occupancy = OccupancyGrid(geometry, cells)
    tracemalloc.start()
    try:
        with pytest.raises(MapTooLarge, match="exceeds 4000000 cells"):
            CoverageLattice.from_map(occupancy, CELL)
        assert tracemalloc.get_traced_memory()[1] < 100_000
    finally:
        tracemalloc.stop()


def test_the_limit_is_the_callers():
    occupancy = grid(np.zeros((30, 30)))
    assert CoverageLattice.from_map(occupancy, CELL, max_cells=200).states.shape == (10, 10)
    with pytest.raises(MapTooLarge, match=r"0\.3 m over a map of 3 x 3 m exceeds 20 cells"):
        CoverageLattice.from_map(occupancy, CELL, max_cells=20)


def test_a_coverage_grid_has_steps_between_all_free_neighbours():
    open_floor = np.random.default_rng(0).random((13, 17)) < 0.7
    lattice = CoverageLattice.from_free(open_floor)
    assert np.array_equal(lattice.coverable, open_floor)
    for (row, col), around in naive.neighbours(lattice.steps).items():
        expected = {
            (row + up, col + right)
            for up, right in naive.DIRECTIONS
            if 0 <= row + up < 13 and 0 <= col + right < 17 and open_floor[row + up, col + right]
        }
        assert set(around.values()) == (expected if open_floor[row, col] else set())


def test_a_lattice_is_read_only():
    lattice = CoverageLattice.from_map(grid(np.zeros((9, 9))), CELL)
    for array in (lattice.states, lattice.steps):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 1
