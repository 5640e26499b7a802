"""What is free but out of reach, against a count pixel by pixel."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.coverage.counts import FreeArea
from tests.mission.world import CELL, building, started
from tests.support.examples import examples
from tests.support.grids import occupancy_grids

FOOTPRINT = Footprint(cell_m=0.3, robot_radius_m=0.12)


def counted_m2(grid, lattice, reachable):
    """The twin: each pixel's centre, one after the other."""
    geometry, found = grid.geometry, 0
    for row, col in np.ndindex(grid.cells.shape):
        x, y = geometry.to_map(col + 0.5, row + 0.5)
        cell = (math.floor(y / lattice.cell_m), math.floor(x / lattice.cell_m))
        is_free = 0 <= grid.cells[row, col] <= 25
        found += is_free and not (reachable is not None and reachable[lattice.local(cell)])
    return found * geometry.resolution**2


@examples(60)
@given(st.data())
def test_it_is_what_its_twin_counts(data):
    rows, cols = data.draw(st.tuples(st.integers(1, 90), st.integers(1, 12)))
    rng = np.random.default_rng(data.draw(st.integers(0, 99)))
    cells = rng.choice([-1, 0, 20, 26, 100], (rows, cols), p=(0.1, 0.6, 0.1, 0.1, 0.1))
    # No border of pixels lies on one of cells: there rounding may decide.
    yaw = data.draw(st.sampled_from([0.0, 0.7, -2.2, math.pi]))
    origin = Pose2D(data.draw(st.sampled_from([0.013, -7.218])), 3.307, yaw)
    grid = OccupancyGrid(GridGeometry(rows, cols, 0.06, origin), cells.astype(np.int8))
    lattice = CoverageLattice.from_map(grid, FOOTPRINT)
    reachable = rng.random(lattice.states.shape) < 0.5 if data.draw(st.booleans()) else None
    area = FreeArea(25).out_of_reach_m2(grid, 1, lattice, reachable)
    assert area == pytest.approx(counted_m2(grid, lattice, reachable))


@examples(100)
@given(st.data(), occupancy_grids(max_side=40))
def test_without_reachable_cells_each_free_pixel_counts_once(data, grid):
    """Also those on the border of two cells, or of the lattice, where rounding decides."""
    lattice = CoverageLattice.from_map(grid, FOOTPRINT)
    rng = np.random.default_rng(data.draw(st.integers(0, 99)))
    some = rng.random(lattice.states.shape) < 0.5
    area = FreeArea(25)
    parts = [area.out_of_reach_m2(grid, 1, lattice, mask) for mask in (None, some, ~some)]
    everything, *halves = (round(part / grid.geometry.resolution**2) for part in parts)
    assert everything == np.count_nonzero((grid.cells >= 0) & (grid.cells <= 25))
    assert sum(halves) == everything


def test_a_new_map_or_reach_is_counted_again():
    area = FreeArea(25)
    one, other = building("...", "..#"), building("...", "...")
    lattice = CoverageLattice.from_map(other, Footprint(CELL, CELL / 2))
    nowhere, everywhere = np.zeros((2, 3), bool), np.ones((2, 3), bool)
    assert area.out_of_reach_m2(one, 1, lattice, nowhere) == 5 * CELL**2
    assert area.out_of_reach_m2(one, 1, lattice, nowhere) == 5 * CELL**2
    assert area.out_of_reach_m2(other, 2, lattice, nowhere) == 6 * CELL**2
    assert area.out_of_reach_m2(other, 2, lattice, everywhere) == 0.0


def test_a_mission_tells_what_lies_behind_a_wall():
    drive = started("...#..", "...#..")
    coverage = drive.mission.coverage()
    assert coverage.coverable == 6
    assert coverage.free_out_of_reach_m2 == 4 * CELL**2
    assert coverage.to_cover_m2 == 5 * CELL**2
    drive.finish()
    coverage = drive.mission.coverage()
    assert (coverage.to_cover_m2, coverage.covered_m2) == (0.0, 6 * CELL**2)
