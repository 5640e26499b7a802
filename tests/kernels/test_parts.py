"""Parts of a ground: connected, complete, with the starts in them, balanced, and the same again."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.fleet.parts import balance_parts
from fasaco_edge.kernels.lattice.reach import reachable_from
from fasaco_edge.planners.search.walk_region import stream_of
from tests import naive
from tests.support.drawn import free_cells, ground
from tests.support.examples import examples


def parted(free, starts, proposals=20_000, seed=0):
    """The sets of cells of each robot, bool (k, rows, cols), and its load."""
    lattice = CoverageLattice.from_free(free)
    cols = free.shape[1]
    offsets = np.array([1, cols, -1, -cols], np.int64)
    reached = reachable_from(lattice.steps, *starts[0]).astype(bool)
    apart = np.full((len(starts), *free.shape), 10**6)
    for robot, start in enumerate(starts):
        for cell, steps in naive.distances(lattice.steps, start).items():
            apart[robot][cell] = steps
    sets = np.where(reached, np.int64(1) << apart.argmin(axis=0), 0).ravel()
    flat = np.array([row * cols + col for row, col in starts], np.int64)
    for robot, start in enumerate(flat):
        sets[start] |= 1 << robot
    cells = np.flatnonzero(reached)
    loads = balance_parts(
        lattice.steps.ravel(), offsets, sets, cells, flat, proposals, stream_of(seed)
    )
    robots = np.arange(len(starts))[:, None, None]
    return (sets.reshape(free.shape) >> robots & 1).astype(bool), loads


def load_of(part):
    """Its cells, and once more those that lie in no square of four of them."""
    square = part[:-1, :-1] & part[1:, :-1] & part[:-1, 1:] & part[1:, 1:]
    thick = np.zeros_like(part)
    for rows in (np.s_[:-1], np.s_[1:]):
        for cols in (np.s_[:-1], np.s_[1:]):
            thick[rows, cols] |= square
    return np.count_nonzero(part) + np.count_nonzero(part & ~thick)


@given(data=st.data())
@examples(25, suppress_health_check=[HealthCheck.too_slow])
def test_parts_are_connected_and_leave_nothing_out(data):
    free = free_cells(data)
    cells = ground(CoverageLattice.from_free(free).steps, free)
    if not cells:
        return
    starts = data.draw(st.lists(st.sampled_from(cells), min_size=2, max_size=5))
    parts, loads = parted(free, starts, 2_000, data.draw(st.integers(0, 9)))
    assert set(map(tuple, np.argwhere(parts.any(axis=0)).tolist())) == set(cells)
    for part, start, load in zip(parts, starts, loads, strict=True):
        own = CoverageLattice.from_free(part).steps
        assert set(naive.distances(own, start)) == set(map(tuple, np.argwhere(part).tolist()))
        assert load == load_of(part)


def test_a_hall_is_shared_alike_from_anywhere():
    parts, loads = parted(np.ones((24, 40), np.bool_), [(0, 0), (0, 1), (3, 0), (23, 39)], 200_000)
    assert loads.max() <= 1.05 * 24 * 40 / 4
    assert (parts.sum(axis=0) > 1).sum() <= 0.03 * 24 * 40


@pytest.mark.parametrize("seed", range(3))
def test_a_room_behind_a_door_goes_to_who_has_less(seed):
    # All three start in the left room; the others hold most of it before one gets through.
    free = np.ones((12, 37), np.bool_)
    free[:, (12, 24)] = False
    free[5, (12, 24)] = True
    parts, loads = parted(free, [(5, 9), (5, 10), (5, 11)], 300_000, seed)
    assert loads.max() <= 1.25 * 12 * 35 / 3
    assert (parts.sum(axis=0) >= 1)[free].all()


def test_the_same_numbers_give_the_same_parts():
    free = np.ones((12, 20), np.bool_)
    first, second = (parted(free, [(0, 0), (11, 19), (5, 5)], seed=7) for _ in range(2))
    assert (first[0] == second[0]).all()
    assert (first[1] == second[1]).all()
