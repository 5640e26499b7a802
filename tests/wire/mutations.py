"""Payloads that are nearly messages: valid ones, damaged where a decoder may trip."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable, Sequence

from tests.wire.vectors import vectors

ODD_NUMBERS = [0, 1, 2, 3, 4, 7, 8, 2**16, 2**24, 2**31 - 1, 2**31, 2**32 - 1]
ODD_FLOATS = [0.0, -0.0, 5e-324, 1e-42, 1e308, float("inf"), float("-inf"), float("nan")]
# A signalling NaN, and negative ones: arithmetic on them must not warn either.
ODD_BITS = [0x7FF0000000000001, 0xFFF0000000000001, 0xFFFFFFFFFFFFFFFF]
# Of a float32: a signalling NaN, a negative one, infinity, the least there is, the largest.
ODD_FLOAT32 = [b"\1\0\x80\x7f", b"\1\0\xc0\xff", b"\0\0\x80\x7f", b"\1\0\0\0", b"\xff\xff\x7f\x7f"]
# A payload that was repeated often enough is no better than one repeated once.
LARGEST = 8192

Mutation = Callable[[random.Random, bytearray], object]


def seeds_of(schema: str) -> list[bytes]:
    """Return the valid vectors of a message type, what its mutations begin with.

    Raises:
        LookupError: there are none.
    """
    seeds = [vector.payload for vector in vectors("valid") if vector.schema == schema]
    if not seeds:
        raise LookupError(f"{schema} has a decoder but no valid vector to mutate")
    return seeds


def mutant(rng: random.Random, seeds: Sequence[bytes]) -> bytes:
    payload = bytearray(rng.choice(seeds))
    for mutate in rng.choices(MUTATIONS, k=rng.choice((1, 1, 1, 2, 3))):
        if len(payload) > 16:
            mutate(rng, payload)
    return bytes(payload)


def _flip(rng: random.Random, payload: bytearray) -> None:
    for _ in range(rng.randint(1, 4)):
        payload[rng.randrange(len(payload))] ^= 1 << rng.randrange(8)


def _overwrite(rng: random.Random, payload: bytearray) -> None:
    for _ in range(rng.randint(1, 8)):
        payload[rng.randrange(len(payload))] = rng.randrange(256)


def _cut(rng: random.Random, payload: bytearray) -> None:
    at = rng.randrange(len(payload))
    del payload[at : at + rng.randint(1, 16)]


def _insert(rng: random.Random, payload: bytearray) -> None:
    at = rng.randrange(len(payload))
    payload[at:at] = rng.randbytes(rng.randint(1, 16))


def _append(rng: random.Random, payload: bytearray) -> None:
    payload += rng.randbytes(rng.randint(1, 16))


def _repeat(rng: random.Random, payload: bytearray) -> None:
    """Copy a stretch of whole words to another place: a pose once more, a longer name."""
    start = 4 * rng.randrange(1, len(payload) // 4)
    stretch = payload[start : start + 4 * rng.randint(1, 32)] * rng.choice((1, 1, 1, 2, 8))
    at = 4 * rng.randrange(1, len(payload) // 4)
    if len(payload) + len(stretch) <= LARGEST:
        payload[at:at] = stretch


def _edit_number(rng: random.Random, payload: bytearray) -> None:
    at = rng.randrange(4, len(payload) - 3) & ~3
    (value,) = struct.unpack_from("<I", payload, at)
    edited = rng.choice([*ODD_NUMBERS, (value + rng.choice([-8, -4, -1, 1, 4, 8])) % 2**32])
    struct.pack_into("<I", payload, at, edited)


def _edit_float(rng: random.Random, payload: bytearray) -> None:
    at = 4 + (rng.randrange(0, len(payload) - 11) & ~7)
    payload[at : at + 8] = rng.choice(_ODD_FLOAT64)


def _edit_float32(rng: random.Random, payload: bytearray) -> None:
    at = rng.randrange(4, len(payload) - 3) & ~3
    payload[at : at + 4] = rng.choice(ODD_FLOAT32)


_ODD_FLOAT64 = [
    *(struct.pack("<d", value) for value in ODD_FLOATS),
    *(struct.pack("<Q", bits) for bits in ODD_BITS),
]

MUTATIONS: tuple[Mutation, ...] = (
    _flip,
    _overwrite,
    _cut,
    _insert,
    _append,
    _repeat,
    _edit_number,
    _edit_float,
    _edit_float32,
)
