"""A lattice carried on from map to map is, bit for bit, the lattice over the last map."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from fasaco_edge.errors import MapTooLarge
from fasaco_edge.grid.changes import LatticeChange
from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.occupancy import MapPatch
from tests.grid.test_lattice import known_cells
from tests.support.examples import examples
from tests.support.grids import displaced, footprints, grid, occupancy_grids, part_of, repainted

CELL = Footprint(0.3, 0.12)


def assert_follows(change, lattice, after, footprint):
    """The new lattice is the map's own, and exactly what differs is told."""
    whole = CoverageLattice.from_map(after, footprint)
    assert change.before is lattice
    assert change.after.window == whole.window
    assert change.after.cell_m == whole.cell_m
    assert np.array_equal(change.after.states, whole.states)
    assert np.array_equal(change.after.steps, whole.steps)
    old, new = known_cells(lattice), known_cells(whole)
    differing = {cell for cell in old.keys() | new.keys() if old.get(cell) != new.get(cell)}
    told = [tuple(cell) for cell in change.cells.tolist()]
    assert len(told) == len(set(told))
    assert set(told) == differing
    assert bool(change) == bool(differing)
    if differing:
        rows, cols = zip(*differing, strict=True)
        assert change.window == Window(min(rows), min(cols), max(rows) + 1, max(cols) + 1)
    else:
        assert change.window is None


@examples(300)
@given(data=st.data(), whole=occupancy_grids(max_side=40))
def test_a_lattice_follows_its_map(data, whole):
    footprint = data.draw(footprints(whole.geometry.resolution))
    before = part_of(data.draw, whole)
    lattice = CoverageLattice.from_map(before, footprint)
    for _ in range(data.draw(st.integers(1, 3))):
        whole = repainted(data.draw, whole)
        if data.draw(st.integers(0, 3)) == 0:
            whole = displaced(data.draw, whole)
        after = part_of(data.draw, whole) if data.draw(st.booleans()) else whole
        change = LatticeChange.between((before, after), lattice, footprint)
        assert_follows(change, lattice, after, footprint)
        before, lattice = after, change.after


@examples(100)
@given(data=st.data(), before=occupancy_grids(max_side=40))
def test_a_lattice_follows_patches(data, before):
    footprint = data.draw(footprints(before.geometry.resolution))
    lattice = CoverageLattice.from_map(before, footprint)
    rows, cols = before.cells.shape
    assume(rows and cols)
    row0, row1 = sorted(data.draw(st.tuples(st.integers(0, rows - 1), st.integers(1, rows))))
    col0, col1 = sorted(data.draw(st.tuples(st.integers(0, cols - 1), st.integers(1, cols))))
    assume(row0 < row1 and col0 < col1)
    window = Window(row0, col0, row1, col1)
    painted = repainted(data.draw, before).cells[row0:row1, col0:col1]
    after = before.patched(MapPatch(window, painted))
    change = LatticeChange.between((before, after), lattice, footprint, within=window)
    assert_follows(change, lattice, after, footprint)


@examples(50)
@given(data=st.data(), occupancy=occupancy_grids(max_side=20))
def test_the_first_lattice_has_all_that_is_known(data, occupancy):
    footprint = data.draw(footprints(occupancy.geometry.resolution))
    change = LatticeChange.first(occupancy, footprint)
    assert change.before is None
    assert known_cells(change.after) == known_cells(CoverageLattice.from_map(occupancy, footprint))
    assert sorted(map(tuple, change.cells.tolist())) == sorted(known_cells(change.after))


def hall(side=300, resolution=0.05, **placed):
    """A hall with walls around and pillars in it."""
    cells = np.zeros((side, side), np.int8)
    cells[::40, ::40] = 100
    cells[:3] = cells[-3:] = cells[:, :3] = cells[:, -3:] = 100
    return grid(cells, resolution, **placed)


def edited(occupancy, window, value):
    cells = occupancy.cells.copy()
    cells[window.row0 : window.row1, window.col0 : window.col1] = value
    return replace(occupancy, cells=cells)


def forged(lattice):
    """A lattice in which every cell is wrong: who looks at one anew gives himself away."""
    return CoverageLattice(
        lattice.window, lattice.cell_m, lattice.states + 3, np.full_like(lattice.steps, 15)
    )


def looked_at(before, after):
    """Return how many cells are classified anew."""
    lattice = forged(CoverageLattice.from_map(before, CELL))
    change = LatticeChange.between((before, after), lattice, CELL)
    window = change.after.window
    return int(np.count_nonzero(change.after.states < 3)), window.rows * window.cols


@pytest.mark.parametrize("yaw", [0.0, 0.4])
def test_only_cells_around_changed_pixels_are_classified_again(yaw):
    before = hall(yaw=yaw)
    assert looked_at(before, replace(before, cells=before.cells.copy()))[0] == 0
    one = edited(before, Window(150, 150, 151, 151), 100)
    assert 1 <= looked_at(before, one)[0] <= 30
    crate = edited(before, Window(100, 150, 118, 168), 100)
    assert 9 <= looked_at(before, crate)[0] <= 100
    corners = edited(edited(before, Window(5, 5, 6, 6), 100), Window(290, 290, 291, 291), 100)
    assert looked_at(before, corners)[0] <= 60


def test_only_the_patch_of_a_patched_map_is_compared():
    before = hall()
    window = Window(100, 100, 110, 110)
    both = edited(edited(before, window, 100), Window(200, 200, 210, 210), 100)
    lattice = CoverageLattice.from_map(before, CELL)
    change = LatticeChange.between((before, both), lattice, CELL, within=window)
    assert change
    assert change.cells.max() < 25


@pytest.mark.parametrize("yaw", [0.0, math.pi / 6])
def test_a_map_that_grows_by_unknown_pixels_compares_its_sides(yaw):
    before = hall(yaw=yaw)
    corner = before.geometry.to_map(-12, -30)
    after = grid(np.pad(before.cells, ((30, 5), (12, 60)), constant_values=-1), 0.05, *corner, yaw)
    lattice = CoverageLattice.from_map(before, CELL)
    change = LatticeChange.between((before, after), lattice, CELL)
    assert_follows(change, lattice, after, CELL)
    inner = before.geometry.rows * before.geometry.cols / 36
    looked, cells = looked_at(before, after)
    assert looked < cells - 0.8 * inner


def test_a_lattice_beyond_the_limit_is_refused():
    before = hall()
    lattice = CoverageLattice.from_map(before, CELL)
    with pytest.raises(MapTooLarge, match="exceeds 2500 cells"):
        LatticeChange.between((before, hall(side=400)), lattice, CELL, max_cells=2500)
    with pytest.raises(MapTooLarge):
        LatticeChange.first(before, CELL, max_cells=2000)
