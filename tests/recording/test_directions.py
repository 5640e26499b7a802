"""Which way the lanes of a path run."""

from __future__ import annotations

import numpy as np
import pytest

from fasaco_edge.recording.scene.drawings import main_directions


def lanes(turned_by=0.0, lanes=10, steps=20):
    """Back and forth along x, a metre apart, turned around the origin."""
    xy = [
        (col if row % 2 == 0 else steps - 1 - col, row)
        for row in range(lanes)
        for col in range(steps)
    ]
    cos, sin = np.cos(turned_by), np.sin(turned_by)
    return np.array(xy, np.float64) @ np.array(((cos, sin), (-sin, cos)))


@pytest.mark.parametrize("turned_by", [0.0, 0.4, np.pi / 2])
def test_back_and_forth_is_one_direction(turned_by):
    ways = np.diff(main_directions(lanes(turned_by)), axis=1)[:, 0]
    axes = np.arctan2(ways[:, 1], ways[:, 0]) - turned_by
    assert len(ways) >= 8
    assert np.abs(np.sin(axes)).max() < 0.25
    assert np.hypot(*ways.T).max() <= 5.0


def test_where_nothing_runs_there_is_no_line():
    assert main_directions(np.zeros((0, 2))).shape == (0, 2, 2)
    assert main_directions(np.ones((3, 2))).shape == (0, 2, 2)
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)], np.float64)
    assert main_directions(square).shape == (0, 2, 2)


def test_a_long_path_has_few_lines():
    assert len(main_directions(lanes(lanes=250, steps=250))) <= 16 * 16


def test_regions_stay_where_they_were():
    before, after = main_directions(lanes()), main_directions(lanes()[40:])
    kept = [line for line in after.tolist() if line in before.tolist()]
    assert len(kept) >= 4
