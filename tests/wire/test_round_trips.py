"""What is encoded is what is decoded, and what would not be decoded is not encoded."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.wire import schemas
from fasaco_edge.wire.messages.maps import (
    decode_occupancy_grid,
    encode_map_update,
    encode_occupancy_grid,
)
from fasaco_edge.wire.messages.paths import decode_path, encode_path
from fasaco_edge.wire.messages.poses import decode_pose
from tests.support.examples import examples
from tests.wire import oracle

coordinates = st.floats(-2e7, 2e7)
yaws = st.floats(-math.pi, math.pi)
poses = st.builds(Pose2D, coordinates, coordinates, yaws)
stamps = st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1)
frames = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=64)

some = examples(80)


def same_angle(a: float, b: float) -> bool:
    return math.isclose(math.remainder(a - b, math.tau), 0.0, abs_tol=1e-14)


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
