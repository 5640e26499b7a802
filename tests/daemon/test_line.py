"""A daemon as it is by default: the robot is given a line over the floor."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.judge.floor import SweepingRobot, judge_floor
from fasaco_edge.wire.messages.maps import CoverageValue, decode_occupancy_grid
from tests.daemon.test_mission import START, planned
from tests.support.outsider import joined_daemon
from tests.support.rooms import (
    RADIUS_M,
    RESOLUTION_M,
    TOOL_M,
    coverable_cells,
    drive,
    pillared_room,
    show_room,
)

ROBOT = SweepingRobot(TOOL_M, RADIUS_M, 0.25, 1.5)


def swept_by(pixels, points):
    """Return the judge's figures of a line through points (n, 2), x, y [m]."""
    rows, cols = pixels.shape
    grid = OccupancyGrid(GridGeometry(rows, cols, RESOLUTION_M, Pose2D(0.0, 0.0)), pixels)
    return judge_floor(grid, np.array([START, *points]), ROBOT).figures


def test_by_default_the_path_is_a_line_that_sweeps_the_rims(tmp_path):
    pixels = pillared_room()
    by_default = DaemonConfig().planner.line
    with joined_daemon(tmp_path, planner={"line": by_default}) as (_, outsider):
        receiver = outsider.listen("path")
        show_room(outsider, pixels, *START)
        points, _ = planned(receiver.wait(lambda heard: True))
        figures = swept_by(pixels, points)
        assert figures.illegal_share == 0.0
        # Cells beside a wall have their centre within reach of it; a line goes nearer.
        in_cells = len(coverable_cells(pixels)) * TOOL_M**2
        assert figures.swept_m2 > 1.1 * in_cells
        told = outsider.wait_status(lambda status: status["path"])["floor"]
        assert told["reachable_m2"] == pytest.approx(figures.reachable_m2, rel=0.02)
        ahead, beside = (left["m2"] for left in told["left"])
        assert ahead > 10 * beside
        way = [tuple(point) for point in points[:12].tolist()]
        drive(outsider, way)
        status = outsider.wait_status(lambda status: status["floor"]["swept_m2"] > 0.3)
        # Only while there is a subscriber: each pixel has the reason for which it is left.
        heard = outsider.listen("unswept", late=False).wait(lambda heard: True)
        grid = decode_occupancy_grid(heard.payload)
        pixels = np.bincount(grid.cells.ravel(), minlength=7) * grid.geometry.resolution**2
        narrow = sum(left["m2"] for left in status["floor"]["out_of_reach"])
        assert pixels[1:4].sum() == pytest.approx(narrow, abs=0.01)
        assert pixels[6] > 10 * pixels[5]


def test_cells_at_an_angle_are_published_in_the_map_frame(tmp_path):
    pixels = pillared_room()
    with joined_daemon(tmp_path, planner={"line": "thorough", "align": 30}) as (_, outsider):
        paths, grids = outsider.listen("path"), outsider.listen("coverage")
        show_room(outsider, pixels, *START)
        points, _ = planned(paths.wait(lambda heard: True))
        figures = swept_by(pixels, points)
        assert figures.illegal_share == 0.0
        assert figures.swept_m2 > 0.8 * figures.reachable_m2
        coverage = decode_occupancy_grid(grids.wait(lambda heard: True).payload)
        assert coverage.geometry.origin.yaw == pytest.approx(math.radians(30.0))
        rows, cols = np.nonzero(coverage.cells == CoverageValue.TO_COVER)
        assert len(rows) > 0.8 * len(coverable_cells(pixels))
        for row, col in zip((rows + 0.5).tolist(), (cols + 0.5).tolist(), strict=True):
            x, y = coverage.geometry.to_map(col, row)
            assert pixels[int(y / RESOLUTION_M), int(x / RESOLUTION_M)] == 0
        told = outsider.wait_status(lambda status: status["path"])
        assert told["map"]["lattice_deg"] == 30.0
        home = told["mission"]["home"]
        assert math.dist((home["x"], home["y"]), START) < TOOL_M
