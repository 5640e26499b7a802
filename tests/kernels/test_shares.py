"""Blocks of a ground and shares in them: complete, connected, even, and the same again."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.fleet.blocks import blocks_of
from fasaco_edge.kernels.fleet.shares import share_blocks
from fasaco_edge.kernels.lattice.reach import reachable_from
from fasaco_edge.planners.search.walk_region import stream_of
from tests import naive
from tests.support.drawn import free_cells, ground
from tests.support.examples import examples


def blocked(free, start, side):
    """The blocks of what is reachable from a start, and their numbers, int (rows, cols)."""
    lattice = CoverageLattice.from_free(free)
    offsets = np.array([1, free.shape[1], -1, -free.shape[1]], np.int64)
    cells = np.flatnonzero(reachable_from(lattice.steps, *start))
    blocks = blocks_of(lattice.steps.ravel(), offsets, cells, side)
    return blocks, blocks.of.reshape(free.shape)


def shared(blocks, starts, proposals=5_000, hot=400, far=64, seed=0):
    """The owner of each block, the robots that have it, and the loads."""
    owner = np.empty(blocks.own.size, np.int64)
    starts = np.array(starts, np.int64)
    sets, loads = share_blocks(blocks, starts, proposals, hot, 4, 20, far, stream_of(seed), owner)
    return owner, sets >> np.arange(len(starts))[:, None] & 1 > 0, loads


@given(data=st.data())
@examples(40)
def test_blocks_are_connected_squares_and_leave_nothing_out(data):
    free = free_cells(data)
    steps = CoverageLattice.from_free(free).steps
    cells = ground(steps, free)
    if not cells:
        return
    side = data.draw(st.integers(1, 5))
    blocks, of = blocked(free, cells[0], side)
    neighbours = naive.neighbours(steps)
    assert set(map(tuple, np.argwhere(of >= 0).tolist())) == set(cells)
    for block in range(blocks.own.size):
        inside = np.argwhere(of == block)
        assert len(np.unique(inside // side, axis=0)) == 1
        part = CoverageLattice.from_free(of == block).steps & steps
        assert len(naive.distances(part, tuple(inside[0].tolist()))) == len(inside)
        assert len(inside) <= blocks.own[block] <= 2 * len(inside)
        assert 2 <= blocks.passing[block] <= 2 * side
        # Those beside it are the blocks that a step leads to.
        beside = {
            of[there] for here in map(tuple, inside.tolist()) for there in neighbours[here].values()
        }
        named = blocks.beside[blocks.begins[block] : blocks.begins[block + 1]].tolist()
        assert sorted(named) == sorted(beside - {block})


@given(data=st.data())
@examples(40)
def test_what_a_robot_has_is_connected_with_its_start_and_is_its_load(data):
    free = free_cells(data)
    cells = ground(CoverageLattice.from_free(free).steps, free)
    if not cells:
        return
    blocks, of = blocked(free, cells[0], data.draw(st.integers(1, 3)))
    starts = data.draw(st.lists(st.sampled_from(cells), min_size=2, max_size=5))
    seed = data.draw(st.integers(0, 9))
    begins = [of[start] for start in starts]
    owner, has, loads = shared(blocks, begins, 2_000, seed=seed)
    assert has[owner, np.arange(owner.size)].all()
    for robot, start in enumerate(begins):
        mine = owner == robot
        if not mine.any():
            assert np.flatnonzero(has[robot]).tolist() == [start]
            assert loads[robot] == 0
            continue
        assert loads[robot] == np.where(mine, blocks.own, blocks.passing)[has[robot]].sum()
        part = CoverageLattice.from_free(np.isin(of, np.flatnonzero(has[robot]))).steps
        reached = naive.distances(part, tuple(np.argwhere(of == start)[0].tolist()))
        assert set(np.unique([of[cell] for cell in reached])) == set(np.flatnonzero(has[robot]))


def test_one_robot_goes_to_each_of_three_rooms_at_the_ends_of_corridors():
    free = np.zeros((15, 29), np.bool_)
    free[14, 5:24] = free[5:, 14] = True
    rooms = (np.s_[6:, :5], np.s_[6:, 24:], np.s_[:5, 10:19])
    for room in rooms:
        free[room] = True
    blocks, of = blocked(free, (14, 14), 3)
    owner, _, loads = shared(blocks, [of[14, 14]] * 3)
    owners = [set(owner[of[room]].ravel().tolist()) for room in rooms]
    assert sorted(map(len, owners)) == [1, 1, 1]
    assert set.union(*owners) == {0, 1, 2}
    # A room of 45 cells, and about nine of a corridor there and back.
    assert loads.max() <= 45 + 2 * 9 + 6


def test_loads_of_robots_in_one_corner_are_even():
    blocks, of = blocked(np.ones((40, 40), np.bool_), (0, 0), 4)
    *_, loads = shared(blocks, [of[0, 0]] * 4, proposals=20_000)
    assert loads.max() <= 1.15 * 1600 / 4
    assert loads.sum() <= 1.12 * 1600


def test_robots_of_one_room_go_beyond_each_other_where_far_ones_are_asked():
    # A small room, a long corridor, a hall: the robots nearest to the hall are not enough.
    free = np.zeros((12, 60), np.bool_)
    free[:4, :4] = free[3, 4:40] = free[:, 40:] = True
    blocks, of = blocked(free, (0, 0), 3)
    starts = [of[0, 0], of[0, 3], of[3, 0], of[3, 3]]
    *_, loads = shared(blocks, starts, proposals=20_000)
    assert loads.min() > 0.5 * loads.max()


def test_the_same_stream_gives_the_same_shares_and_another_one_others():
    free = np.random.default_rng(3).random((30, 30)) > 0.15
    start = tuple(np.argwhere(free)[200].tolist())
    blocks, _ = blocked(free, start, 2)
    starts = [0, 40, 80]
    one, again, other = (shared(blocks, starts, seed=seed)[0] for seed in (1, 1, 2))
    assert (one == again).all()
    assert (one != other).any()
