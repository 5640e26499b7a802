"""Arrows along a trail: a run of cells that point the same way is one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.rotation import rotated_points
from fasaco_edge.recording.scene.flows import flows_of

EDGE = 0.5


def of(rows):
    """Geometry from (1, 2) m on, directions and shares of rows of letters, the lowest first."""
    pointed = np.array([["ENWS.".index(letter.upper()) for letter in row] for row in rows])
    sure = np.array([[0.9 if letter.isupper() else 0.4 for letter in row] for row in rows])
    pointed = np.where(pointed == 4, -1, pointed).astype(np.int8)
    geometry = GridGeometry(len(rows), len(rows[0]), EDGE, Pose2D(1.0, 2.0))
    return geometry, pointed, np.where(pointed < 0, 0, sure).astype(np.float32)


def arrows(*rows):
    """Arrows as (column, row, columns on, rows on), in cells, sorted."""
    flows = flows_of(*of(rows))
    begin = (flows.origins - (1.0, 2.0)) / EDGE - 0.5
    found = np.column_stack((begin, flows.vectors / EDGE)).round(6) + 0.0
    return sorted(map(tuple, found.tolist()))


def test_a_lane_is_an_arrow_and_so_is_the_way_back():
    assert arrows("EEEN", "WWWW") == [(0, 0, 3, 0), (3, 0, 0, 1), (3, 1, -4, 0)]
    assert arrows("N", "N", ".", "S") == [(0, 0, 0, 2), (0, 3, 0, -1)]


def test_arrows_follow_the_angle_of_the_cells():
    geometry, pointed, share = of(["EEEN", "WWWW"])
    straight, askew = (
        flows_of(replace(geometry, origin=Pose2D(1.0, 2.0, yaw)), pointed, share)
        for yaw in (0.0, math.radians(25.0))
    )
    assert askew.vectors == pytest.approx(rotated_points(straight.vectors, 25.0))
    there = rotated_points(straight.origins - (1.0, 2.0), 25.0)
    assert askew.origins - (1.0, 2.0) == pytest.approx(there)


def test_a_lane_is_cut_where_it_is_less_decided():
    assert arrows("EEee") == [(0, 0, 2, 0), (2, 0, 2, 0)]
    geometry, pointed, share = of(["EEee"])
    assert flows_of(geometry, pointed, share).share.tolist() == np.float32([0.9, 0.4]).tolist()


def test_a_cell_of_equal_directions_has_no_arrow():
    geometry, pointed, share = of(["EE"])
    share[0, 0] = 0.25
    assert len(flows_of(geometry, pointed, share).origins) == 1
    assert not len(flows_of(geometry, np.full((2, 2), -1, np.int8), np.zeros((2, 2))).origins)
