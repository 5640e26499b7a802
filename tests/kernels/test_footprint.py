"""The compiled classification of cells against exact geometry in plain Python."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.grid.lattice import BLOCKED, COVERABLE, UNKNOWN, CoverageLattice, Footprint
from tests import naive
from tests.support.examples import examples
from tests.support.grids import footprints, grid, occupancy_grids, on_raster


def assert_agrees(occupancy, footprint):
    lattice = CoverageLattice.from_map(occupancy, footprint)
    geometry = on_raster(occupancy.geometry)
    twin = naive.classify(occupancy.cells, geometry, lattice.window, footprint)
    assert np.array_equal(lattice.states[twin.sure], twin.states[twin.sure])
    assert np.array_equal(lattice.steps[twin.sure], twin.steps[twin.sure])
    return lattice, twin


@examples(300)
@given(data=st.data(), occupancy=occupancy_grids(max_side=12))
def test_twin_classifies_alike(data, occupancy):
    assert_agrees(occupancy, data.draw(footprints(occupancy.geometry.resolution)))


@pytest.mark.parametrize("shape", [(0, 0), (1, 1), (1, 9), (9, 1), (0, 5)])
@pytest.mark.parametrize("value", [0, 100, -1, 50])
@pytest.mark.parametrize("yaw", [0.0, 0.5])
def test_twin_classifies_small_and_uniform_maps_alike(shape, value, yaw):
    occupancy = grid(np.full(shape, value), 0.1, 0.23, -0.31, yaw)
    lattice, twin = assert_agrees(occupancy, Footprint(0.1, 0.04))
    assert twin.sure.all()
    if value != 0:
        assert not lattice.coverable.any()
        assert not lattice.steps.any()


@pytest.mark.parametrize("shape", [(8, 16), (16, 8)])
@pytest.mark.parametrize("yaw", [0.0, 0.1])
def test_twin_agrees_wherever_a_single_pixel_stands(shape, yaw):
    """A robot much narrower than its cells: between two discs the lane alone counts."""
    closed = 0
    for place in np.ndindex(shape):
        cells = np.zeros(shape, np.int8)
        cells[place] = 100
        lattice, _ = assert_agrees(grid(cells, 0.25, 0.1, -0.1, yaw), Footprint(2.0, 0.33))
        fits = np.count_nonzero(lattice.coverable)
        closed += fits == 2 and not lattice.steps.any()
    assert closed > 0


def test_twin_is_hardly_ever_unsure():
    """A twin that calls everything a matter of rounding would agree with anything."""
    cells = np.zeros((12, 12), np.int8)
    cells[5, 7] = 100
    for yaw in (0.0, math.pi / 4, 1.0):
        _, twin = assert_agrees(grid(cells, 0.1, yaw=yaw), Footprint(0.3, 0.15))
        assert twin.sure.all()
        # A map that lies along the lattice has no cells in its corners that it does not show.
        outside = {UNKNOWN} if yaw else set()
        assert set(np.unique(twin.states)) == {BLOCKED, COVERABLE} | outside


def test_a_robot_flush_with_both_walls_fits_the_corridor():
    cells = np.zeros((5, 12), np.int8)
    cells[0] = cells[4] = 100
    # As off the wire: the resolution is a float32, its pixels a hair too wide or narrow.
    for resolution in (0.1, float(np.float32(0.1)), np.nextafter(0.1, 0)):
        # As of a publisher that rounds its origin to float32, a micrometre or two at 30 m.
        for off in (0.0, 2e-6, -2e-6):
            occupancy = grid(cells, resolution, off, off - resolution)
            lattice = CoverageLattice.from_map(occupancy, Footprint(0.3, 0.15))
            row = lattice.coverable[0 - lattice.window.row0]
            assert row[1 - lattice.window.col0 : 3 - lattice.window.col0].all()
        wider = CoverageLattice.from_map(
            grid(cells, resolution, y=-resolution), Footprint(0.3, 0.151)
        )
        assert not wider.coverable.any()


def test_pixels_may_be_ever_so_much_smaller_than_the_robot():
    """As many of them under the disc as are allowed; smaller ones are refused with the map."""
    for yaw in (0.0, math.pi, 0.3, -0.3, 1.5):
        for shape in ((1, 2), (300, 2), (300, 300)):
            for value, expected in ((0, UNKNOWN), (-1, UNKNOWN), (100, BLOCKED)):
                cells = np.full(shape, value, np.int8)
                lattice = CoverageLattice.from_map(
                    grid(cells, 1e-4, 0.0, 0.0, yaw), Footprint(0.02, 0.02)
                )
                assert (lattice.states == expected).all()


@pytest.mark.parametrize(
    ("row", "col", "expected"),
    [
        (150, 249, BLOCKED),
        (150, 250, COVERABLE),
        (150, 50, BLOCKED),
        (150, 49, COVERABLE),
        (220, 220, BLOCKED),
        (221, 221, COVERABLE),
        (249, 150, BLOCKED),
        (50, 50, COVERABLE),
    ],
)
def test_each_pixel_of_a_large_disc_counts(row, col, expected):
    """The disc touches 100 pixels to each side of the cell's centre."""
    cells = np.zeros((300, 300), np.int8)
    cells[row, col] = 100
    lattice = CoverageLattice.from_map(grid(cells, 1e-4, 0.0, 0.0, 0.0), Footprint(0.03, 0.01))
    assert lattice.states[0, 0] == expected
