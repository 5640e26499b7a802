"""Byte for byte what another CDR library writes, and read back by it."""

from __future__ import annotations

import numpy as np
import pytest

from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose, Window
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.planners.planner import ColonySnapshot
from fasaco_edge.wire import schemas
from fasaco_edge.wire.messages.maps import (
    decode_map_update,
    decode_occupancy_grid,
    encode_map_update,
    encode_occupancy_grid,
)
from fasaco_edge.wire.messages.paths import decode_path, encode_path
from fasaco_edge.wire.messages.pheromone import decode_pheromone, encode_pheromone
from fasaco_edge.wire.messages.poses import (
    Transform,
    decode_pose,
    decode_transforms,
    encode_pose_stamped,
)
from tests.wire import oracle

STAMP_NS = 1_700_000_000_987_654_321
SHAPES = ((1, 1), (1, 7), (3, 5), (8, 8), (40, 41))
STAMPED = StampedPose(Pose2D(1.25, -3.5, 2.5), "map", STAMP_NS)

each_frame = pytest.mark.parametrize("frame", oracle.FRAMES)


def random_cells(shape: tuple[int, int]) -> np.ndarray:
    return np.random.default_rng(sum(shape)).integers(-1, 101, shape).astype(np.int8)


@each_frame
@pytest.mark.parametrize("shape", SHAPES)
def test_an_occupancy_grid_equals_that_of_rosbags(frame: str, shape: tuple[int, int]) -> None:
    geometry = GridGeometry(*shape, 0.05, Pose2D(-12.5, 3.25, 0.7))
    cells = random_cells(shape)
    theirs = oracle.to_bytes(
        schemas.OCCUPANCY_GRID, oracle.occupancy_grid(frame, STAMP_NS, geometry, cells)
    )
    grid = decode_occupancy_grid(theirs)
    assert encode_occupancy_grid(OccupancyGrid(geometry, cells, frame, STAMP_NS)) == theirs
    assert (grid.frame, grid.stamp_ns) == (frame, STAMP_NS)
    assert (grid.geometry.rows, grid.geometry.cols) == shape
    assert grid.geometry.resolution == 0.05
    assert grid.geometry.origin.yaw == pytest.approx(0.7, abs=1e-15)
    np.testing.assert_array_equal(grid.cells, cells)


@each_frame
@pytest.mark.parametrize("shape", SHAPES)
def test_a_map_update_equals_that_of_rosbags(frame: str, shape: tuple[int, int]) -> None:
    cells = random_cells(shape)
    theirs = oracle.to_bytes(
        schemas.OCCUPANCY_GRID_UPDATE, oracle.update(frame, STAMP_NS, (9, 2), cells)
    )
    patch = decode_map_update(theirs)
    assert patch.window == Window(2, 9, 2 + shape[0], 9 + shape[1])
    assert (patch.frame, patch.stamp_ns) == (frame, STAMP_NS)
    np.testing.assert_array_equal(patch.cells, cells)
    assert encode_map_update(MapPatch(patch.window, cells, frame, STAMP_NS)) == theirs


@each_frame
def test_poses_equal_those_of_rosbags(frame: str) -> None:
    stamped = StampedPose(STAMPED.pose, frame, STAMP_NS)
    where, child = oracle.pose(stamped.pose), f"{frame[:250]}/base"
    spread, twist = np.arange(36) / 7, np.arange(6) / 3
    theirs = {
        schemas.POSE_STAMPED: oracle.pose_stamped(frame, STAMP_NS, where),
        schemas.POSE_WITH_COVARIANCE_STAMPED: oracle.pose_with_covariance_stamped(
            frame, STAMP_NS, where, spread
        ),
        schemas.ODOMETRY: oracle.odometry(frame, STAMP_NS, child, where, spread, twist, 2 * spread),
    }
    payloads = {schema: oracle.to_bytes(schema, message) for schema, message in theirs.items()}
    assert encode_pose_stamped(stamped) == payloads[schemas.POSE_STAMPED]
    for schema, payload in payloads.items():
        decoded = decode_pose(payload, schema)
        assert (decoded.frame, decoded.stamp_ns) == (frame, STAMP_NS)
        assert (decoded.pose.x, decoded.pose.y) == (1.25, -3.5)
        assert decoded.pose.yaw == pytest.approx(2.5, abs=1e-15)


