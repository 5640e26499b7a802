"""Digest of a path: what stands for its points in a recording."""

from __future__ import annotations

import hashlib

PATH_DIGEST = "path_digest"
"""Topic that stands for a path in a recording: with its attachment and, as payload, the ``digest``
of its points, float64 x, y [m]."""
DIGEST_BYTES = 16


def digest(payload: bytes) -> bytes:
    """Return DIGEST_BYTES bytes that no other payload has."""
    return hashlib.blake2b(payload, digest_size=DIGEST_BYTES).digest()
