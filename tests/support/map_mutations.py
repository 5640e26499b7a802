"""Payloads that are nearly messages: good ones damaged until no decoder should take them."""

from __future__ import annotations

import random
from collections.abc import Callable

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.wire.messages.maps import decode_map_update, decode_occupancy_grid
from fasaco_edge.wire.messages.poses import decode_pose
from fasaco_edge.wire.schemas import POSE_STAMPED
from tests.support.rooms import map_bytes, pillared_room, pose_bytes, update_bytes
from tests.wire import mutations

GOOD = {
    "map": map_bytes(pillared_room()),
    "map_update": update_bytes(pillared_room(), 1.0, 1.0, 2.0, 2.0),
    "pose": pose_bytes(0.75, 0.75),
}
REFUSES: dict[str, Callable[[bytes], object]] = {
    "map": decode_occupancy_grid,
    "map_update": decode_map_update,
    "pose": lambda payload: decode_pose(payload, POSE_STAMPED),
}
# Most of a map is cells, where little can go wrong: half of the damage is done before them.
HEAD_BYTES = 96


def mutant(rng: random.Random, kind: str) -> bytes:
    """Return a damaged message of a kind that our decoder refuses.

    Some damage leaves a valid message, a map with another wall, say: those are not
    returned, since a daemon is right to follow them.
    """
    while True:
        payload = rng.choice((_nearly, _nearly, _nothing_like))(rng, kind)
        if not _is_valid(kind, payload):
            return payload


def _nearly(rng: random.Random, kind: str) -> bytes:
    """Return a message of that kind, damaged once or a few times."""
    good = GOOD[kind]
    head = rng.choice((HEAD_BYTES, len(good)))
    return mutations.mutant(rng, [good[:head]]) + good[head:]


def _nothing_like(rng: random.Random, kind: str) -> bytes:
    """Return nothing, noise, noise behind a header of CDR, or some whole message."""
    noise = rng.randbytes(rng.choice((1, 4, 40, 400, 100_000)))
    return rng.choice((b"", noise, b"\0\1\0\0" + noise, GOOD[rng.choice(sorted(GOOD))]))


def _is_valid(kind: str, payload: bytes) -> bool:
    try:
        REFUSES[kind](payload)
    except MalformedMessage:
        return False
    return True
