"""What is encoded is what is decoded, and what would not be decoded is not encoded."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose, Window
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.wire import schemas
from fasaco_edge.wire.messages.maps import (
    decode_map_update,
    decode_occupancy_grid,
    encode_map_update,
    encode_occupancy_grid,
)
from fasaco_edge.wire.messages.paths import decode_path, encode_path
from fasaco_edge.wire.messages.poses import decode_pose, encode_pose_stamped
from tests.support.examples import examples
from tests.wire import oracle

coordinates = st.floats(-2e7, 2e7)
yaws = st.floats(-math.pi, math.pi)
poses = st.builds(Pose2D, coordinates, coordinates, yaws)
stamps = st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1)
frames = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=64)
# Millimetres, as people write resolutions; each is the shortest decimal of its float32.
resolutions = st.integers(1, 99_999).map(lambda millimetres: millimetres / 1000)
shapes = hnp.array_shapes(min_dims=2, max_dims=2, max_side=12)
cell_values = st.integers(-1, 100)

some = examples(80)


@st.composite
def grids(draw: Any) -> OccupancyGrid:
    cells = draw(hnp.arrays(np.int8, shapes, elements=cell_values))
    geometry = GridGeometry(*cells.shape, draw(resolutions), draw(poses))
    return OccupancyGrid(geometry, cells, draw(frames), draw(stamps))


def same_angle(a: float, b: float) -> bool:
    return math.isclose(math.remainder(a - b, math.tau), 0.0, abs_tol=1e-14)


@some
@given(grids())
def test_a_decoded_occupancy_grid_equals_the_encoded_one(grid: OccupancyGrid) -> None:
    payload = encode_occupancy_grid(grid)
    again = decode_occupancy_grid(payload)
    assert (again.frame, again.stamp_ns) == (grid.frame, grid.stamp_ns)
    assert again.geometry.resolution == grid.geometry.resolution
    ours, theirs = again.geometry.origin, grid.geometry.origin
    assert (ours.x, ours.y) == (theirs.x, theirs.y)
    assert same_angle(ours.yaw, theirs.yaw)
    np.testing.assert_array_equal(again.cells, grid.cells)


@some
@given(grids(), st.integers(-(2**31), 2**31 - 1), st.integers(-(2**31), 2**31 - 1))
def test_a_decoded_map_update_equals_the_encoded_one(
    grid: OccupancyGrid, row: int, col: int
) -> None:
    rows, cols = grid.cells.shape
    window = Window(row, col, row + rows, col + cols)
    patch = MapPatch(window, grid.cells, grid.frame, grid.stamp_ns)
    again = decode_map_update(encode_map_update(patch))
    assert (again.window, again.frame, again.stamp_ns) == (window, grid.frame, grid.stamp_ns)
    np.testing.assert_array_equal(again.cells, grid.cells)


@some
@given(poses, frames, stamps)
def test_decoded_poses_equal_the_encoded_ones(pose: Pose2D, frame: str, stamp_ns: int) -> None:
    payload = encode_pose_stamped(StampedPose(pose, frame, stamp_ns))
    again = decode_pose(payload, schemas.POSE_STAMPED)
    assert (again.frame, again.stamp_ns) == (frame, stamp_ns)
    assert (again.pose.x, again.pose.y) == (pose.x, pose.y)
    assert same_angle(again.pose.yaw, pose.yaw)


@some
@given(st.lists(poses, max_size=8), frames, stamps)
def test_a_decoded_path_equals_the_encoded_one(
    walk: list[Pose2D], frame: str, stamp_ns: int
) -> None:
    xy = np.array([[pose.x, pose.y] for pose in walk]).reshape(-1, 2)
    yaw = np.array([pose.yaw for pose in walk])
    path = decode_path(encode_path(xy, yaw, frame, stamp_ns))
    assert (path.frame, path.stamp_ns) == (frame, stamp_ns)
    np.testing.assert_array_equal(path.xy, xy)
    assert all(same_angle(a, b) for a, b in zip(path.yaw, yaw, strict=True))


@some
@given(st.lists(st.tuples(st.booleans(), stamps, poses), max_size=8), frames)
def test_path_whose_poses_differ_in_header(
    walk: list[tuple[bool, int, Pose2D]], frame: str
) -> None:
    named = [(frame if own else "", stamp, oracle.pose(pose)) for own, stamp, pose in walk]
    payload = oracle.to_bytes(schemas.PATH, oracle.path(frame, 5, named))
    path = decode_path(payload)
    assert path.frame == frame
    np.testing.assert_array_equal(path.xy.ravel(), [v for *_, p in walk for v in (p.x, p.y)])
    assert all(same_angle(a, p.yaw) for a, (*_, p) in zip(path.yaw, walk, strict=True))


def test_decoded_arrays_are_read_only_and_the_cells_a_view() -> None:
    payload = encode_occupancy_grid(plain_grid())
    cells = decode_occupancy_grid(payload).cells
    assert not cells.flags.writeable
    assert not cells.flags.owndata
    assert np.shares_memory(cells, np.frombuffer(payload, np.uint8))
    path = decode_path(encode_path(np.ones((3, 2)), np.ones(3), "map", 0))
    assert not path.xy.flags.writeable
    assert not path.yaw.flags.writeable
    assert path.xy.flags.c_contiguous


def test_a_turn_in_space_has_the_yaw_of_its_heading() -> None:
    # A robot on a ramp: yaw 1.0 after pitch 0.2; its x axis points along the heading.
    z, y = math.sin(0.5), math.sin(0.1)
    cz, cy = math.cos(0.5), math.cos(0.1)
    message = oracle.pose_stamped("map", 0, oracle.pose(Pose2D(0.0, 0.0)))
    turn = oracle.make("geometry_msgs/msg/Quaternion", x=-z * y, y=cz * y, z=z * cy, w=cz * cy)
    for scale in (1.0, 0.992, 1.008):
        scaled = {axis: getattr(turn, axis) * scale for axis in "xyzw"}
        message.pose.orientation = oracle.make("geometry_msgs/msg/Quaternion", **scaled)
        payload = oracle.to_bytes(schemas.POSE_STAMPED, message)
        assert decode_pose(payload, schemas.POSE_STAMPED).pose.yaw == pytest.approx(1.0, abs=1e-12)


def plain_grid(**changes: Any) -> OccupancyGrid:
    cells = changes.pop("cells", np.zeros((2, 3), np.int8))
    geometry = GridGeometry(
        *cells.shape, changes.pop("resolution", 0.05), changes.pop("origin", Pose2D(0.0, 0.0))
    )
    return OccupancyGrid(geometry, cells, **changes)


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"frame": "f" * 257}, "header.frame_id"),
        ({"frame": "ß" * 129}, "header.frame_id"),
        ({"frame": "a\0b"}, "header.frame_id"),
        ({"frame": "\ud800"}, "header.frame_id"),
        ({"stamp_ns": 2**31 * 10**9}, "header.stamp.sec"),
        ({"resolution": math.nan}, "info.resolution"),
        ({"resolution": 0.0}, "info.resolution"),
        ({"origin": Pose2D(0.0, 2.1e7)}, "info.origin.position.y"),
        ({"origin": Pose2D(0.0, 0.0, math.inf)}, "info.origin.orientation"),
        ({"cells": np.zeros((0, 3), np.int8)}, "length of data"),
        ({"cells": np.full((1, 1), 101, np.int8)}, "data at row 0, column 0"),
    ],
)
def test_a_grid_that_readers_would_refuse_is_not_sent(changes: dict[str, Any], field: str) -> None:
    with pytest.raises(MalformedMessage) as caught:
        encode_occupancy_grid(plain_grid(**changes))
    assert field in str(caught.value)


def test_arrays_of_the_wrong_shape_are_not_sent() -> None:
    with pytest.raises(MalformedMessage, match="poses must be"):
        encode_path(np.zeros((3, 2)), np.zeros(2), "map", 0)
    with pytest.raises(MalformedMessage, match="data must be"):
        encode_map_update(MapPatch(Window(0, 0, 2, 2), np.zeros((2, 3), np.int8)))
    with pytest.raises(MalformedMessage, match=r"poses\[1\].pose.position.y"):
        encode_path(np.array([[0.0, 0.0], [0.0, np.nan]]), np.zeros(2), "map", 0)
