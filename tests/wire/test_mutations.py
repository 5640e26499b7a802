"""Broken bytes: only MalformedMessage may escape a decoder, and what it reads holds together."""

from __future__ import annotations

import contextlib
import itertools
import random
import struct
import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.wire import limits, schemas
from fasaco_edge.wire.paths import decode_path
from fasaco_edge.wire.poses import POSE_SCHEMAS
from fasaco_edge.wire.tf import decode_transforms
from tests.wire.decoders import DECODERS
from tests.wire.valid_vectors import valid_vectors

MUTATIONS = 3000
ODD_NUMBERS = [0, 1, 2, 3, 4, 7, 8, 2**16, 2**24, 2**31 - 1, 2**31, 2**32 - 1]
ODD_FLOATS = [0.0, -0.0, 5e-324, 1e-42, 1e308, float("inf"), float("-inf"), float("nan")]
# A signalling NaN, and negative ones: arithmetic on them must not warn either.
ODD_BITS = [0x7FF0000000000001, 0xFFF0000000000001, 0xFFFFFFFFFFFFFFFF]

Mutation = Callable[[random.Random, bytearray], None]


def flip(rng: random.Random, payload: bytearray) -> None:
    for _ in range(rng.randint(1, 4)):
        payload[rng.randrange(len(payload))] ^= 1 << rng.randrange(8)


def overwrite(rng: random.Random, payload: bytearray) -> None:
    for _ in range(rng.randint(1, 8)):
        payload[rng.randrange(len(payload))] = rng.randrange(256)


def cut(rng: random.Random, payload: bytearray) -> None:
    at = rng.randrange(len(payload))
    del payload[at : at + rng.randint(1, 16)]


def insert(rng: random.Random, payload: bytearray) -> None:
    at = rng.randrange(len(payload))
    payload[at:at] = rng.randbytes(rng.randint(1, 16))


def append(rng: random.Random, payload: bytearray) -> None:
    payload += rng.randbytes(rng.randint(1, 16))


def edit_number(rng: random.Random, payload: bytearray) -> None:
    at = rng.randrange(4, len(payload) - 3) & ~3
    (value,) = struct.unpack_from("<I", payload, at)
    edited = rng.choice([*ODD_NUMBERS, (value + rng.choice([-8, -4, -1, 1, 4, 8])) % 2**32])
    struct.pack_into("<I", payload, at, edited)


def edit_float(rng: random.Random, payload: bytearray) -> None:
    at = 4 + (rng.randrange(0, len(payload) - 11) & ~7)
    odd = rng.choice([*(struct.pack("<d", value) for value in ODD_FLOATS), *map(uint64, ODD_BITS)])
    payload[at : at + 8] = odd


def edit_float32(rng: random.Random, payload: bytearray) -> None:
    at = rng.randrange(4, len(payload) - 3) & ~3
    payload[at : at + 4] = rng.choice(
        [b"\1\0\x80\x7f", b"\1\0\xc0\xff", b"\0\0\x80\x7f", b"\1\0\0\0"]
    )


def uint64(bits: int) -> bytes:
    return struct.pack("<Q", bits)


KINDS: tuple[Mutation, ...] = (
    flip,
    overwrite,
    cut,
    insert,
    append,
    edit_number,
    edit_float,
    edit_float32,
)


def check_sound(message: object) -> None:
    """Check that what came through holds what the contract promises."""
    if isinstance(message, tuple):
        for transform in message:
            place = transform.planar()
            assert max(abs(place.x), abs(place.y)) <= 1e6
            assert abs(place.yaw) <= np.pi
            assert max(len(transform.frame.encode()), len(transform.child.encode())) <= 256
        return
    cells = getattr(message, "cells", None)
    if cells is not None:
        assert cells.size > 0
        assert cells.min() >= -1
        assert cells.max() <= 100
    geometry = getattr(message, "geometry", None)
    if geometry is not None:
        assert 1e-4 <= geometry.resolution <= 100
        assert np.isfinite([geometry.origin.x, geometry.origin.y, geometry.origin.yaw]).all()
    pose = getattr(message, "pose", None)
    if pose is not None:
        assert max(abs(pose.x), abs(pose.y)) <= 1e6
        assert abs(pose.yaw) <= np.pi
    if hasattr(message, "xy"):
        assert np.isfinite(message.xy).all()
        assert np.isfinite(message.yaw).all()
        assert message.xy.shape == (len(message.yaw), 2)
    assert len(message.frame.encode()) <= 256  # type: ignore[attr-defined]


