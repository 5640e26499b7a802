"""Parts of a ground for robots: complete, few robots through each passage, the same again."""

from __future__ import annotations

import numpy as np
import pytest

from fasaco_edge.fleet.planning.parts import Parting
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.fleet.split import ways_from


def parting(free, starts):
    lattice = CoverageLattice.from_free(free)
    flat = [row * free.shape[1] + col for row, col in starts]
    ways = np.array([ways_from(lattice.steps, start) for start in flat])
    return Parting(lattice, free, flat, ways)


def rooms():
    """Three rooms of 45 cells at the ends of corridors of nine, which meet in (14, 14)."""
    free = np.zeros((15, 29), np.bool_)
    free[14, 5:24] = free[5:, 14] = True
    free[6:, :5] = free[6:, 24:] = free[:5, 10:19] = True
    return free


@pytest.mark.parametrize("starts", [[(14, 14), (14, 13), (14, 15)], [(6, 0), (14, 28), (0, 10)]])
def test_every_cell_is_a_robots_and_the_same_ones_again(starts):
    free = rooms()
    owners = parting(free, starts).owners((1, 2))
    assert ((owners.reshape(free.shape) >= 0) == free).all()
    assert set(owners[free.ravel()].tolist()) == {0, 1, 2}
    assert (owners == parting(free, starts).owners((1, 2))).all()


def test_from_one_place_each_room_is_one_robots():
    free = rooms()
    owners = parting(free, [(14, 14), (14, 13), (14, 15)]).owners((1, 0)).reshape(free.shape)
    for room in (np.s_[6:, :5], np.s_[6:, 24:], np.s_[:5, 10:19]):
        assert len(np.unique(owners[room])) == 1


def test_parts_of_a_hall_are_even_from_one_place_and_from_several():
    hall = np.ones((40, 40), np.bool_)
    for starts in ([(0, 0), (0, 1), (1, 0)], [(0, 0), (39, 39), (0, 39)]):
        counts = np.bincount(parting(hall, starts).owners((0, 0)))
        assert counts.max() <= 1.1 * 1600 / 3
