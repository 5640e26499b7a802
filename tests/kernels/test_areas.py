"""Connected areas against a flood, cell by cell."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.kernels.lattice.areas import cells_beside, find_areas
from tests import naive
from tests.support.examples import examples

SHAPES = [(0, 0), (1, 1), (1, 9), (9, 1), (0, 5), (5, 0)]


def assert_agrees(kinds):
    areas, expected = find_areas(kinds), naive.areas(kinds)
    assert areas.labels.shape == kinds.shape
    found = [
        (int(kind), frozenset(map(tuple, np.argwhere(areas.labels == number + 1).tolist())))
        for number, kind in enumerate(areas.kinds)
    ]
    assert found == expected
    assert areas.cells.tolist() == [len(cells) for _, cells in expected]
    inner = list(map(tuple, areas.inner.tolist()))
    assert inner == [naive.inner_cell(cells) for _, cells in expected]
    allowed = kinds == 0
    beside = list(map(tuple, cells_beside(areas, allowed).tolist()))
    free = set(map(tuple, np.argwhere(allowed).tolist()))
    assert beside == [naive.cell_beside(cells, free) for _, cells in expected]


@examples(200)
@given(st.integers(0, 9), st.integers(0, 9), st.integers(0, 2**32), st.integers(2, 4))
def test_areas_are_those_a_flood_finds(rows, cols, seed, kinds):
    grid = np.random.default_rng(seed).integers(0, kinds, (rows, cols)).astype(np.uint8)
    assert_agrees(grid)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("value", [0, 1, 5])
def test_areas_of_small_and_uniform_grids(shape, value):
    assert_agrees(np.full(shape, value, np.uint8))


def test_a_hundred_thousand_chambers_are_distinguished():
    side = 640
    grid = np.zeros((side, side), np.uint8)
    grid[::2, ::2] = 1
    areas = find_areas(grid)
    assert len(areas.cells) == (side // 2) ** 2
    assert (areas.cells == 1).all()
