"""Calm of a line: figures of lines that can be counted by hand."""

from __future__ import annotations

import numpy as np
import pytest

from tests.benchmarks.calm import calm_of


def test_lanes_along_the_walls_are_calm():
    lanes = np.array([(0, 0), (4, 0), (4, 0.3), (0, 0.3), (0, 0.6), (4, 0.6)], float)
    calm = calm_of(lanes, 2.0, 90.0)
    assert calm.turning_deg == pytest.approx(4 * 90 / 2)
    assert (calm.turns_back, calm.crossings, calm.along_share) == (0.0, 0.0, 1.0)


def test_a_star_is_not():
    angles = np.radians([90 + 144 * tip for tip in range(6)])
    star = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    calm = calm_of(star, 1.0, 0.0)
    assert calm.crossings == 5.0
    assert calm.turns_back == 4.0
    assert calm.along_share == pytest.approx(0.2)


def test_a_way_there_and_back_crosses_nothing():
    calm = calm_of(np.array([(0, 0), (1, 0), (1, 0), (0.875, 0), (1.25, 1)], float), 1.0, 0.0)
    assert (calm.crossings, calm.turns_back) == (0.0, 1.0)
