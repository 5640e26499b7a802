"""Two walks are compared piece by piece, and a line's sweeps are counted block by block."""

from __future__ import annotations

import numpy as np
import pytest

from fasaco_edge.kernels.floor.sweeps import BLOCK
from fasaco_edge.planners.line import left_in_blocks
from fasaco_edge.planners.path import FIRST_PIECE, common_beginning


@pytest.mark.parametrize("at", [0, 1, FIRST_PIECE - 1, FIRST_PIECE, 5 * FIRST_PIECE, 1999, 2000])
@pytest.mark.parametrize("axis", [0, 1])
def test_the_common_beginning_ends_where_walks_part(at, axis):
    walk = np.arange(4000, dtype=np.int32).reshape(2000, 2)
    other = np.concatenate([walk, walk[:10]])
    if at < 2000:
        other[at, axis] += 1
    assert common_beginning(walk, other) == common_beginning(other, walk) == at


def test_an_empty_walk_has_no_common_beginning():
    assert common_beginning(np.empty((0, 2), np.int32), np.ones((3, 2), np.int32)) == 0


@pytest.mark.parametrize("shape", [(1, 1), (8, 8), (9, 17), (300, 1003), (2000, 40)])
def test_unswept_pixels_are_counted_by_block(shape):
    counts = np.random.default_rng(2).integers(0, 3, shape).astype(np.int16)
    left, side = left_in_blocks(counts), 1 << BLOCK
    assert left.dtype == np.int32
    for (i, j), found in np.ndenumerate(left):
        block = counts[i * side : (i + 1) * side, j * side : (j + 1) * side]
        assert block.size
        assert found == np.count_nonzero(block == 0)
    assert left.sum() == np.count_nonzero(counts == 0)
