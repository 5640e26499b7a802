"""Bits of a fine raster move with a map that grows, or shrinks."""

from __future__ import annotations

import numpy as np
import pytest

from fasaco_edge.grid.fine_raster import carried_bits
from fasaco_edge.kernels.floor.bits import packed, unpacked


@pytest.mark.parametrize("beyond", [True, False])
@pytest.mark.parametrize(
    "shift", [(0, 0), (3, 5), (-2, 64), (1, -64), (-4, -70), (0, 63), (7, 131), (40, 0), (0, 500)]
)
def test_bits_are_carried_to_where_their_pixels_are(shift, beyond):
    rng = np.random.default_rng(1)
    before = rng.random((11, 150)) < 0.5
    expected = np.full((13, 200), beyond)
    for row, col in np.ndindex(before.shape):
        i, j = row + shift[0], col + shift[1]
        if 0 <= i < 13 and 0 <= j < 200:
            expected[i, j] = before[row, col]
    bits = carried_bits(packed(before, beyond=beyond), shift, (13, 4), beyond=beyond)
    assert (unpacked(bits, 200) == expected).all()