@each_frame
@pytest.mark.parametrize("count", [0, 1, 2, 3, 57])
def test_transforms_equal_those_of_rosbags(frame: str, count: int) -> None:
    rng = np.random.default_rng(count)
    expected = []
    for child in (*oracle.FRAMES, *map(str, range(count)))[:count]:
        x, y, yaw = rng.uniform(-3.0, 3.0, 3).tolist()
        where = oracle.pose(Pose2D(x, y, yaw))
        expected.append((frame, child, STAMP_NS + count, where))
    payload = oracle.to_bytes(schemas.TF_MESSAGE, oracle.transforms(*expected))
    found = decode_transforms(payload)
    for transform, (_, child, stamp_ns, where) in zip(found, expected, strict=True):
        turn, at = where.orientation, where.position
        floats = (at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w)
        assert transform == Transform(frame, child, stamp_ns, floats)
        place = transform.planar()
        assert (place.x, place.y) == (at.x, at.y)
        assert place.yaw == pytest.approx(2 * np.arctan2(turn.z, turn.w), abs=1e-14)


@each_frame
@pytest.mark.parametrize("count", [0, 1, 2, 3, 57])
def test_a_path_equals_that_of_rosbags(frame: str, count: int) -> None:
    rng = np.random.default_rng(count)
    xy, yaw = rng.normal(scale=30.0, size=(count, 2)), rng.uniform(-3.0, 3.0, count)
    poses = [
        (frame, STAMP_NS, oracle.pose(Pose2D(float(x), float(y), float(turn))))
        for (x, y), turn in zip(xy, yaw, strict=True)
    ]
    theirs = oracle.to_bytes(schemas.PATH, oracle.path(frame, STAMP_NS, poses))
    assert encode_path(xy, yaw, frame, STAMP_NS) == theirs
    path = decode_path(theirs)
    assert (path.frame, path.stamp_ns) == (frame, STAMP_NS)
    np.testing.assert_array_equal(path.xy, xy)
    np.testing.assert_allclose(path.yaw, yaw, atol=1e-14)


@each_frame
@pytest.mark.parametrize("shape", SHAPES)
def test_a_pheromone_grid_equals_that_of_rosbags(frame: str, shape: tuple[int, int]) -> None:
    rows, cols = shape
    trail = np.random.default_rng(rows).lognormal(sigma=2.0, size=shape).astype(np.float32)
    snapshot = ColonySnapshot(Window(-4, 6, rows - 4, cols + 6), 0.3, trail, 3, 8, 192, 4711)
    ours = encode_pheromone(snapshot, frame, STAMP_NS)
    theirs = oracle.from_bytes(schemas.PHEROMONE_GRID, ours)
    assert oracle.to_bytes(schemas.PHEROMONE_GRID, theirs) == ours
    assert (theirs.cohort, theirs.velocity, theirs.ants, theirs.best_steps) == (3, 8, 192, 4711)
    assert (theirs.trail_min, theirs.trail_max) == (trail.min(), trail.max())
    assert (theirs.info.width, theirs.info.height) == (cols, rows)
    assert theirs.info.origin.position.x == pytest.approx(1.8)
    assert theirs.info.origin.position.y == pytest.approx(-1.2)
    assert theirs.header.frame_id == frame
    message = decode_pheromone(ours)
    assert (message.frame, message.stamp_ns, message.best_steps) == (frame, STAMP_NS, 4711)
    np.testing.assert_array_equal(message.levels.ravel(), theirs.levels)
