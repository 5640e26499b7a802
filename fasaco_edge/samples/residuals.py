"""Residuals: payloads of one length, each stored as its difference from the one before it.

The difference is the exclusive or: zero where nothing changed. All first bytes of several payloads
come first, then all second bytes, so that what seldom changes makes long runs of zeros. Where
nearly all is zero, only the lengths of the runs are stored, and the bytes that are not zero: a
map of a million pixels of which some hundred have changed takes some hundred bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Runs are stored if at most one byte in so many is not zero.
SPARSE = 8
_COUNT = struct.Struct("<I")

Bytes = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Residual:
    """Differences of payloads; ``sparse``: stored as runs."""

    body: bytes
    sparse: bool


def residual_of(payloads: Sequence[bytes], before: bytes) -> Residual:
    """Return the differences of payloads, at least one, all of one length.

    Args:
        payloads: in order.
        before: the payload before the first, of the same length; b"" for none.
    """
    if len(payloads) == 1:
        # Usually a large one: memory counts.
        flat = np.frombuffer(payloads[0], np.uint8)
        flat = flat ^ np.frombuffer(before, np.uint8) if before else flat
    else:
        rows = np.frombuffer(b"".join(payloads), np.uint8).reshape(len(payloads), len(payloads[0]))
        differences = rows.copy()
        differences[1:] ^= rows[:-1]
        if before:
            differences[0] ^= np.frombuffer(before, np.uint8)
        flat = differences.T.ravel()
    changed = flat != 0
    if SPARSE * np.count_nonzero(changed) > flat.size:
        return Residual(flat.tobytes(), sparse=False)
    edges = np.flatnonzero(changed[1:] != changed[:-1]) + 1
    ends = [0] * int(changed[:1].any()), [flat.size] * int(changed[-1:].any())
    edges = np.concatenate((ends[0], edges, ends[1])).astype(np.int64)
    # How many zeros, how many others, how many zeros ...; the low bytes of all stand together.
    runs = np.diff(edges, prepend=0).astype("<u4").view(np.uint8).reshape(-1, 4).T
    body = _COUNT.pack(len(edges)) + runs.tobytes() + flat[changed].tobytes()
    return Residual(body, sparse=True)


def payloads_of(residual: Residual, before: bytes, count: int, length: int) -> list[bytes]:
    """Return ``count`` payloads of ``length`` bytes; ``before`` as it was given.

    Raises:
        ValueError, IndexError, struct.error: these are no such residual.
    """
    flat = _flat(residual, count * length)
    rows = np.ascontiguousarray(flat.reshape(length, count).T)
    if before:
        rows[0] ^= np.frombuffer(before, np.uint8)
    for index in range(1, count):
        rows[index] ^= rows[index - 1]
    return [row.tobytes() for row in rows]


def _flat(residual: Residual, size: int) -> Bytes:
    body = np.frombuffer(residual.body, np.uint8)
    if not residual.sparse:
        return body.copy()
    end = _COUNT.size + 4 * _COUNT.unpack_from(residual.body)[0]
    runs = np.ascontiguousarray(body[_COUNT.size : end].reshape(4, -1).T).view("<u4").ravel()
    edges = np.cumsum(runs, dtype=np.int64)
    starts, lengths = edges[0::2], runs[1::2]
    if int(lengths.sum(dtype=np.int64)) != body.size - end:
        raise ValueError(f"runs of {lengths.sum(dtype=np.int64)} bytes, {body.size - end} follow")
    # Of each byte that is not zero: its place among them, and how many zeros come before.
    places = np.arange(body.size - end)
    places += np.repeat(starts - (np.cumsum(lengths, dtype=np.int64) - lengths), lengths)
    flat = np.zeros(size, np.uint8)
    flat[places] = body[end:]
    return flat
