"""Damaged messages, which every decoder should refuse."""

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
# Half of the damage is done in the head: the cells, most of a map, have few invalid values.
HEAD_BYTES = 96


def mutant(rng: random.Random, kind: str) -> bytes:
    """Return a damaged message of a kind.

    Damage that leaves a valid message, for example a map with another wall, is discarded.
    """
    while True:
        payload = rng.choice((_nearly, _nearly, _nothing_like))(rng, kind)
        if not _is_valid(kind, payload):
            return payload


def _nearly(rng: random.Random, kind: str) -> bytes:
    """Return a message of this kind, damaged at one or a few places."""
    good = GOOD[kind]
    head = rng.choice((HEAD_BYTES, len(good)))
    return mutations.mutant(rng, [good[:head]]) + good[head:]


def _nothing_like(rng: random.Random, kind: str) -> bytes:
    """Return nothing, noise, noise after a CDR header, or a valid message of any kind."""
    noise = rng.randbytes(rng.choice((1, 4, 40, 400, 100_000)))
    return rng.choice((b"", noise, b"\0\1\0\0" + noise, GOOD[rng.choice(sorted(GOOD))]))


def _is_valid(kind: str, payload: bytes) -> bool:
    try:
        REFUSES[kind](payload)
    except MalformedMessage:
        return False
    return True
