"""The swept floor of a mission: what counts as driven, and what as floor."""

from __future__ import annotations

import math

import pytest

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.review.document import ReviewDocument
from fasaco_edge.review.figures import figures
from fasaco_edge.review.floor_and_rooms import swept_floor
from fasaco_edge.review.run_data import RunData, StatusSample
from fasaco_edge.wire.documents.replies import FloorLeft, FloorReport
from fasaco_edge.wire.documents.status import Status
from tests.support.rooms import RADIUS_M, RESOLUTION_M, TOOL_M, room

DISC_M2 = math.pi * (TOOL_M / 2) ** 2
# A lane of three metres, a pose each half metre and second.
LANE = [(0.5 + 0.5 * step, 1.5) for step in range(7)]


def told(poses, *, keep_out=(), yaw=0.0, lost_pose_s=0.0, at_s=None, **changes):
    """Return the figures of poses (x, y) in a room of 3.9 x 2.9 m, which may lie askew."""
    pixels = room(4.0, 3.0)
    geometry = GridGeometry(*pixels.shape, RESOLUTION_M, Pose2D(0.0, 0.0, yaw))
    data = RunData(
        pose_s=[float(at) for at in at_s or range(len(poses))],
        poses=[(*turned(geometry, *pose), 0.0) for pose in poses],
        grid=OccupancyGrid(geometry, pixels),
        ordered_keep_out=tuple(
            tuple(turned(geometry, *at) for at in polygon) for polygon in keep_out
        ),
        config={
            "robot": {"tool_width_m": TOOL_M, "radius_m": RADIUS_M},
            "mission": {"lost_pose_s": lost_pose_s},
        },
        **changes,
    )
    lattice = CoverageLattice.from_map(data.grid, data.footprint)
    floor = swept_floor(data, lattice)
    return floor and floor.figures


def reached(width_m, depth_m):
    """Return what the tool of a robot wider than it reaches of a rectangle [m2]; not exactly."""
    rim_m = RADIUS_M - TOOL_M / 2
    return (width_m - 2 * rim_m) * (depth_m - 2 * rim_m)


def turned(geometry, x, y):
    return geometry.to_map(x / RESOLUTION_M, y / RESOLUTION_M)


@pytest.mark.parametrize("yaw", [0.0, 0.5])
def test_a_lane_is_swept_as_wide_as_the_tool(yaw):
    figures = told(LANE, yaw=yaw)
    assert figures.swept_m2 == pytest.approx(3.0 * TOOL_M + DISC_M2, rel=0.02)
    assert figures.reachable_m2 == pytest.approx(reached(3.9, 2.9), rel=0.02)


def test_floor_under_a_jump_of_the_pose_does_not_count():
    jump = told([*LANE[:2], *LANE[4:]])
    assert jump.swept_m2 == pytest.approx(1.5 * TOOL_M + 2 * DISC_M2, rel=0.02)


def test_floor_driven_over_without_poses_does_not_count():
    at_s = [0, 1, 2, 9, 10, 11, 12]
    lost = told(LANE, at_s=at_s, lost_pose_s=3.0)
    assert lost.swept_m2 == pytest.approx(2.5 * TOOL_M + 2 * DISC_M2, rel=0.02)
    assert told(LANE, at_s=at_s).swept_m2 == told(LANE).swept_m2


def test_a_pose_astray_changes_nothing():
    astray = [*LANE[:3], (5000.0, -7000.0), *LANE[3:]]
    assert told(astray) == told(LANE)
    assert told([(5000.0, -7000.0)]) is None


@pytest.mark.parametrize("yaw", [0.0, 0.5])
def test_a_keep_out_zone_counts_as_a_wall(yaw):
    zone = ((2.0, -1.0), (2.2, -1.0), (2.2, 9.0), (2.0, 9.0))
    beyond = ((3.0, 8.0), (4.0, 8.0), (4.0, 9.0))
    figures = told([(0.5, 1.5), (1.0, 1.5)], keep_out=(zone, beyond), yaw=yaw)
    assert figures.reachable_m2 == pytest.approx(reached(1.95, 2.9), rel=0.02)
    # From where it was in the end.
    behind = told([(0.5, 1.5), (3.0, 1.5)], keep_out=(zone,), yaw=yaw)
    assert behind.reachable_m2 == pytest.approx(reached(1.75, 2.9), rel=0.02)


def test_the_last_floor_of_the_daemon_is_reported_with_reasons():
    left = (FloorLeft(0.5, "beside the path"), FloorLeft(0.25, "on the path"))
    statuses = [Status(floor=FloorReport(2.0)), Status(floor=FloorReport(3.5, 4.25, left, ()))]
    samples = [StatusSample(float(at), one) for at, one in enumerate((*statuses, Status()))]
    assert RunData(statuses=samples).ledger_floor == statuses[1].floor
    assert RunData(statuses=samples[2:]).ledger_floor is None
    by_reason = {part.reason: part.m2 for part in left}
    document = ReviewDocument(
        ledger_swept_m2=3.5, left_by_reason=by_reason, out_of_reach_by_reason={}
    )
    told = {figure.name: figure.text for figure in figures(document)}
    assert told["floor swept, by the daemon"] == "3.5 m2"
    assert told["floor left"] == "0.50 m2 beside the path; 0.25 m2 on the path"
    assert told["floor out of reach"] == "none"
