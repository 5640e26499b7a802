"""Nearest-neighbour walks over the parts of robots."""

import numpy as np
import pytest

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.fleet.nearest import walk_parts


def walks(free, parts, starts):
    """Steps and quarter turns over parts: the number of each cell's robot, -1 for none."""
    lattice = CoverageLattice.from_free(free)
    cols = free.shape[1]
    parts = np.asarray(parts)
    cells = np.flatnonzero(parts >= 0)
    return walk_parts(
        lattice.steps.ravel().copy(),
        np.array([1, cols, -1, -cols], np.int64),
        cells,
        parts.ravel()[cells].astype(np.int64),
        np.array([row * cols + col for row, col in starts], np.int64),
    ).tolist()


HALL = np.ones((4, 9), np.bool_)


@pytest.mark.parametrize(
    ("row", "walk"),
    [
        ([0] * 9, [8, 0]),
        ([-1] * 4 + [0] * 5, [8, 0]),
        ([-1, 0, -1, -1, 0, -1, -1, -1, 0], [8, 0]),
        ([-1] * 9, [0, 0]),
        ([0] + [-1] * 8, [0, 0]),
    ],
    ids=["all", "far", "bits", "none", "its own cell"],
)
def test_a_robot_drives_as_far_as_to_its_last_cell(row, walk):
    assert walks(HALL[:1], [row], [(0, 0)]) == [walk]


def test_a_room_takes_a_step_a_cell_and_two_turns_a_row():
    assert walks(HALL, np.zeros((4, 9)), [(0, 0)]) == [[35, 6]]


def test_each_walks_over_its_own_cells_alone():
    parts = np.full((4, 9), -1)
    parts[0, 3:], parts[3] = 0, 1
    assert walks(HALL, parts, [(0, 0), (3, 8)]) == [[8, 0], [8, 0]]


def test_the_nearest_cell_comes_first_even_if_the_walk_is_longer():
    assert walks(HALL[:1], [[0, -1, -1, 0, -1, -1, -1, -1, 0]], [(0, 2)]) == [[1 + 3 + 8, 4]]


def test_unreachable_cells_count_as_a_step_each():
    free = HALL.copy()
    free[:, 4] = False
    parts = np.where(free, 0, -1)
    assert walks(free, parts, [(0, 0)]) == [[15 + 16, 6]]
