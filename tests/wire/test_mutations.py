"""Broken bytes: only MalformedMessage may escape a decoder, and what it reads holds together."""

from __future__ import annotations

import itertools
import random
import struct
import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.occupancy import MapPatch
from fasaco_edge.wire import limits, schemas
from fasaco_edge.wire.messages import path_points
from fasaco_edge.wire.messages.maps import encode_map_update
from fasaco_edge.wire.messages.paths import decode_path, encode_path
from fasaco_edge.wire.messages.poses import decode_transforms
from fasaco_edge.wire.schemas import POSE_SCHEMAS
from tests.support.examples import examples
from tests.wire.decoders import DECODERS
from tests.wire.mutations import mutant, seeds_of
from tests.wire.soundness import is_read, peak_bytes
from tests.wire.vectors import vectors

MUTATIONS = 3000


@pytest.mark.parametrize("schema", DECODERS)
def test_mutations_raise_only_malformed_message(schema: str) -> None:
    rng, seeds = random.Random(schema), seeds_of(schema)
    refused = sum(not is_read(schema, mutant(rng, seeds)) for _ in range(MUTATIONS))
    assert MUTATIONS // 4 < refused < MUTATIONS


@examples(200)
@given(payload=st.binary(max_size=200), schema=st.sampled_from(sorted(DECODERS)))
def test_noise_is_refused(payload: bytes, schema: str) -> None:
    for noise in (payload, b"\0\1\0\0" + payload):
        if schema == schemas.TF_MESSAGE and noise[4:8] == bytes(4):
            continue  # so begins a message without transforms
        with pytest.raises(MalformedMessage):
            DECODERS[schema](noise)


@pytest.mark.parametrize("schema", DECODERS)
def test_a_message_of_another_type_is_refused(schema: str) -> None:
    for vector in vectors("valid"):
        if vector.schema != schema:
            with pytest.raises(MalformedMessage):
                DECODERS[schema](vector.payload)


@pytest.mark.parametrize("schema", [*DECODERS])
def test_no_more_memory_than_the_payload_justifies(schema: str) -> None:
    tracemalloc.start()
    try:
        for payload in seeds_of(schema):
            places = range(4, len(payload) - 3, 4)
            for at, lie in itertools.product(places, (900_000, 2**31 - 1, 2**32 - 1)):
                lying = bytearray(payload)
                struct.pack_into("<I", lying, at, lie)
                peak_bytes(schema, bytes(lying))
    finally:
        tracemalloc.stop()


def test_large_messages_take_no_more_memory_than_they_justify() -> None:
    poses, cells = np.zeros((20_000, 2)), np.zeros((1000, 1000), np.int8)
    grid = encode_map_update(MapPatch(Window(0, 0, 1000, 1000), cells))
    stray = encode_path(poses, poses[:, 0], "map", 0)[:-8] + bytes(8)
    tracemalloc.start()
    try:
        assert peak_bytes(schemas.OCCUPANCY_GRID_UPDATE, grid) < 8192
        peak_bytes(schemas.OCCUPANCY_GRID_UPDATE, grid[:-1] + b"\x80")
        assert peak_bytes(schemas.PATH, encode_path(poses, poses[:, 0], "map", 0)) > 20_000 * 24
        peak_bytes(schemas.PATH, stray)
    finally:
        tracemalloc.stop()


def test_limits_on_size_are_the_callers_to_lower() -> None:
    seeds = {vector.name: vector.payload for vector in vectors("valid")}
    for name, schema in (
        ("occupancy_grid", schemas.OCCUPANCY_GRID),
        ("occupancy_grid_update", schemas.OCCUPANCY_GRID_UPDATE),
    ):
        DECODERS[schema](seeds[name], max_cells=15)  # type: ignore[call-arg]
        with pytest.raises(MalformedMessage, match=r"length of data must be 1\.\.14, got 15"):
            DECODERS[schema](seeds[name], max_cells=14)  # type: ignore[call-arg]


def test_the_number_of_poses_of_a_path_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    (seed,) = (vector.payload for vector in vectors("valid") if vector.name == "path")
    monkeypatch.setattr(path_points, "MAX_PATH_POSES", 4)
    decode_path(seed)
    monkeypatch.setattr(path_points, "MAX_PATH_POSES", 3)
    with pytest.raises(MalformedMessage, match="length of poses must be at most 3, got 4"):
        decode_path(seed)


def test_a_pose_must_come_in_a_known_type() -> None:
    payload = vectors("valid")[0].payload
    for schema in ("", "geometry_msgs/msg/Pose", schemas.PATH):
        with pytest.raises(MalformedMessage, match="a pose must come as one of") as caught:
            DECODERS[POSE_SCHEMAS[0]](payload, schema=schema)  # type: ignore[call-arg]
        assert repr(schema) in str(caught.value)


def test_the_number_of_transforms_of_a_message_is_limited() -> None:
    (seed,) = (v.payload for v in vectors("valid") if v.name == "tf_without_names")
    # Each after the first is 80 bytes: no padding before its floats.
    one = bytes(8) + struct.pack("<I", 1) + bytes(4) + struct.pack("<I", 1) + bytes(4) + seed[-56:]
    for count in (limits.MAX_TRANSFORMS, limits.MAX_TRANSFORMS + 1):
        payload = seed[:4] + struct.pack("<I", count) + seed[8:] + one * (count - 1)
        if count == limits.MAX_TRANSFORMS:
            assert len(decode_transforms(payload)) == count
        else:
            with pytest.raises(MalformedMessage, match="transforms must be at most 4096, got 4097"):
                decode_transforms(payload)