@pytest.mark.parametrize("schema", DECODERS)
def test_mutations_raise_only_malformed_message(schema: str) -> None:
    rng = random.Random(schema)
    seeds = [vector.payload for vector in valid_vectors() if vector.schema == schema]
    refused = 0
    for _ in range(MUTATIONS):
        payload = bytearray(rng.choice(seeds))
        for mutate in rng.choices(KINDS, k=rng.choice([1, 1, 1, 2, 3])):
            if len(payload) > 16:
                mutate(rng, payload)
        try:
            check_sound(DECODERS[schema](bytes(payload)))
        except MalformedMessage:
            refused += 1
    assert MUTATIONS // 4 < refused < MUTATIONS


@settings(max_examples=200, deadline=None)
@given(payload=st.binary(max_size=200), schema=st.sampled_from(sorted(DECODERS)))
def test_noise_is_refused(payload: bytes, schema: str) -> None:
    for noise in (payload, b"\0\1\0\0" + payload):
        if schema == schemas.TF_MESSAGE and noise[4:8] == bytes(4):
            continue  # so begins a message without transforms
        with pytest.raises(MalformedMessage):
            DECODERS[schema](noise)


@pytest.mark.parametrize("schema", DECODERS)
def test_a_message_of_another_type_is_refused(schema: str) -> None:
    for vector in valid_vectors():
        if vector.schema != schema:
            with pytest.raises(MalformedMessage):
                DECODERS[schema](vector.payload)


@pytest.mark.parametrize("schema", [*DECODERS])
def test_no_more_memory_than_the_payload_justifies(schema: str) -> None:
    payloads = [bytearray(v.payload) for v in valid_vectors() if v.schema == schema]
    tracemalloc.start()
    try:
        for payload in payloads:
            places = range(4, len(payload) - 3, 4)
            for at, lie in itertools.product(places, (900_000, 2**31 - 1, 2**32 - 1)):
                lying = bytearray(payload)
                struct.pack_into("<I", lying, at, lie)
                tracemalloc.reset_peak()
                before = tracemalloc.get_traced_memory()[0]
                with contextlib.suppress(MalformedMessage):
                    DECODERS[schema](bytes(lying))
                assert tracemalloc.get_traced_memory()[1] - before < 64_000
    finally:
        tracemalloc.stop()


def test_limits_on_size_are_the_callers_to_lower() -> None:
    seeds = {vector.name: vector.payload for vector in valid_vectors()}
    for name, schema in (
        ("occupancy_grid", schemas.OCCUPANCY_GRID),
        ("occupancy_grid_update", schemas.OCCUPANCY_GRID_UPDATE),
    ):
        DECODERS[schema](seeds[name], max_cells=15)  # type: ignore[call-arg]
        with pytest.raises(MalformedMessage, match=r"length of data must be 1\.\.14, got 15"):
            DECODERS[schema](seeds[name], max_cells=14)  # type: ignore[call-arg]
    decode_path(seeds["path"], max_poses=4)
    with pytest.raises(MalformedMessage, match="length of poses must be at most 3, got 4"):
        decode_path(seeds["path"], max_poses=3)


def test_a_pose_must_come_in_a_known_type() -> None:
    payload = valid_vectors()[0].payload
    for schema in ("", "geometry_msgs/msg/Pose", schemas.PATH):
        with pytest.raises(MalformedMessage, match="a pose must come as one of") as caught:
            DECODERS[POSE_SCHEMAS[0]](payload, schema=schema)  # type: ignore[call-arg]
        assert repr(schema) in str(caught.value)


def test_a_tf_message_has_so_many_transforms_and_no_more() -> None:
    (seed,) = (v.payload for v in valid_vectors() if v.name == "tf_without_names")
    # Each after the first is 80 bytes: no padding before its floats.
    one = bytes(8) + struct.pack("<I", 1) + bytes(4) + struct.pack("<I", 1) + bytes(4) + seed[-56:]
    for count in (limits.MAX_TRANSFORMS, limits.MAX_TRANSFORMS + 1):
        payload = seed[:4] + struct.pack("<I", count) + seed[8:] + one * (count - 1)
        if count == limits.MAX_TRANSFORMS:
            assert len(decode_transforms(payload)) == count
        else:
            with pytest.raises(MalformedMessage, match="transforms must be at most 4096, got 4097"):
                decode_transforms(payload)
