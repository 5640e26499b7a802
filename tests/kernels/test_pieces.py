"""Pieces of a tree: connected with their ways, complete, equal in cost, and the same again."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.fleet.pieces import cut_tree
from fasaco_edge.planners.search.walk_region import stream_of
from tests import naive
from tests.support.drawn import free_cells, ground
from tests.support.examples import examples


def cut(free, root, pieces, tries=3, seed=0):
    """The cells of each piece and its way, bool (k, rows, cols), and the greatest cost."""
    steps = CoverageLattice.from_free(free).steps
    cols = free.shape[1]
    offsets = np.array([1, cols, -1, -cols], np.int64)
    cells = len(naive.distances(steps, root))
    sets = np.zeros(free.size, np.int64)
    start = root[0] * cols + root[1]
    cost = cut_tree(steps.ravel(), offsets, start, cells, pieces, tries, stream_of(seed), sets)
    which = np.arange(pieces)[:, None, None]
    return (sets.reshape(free.shape) >> which & 1).astype(bool), cost


@given(data=st.data())
@examples(40)
def test_pieces_are_connected_with_the_root_and_leave_nothing_out(data):
    free = free_cells(data)
    cells = ground(CoverageLattice.from_free(free).steps, free)
    if not cells:
        return
    root, count = data.draw(st.sampled_from(cells)), data.draw(st.integers(2, 6))
    pieces, cost = cut(free, root, count, seed=data.draw(st.integers(0, 9)))
    assert set(map(tuple, np.argwhere(pieces.any(axis=0)).tolist())) == set(cells)
    assert len(cells) <= cost * count
    for piece in pieces:
        if piece.any():
            own = CoverageLattice.from_free(piece).steps
            assert set(naive.distances(own, root)) == set(map(tuple, np.argwhere(piece).tolist()))
            # A way is counted twice, so a piece and its way have no more cells than it costs.
            assert np.count_nonzero(piece) <= cost


def test_one_robot_goes_to_each_of_three_rooms():
    free = np.zeros((15, 29), np.bool_)
    free[14, 5:24] = free[5:, 14] = True
    free[6:, :5] = free[6:, 24:] = free[:5, 10:19] = True
    pieces, cost = cut(free, (14, 14), 3, tries=20)
    # A room of 45 cells, nine of its corridor, and a step to there from the root and back.
    assert cost == 45 + 9 + 2
    for room in (np.s_[6:, :5], np.s_[6:, 24:], np.s_[:5, 10:19]):
        assert sorted(np.count_nonzero(piece[room]) for piece in pieces) == [0, 0, 45]


def test_more_trees_are_no_worse_and_the_same_number_gives_the_same_pieces():
    free = np.random.default_rng(3).random((20, 30)) > 0.15
    root = tuple(np.argwhere(free)[200].tolist())
    costs = [cut(free, root, 5, tries)[1] for tries in (1, 4, 16, 64)]
    assert costs == sorted(costs, reverse=True)
    assert costs[0] > costs[-1]
    assert (cut(free, root, 5, 16)[0] == cut(free, root, 5, 16)[0]).all()


def test_some_pieces_are_empty_where_there_are_fewer_cells():
    pieces, cost = cut(np.ones((1, 2), np.bool_), (0, 0), 4)
    assert cost >= 2
    assert pieces.any(axis=0).all()
