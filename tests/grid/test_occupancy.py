"""Maps are values: read-only, checked, patched into new ones."""

import numpy as np
import pytest

from fasaco_edge.errors import PatchWithoutBase
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid, coarser
from tests.support.grids import grid


def patch(window, value=100, frame="map"):
    return MapPatch(window, np.full((window.rows, window.cols), value, np.int8), frame, 5)


def test_cells_must_be_int8_of_the_given_size():
    geometry = GridGeometry(2, 3, 0.1, Pose2D(0, 0))
    for cells in (np.zeros((3, 2), np.int8), np.zeros((2, 3), np.uint8), np.zeros(6, np.int8)):
        with pytest.raises(ValueError, match=r"cells must be int8 \(2, 3\), got"):
            OccupancyGrid(geometry, cells)


def test_a_map_is_read_only_and_leaves_its_source_alone():
    source = np.zeros((2, 3), np.int8)
    occupancy = OccupancyGrid(GridGeometry(2, 3, 0.1, Pose2D(0, 0)), source)
    with pytest.raises(ValueError, match="read-only"):
        occupancy.cells[0, 0] = 1
    source[0, 0] = 7  # still the owner's to write
    assert source.flags.writeable


def test_a_patch_makes_a_new_map():
    base = grid(np.zeros((4, 5)))
    patched = base.patched(patch(Window(1, 2, 3, 5)))
    expected = np.zeros((4, 5))
    expected[1:3, 2:5] = 100
    assert np.array_equal(patched.cells, expected)
    assert not base.cells.any()
    assert (patched.geometry, patched.frame, patched.stamp_ns) == (base.geometry, "map", 5)


def test_patches_lie_one_over_the_other():
    base = grid(np.zeros((4, 5)))
    over = [patch(Window(1, 2, 3, 5)), patch(Window(2, 0, 4, 3), value=50)]
    one_by_one = base.patched(over[0]).patched(over[1])
    assert np.array_equal(base.patched(*over).cells, one_by_one.cells)
    assert base.patched() is base
    with pytest.raises(PatchWithoutBase):
        base.patched(over[0], patch(Window(0, 0, 5, 5)))


@pytest.mark.parametrize(
    "window", [Window(0, 0, 5, 5), Window(-1, 0, 1, 1), Window(3, 4, 4, 6), Window(9, 9, 10, 10)]
)
def test_a_patch_that_reaches_beyond_the_map_is_refused(window):
    with pytest.raises(PatchWithoutBase, match="does not lie inside the map of 4 x 5 cells"):
        grid(np.zeros((4, 5))).patched(patch(window))


def test_a_patch_in_another_frame_is_refused():
    with pytest.raises(PatchWithoutBase, match="'odom'"):
        grid(np.zeros((4, 5))).patched(patch(Window(0, 0, 1, 1), frame="odom"))


def test_a_coarser_map_shows_the_most_occupied_pixel_of_each():
    cells = np.full((5, 7), -1, np.int8)
    cells[0, 0], cells[1, 1], cells[4, 6] = 0, 100, 0
    grid = OccupancyGrid(GridGeometry(5, 7, 0.1, Pose2D(1.0, 2.0)), cells)
    assert coarser(grid, 35) is grid
    coarse = coarser(grid, 10)
    assert coarse.cells.tolist() == [[100, -1, -1, -1], [-1] * 4, [-1, -1, -1, 0]]
    assert coarse.geometry == GridGeometry(3, 4, 0.2, Pose2D(1.0, 2.0))
