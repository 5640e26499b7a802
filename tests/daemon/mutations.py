"""Payloads that are nearly messages: good ones damaged until no decoder should take them."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.wire.maps import decode_map_update, decode_occupancy_grid
from fasaco_edge.wire.poses import decode_pose
from fasaco_edge.wire.schemas import POSE_STAMPED
from tests.daemon.rooms import map_bytes, pillared_room, pose_bytes, update_bytes

Damage = Callable[[random.Random, bytearray], object]
LIES = (0, 1, 2**16, 2**24, 2**31 - 1, 2**31, 2**32 - 1)

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


def mutant(rng: random.Random, kind: str) -> bytes:
    """Return a damaged message of a kind that our decoder refuses.

    Some damage leaves a valid message, a map with another wall, say: those are not
    returned, since a daemon is right to follow them.
    """
    while True:
        payload = bytearray(GOOD[kind])
        for damage in rng.choices(DAMAGES, k=rng.choice((1, 1, 2, 3))):
            damage(rng, payload)
        if not _is_valid(kind, bytes(payload)):
            return bytes(payload)


def _flip_bits(rng: random.Random, payload: bytearray) -> None:
    for _ in range(rng.randint(1, 8)):
        if payload:
            # Most of a map is cells, where little can go wrong: prefer what is before them.
            end = min(len(payload), rng.choice((16, 96, len(payload))))
            payload[rng.randrange(end)] ^= 1 << rng.randrange(8)


def _cut(rng: random.Random, payload: bytearray) -> None:
    del payload[rng.randrange(len(payload) + 1) :]


def _cut_out(rng: random.Random, payload: bytearray) -> None:
    at = rng.randrange(len(payload) + 1)
    del payload[at : at + rng.randint(1, 64)]


def _lie(rng: random.Random, payload: bytearray) -> None:
    if len(payload) >= 8:
        at = 4 * rng.randrange(1, min(len(payload) // 4, 30))
        struct.pack_into("<I", payload, at, rng.choice(LIES))


def _lie_in_floats(rng: random.Random, payload: bytearray) -> None:
    if len(payload) >= 12:
        at = 4 + 8 * rng.randrange(min((len(payload) - 4) // 8, 15))
        value = rng.choice((float("nan"), float("inf"), -float("inf"), 1e300, 5e-324))
        struct.pack_into("<d", payload, at, value)


def _append(rng: random.Random, payload: bytearray) -> None:
    payload += rng.randbytes(rng.choice((1, 3, 4, 100, 10_000)))


def _noise(rng: random.Random, payload: bytearray) -> None:
    payload[:] = rng.randbytes(rng.choice((1, 4, 40, 400, 100_000)))


def _noise_behind_header(rng: random.Random, payload: bytearray) -> None:
    payload[:] = b"\0\1\0\0" + rng.randbytes(rng.choice((4, 40, 400)))


def _empty(rng: random.Random, payload: bytearray) -> None:
    payload.clear()


def _another_message(rng: random.Random, payload: bytearray) -> None:
    payload[:] = GOOD[rng.choice(sorted(GOOD))]


DAMAGES: tuple[Damage, ...] = (
    _flip_bits,
    _cut,
    _cut_out,
    _lie,
    _lie_in_floats,
    _append,
    _noise,
    _noise_behind_header,
    _empty,
    _another_message,
)


def _is_valid(kind: str, payload: bytes) -> bool:
    try:
        REFUSES[kind](payload)
    except MalformedMessage:
        return False
    return True
