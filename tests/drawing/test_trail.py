"""The picture of a trail: each cell's colour is its direction, the stronger the more decided."""

from __future__ import annotations

import numpy as np
import pytest

from fasaco_edge.drawing import palette
from fasaco_edge.drawing.trail import WAYS, draw_trail, pointed_and_decided
from fasaco_edge.grid.lattice import CoverageLattice


def trail_of(*cells):
    """Return the trail on one row of cells, each by its pheromone east, north, west, south."""
    return np.array([cells], np.float32)


def test_decidedness_is_the_share_of_the_strongest_step():
    tau = trail_of((1, 0, 0, 0), (2, 0, 2, 0), (1, 1, 7, 1), (0, 0, 0, 0), (3, 0, 1, 0))
    pointed, decided = pointed_and_decided(tau)
    assert pointed[0].tolist() == [0, 0, 2, -1, 0]
    assert decided[0] == pytest.approx([1.0, 0.0, 0.6, 0.0, 0.5])


def test_right_on_the_map_is_right_in_the_picture():
    """A ring of four by four cells, driven counter-clockwise."""
    free = np.ones((4, 4), bool)
    free[1:3, 1:3] = False
    tau = np.zeros((4, 4, 4), np.float32)
    for side, direction in (
        (np.s_[0, :3], 0),
        (np.s_[:3, 3], 1),
        (np.s_[3, 1:], 2),
        (np.s_[1:, 0], 3),
    ):
        tau[(*side, direction)] = 1.0
    drawn = draw_trail(
        CoverageLattice.from_free(free, 1.0), tau, grid=None, title="trail", lines=["around"]
    )
    pixels = np.asarray(drawn)

    def centre(colour):
        """Return where a colour is in the plot, above the key, as shares of the picture."""
        plot = pixels[:-60, :]
        rows, cols = np.nonzero((plot == colour).all(axis=2))
        return np.mean(cols) / pixels.shape[1], np.mean(rows) / pixels.shape[0]

    across = [centre(WAYS[direction][1]) for direction in (3, 1)]
    down = [centre(WAYS[direction][1]) for direction in (2, 0)]
    assert across[0][0] < across[1][0], "down on the left, up on the right"
    assert down[0][1] < down[1][1], "left above, right below"


def test_a_uniform_trail_draws_no_arrows():
    free = np.ones((3, 3), bool)
    lattice = CoverageLattice.from_free(free, 1.0)
    tau = ((lattice.steps[..., None] >> np.arange(4)) & 1).astype(np.float32)
    pixels = np.asarray(draw_trail(lattice, tau, grid=None, title="trail", lines=[]))
    # Between the caption and the scale bar below.
    assert not (pixels[75:-96] == palette.INK).all(axis=2).any(), "no arrow"
