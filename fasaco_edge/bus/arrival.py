"""A sample that came off the bus, with the time it came at."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

from fasaco_edge.bus.session import Sample

PATH_DIGEST = "path_digest"
"""Topic of what stands for a path in a recording: its attachment; for payload, the ``digest``
of its points, float64 x, y [m]."""
DIGEST_BYTES = 16


@dataclass(frozen=True, slots=True)
class Arrival:
    """A sample, what it is about, and when it came.

    Attributes:
        topic: what its key ends with by the contract: "map", "pose" ...
        sample: what came.
        at_ns: when, by a clock that never steps [ns].
        wall_ns: when, since the epoch [ns].
    """

    topic: str
    sample: Sample
    at_ns: int
    wall_ns: int


def digest(payload: bytes) -> bytes:
    """Return DIGEST_BYTES bytes that no other payload has."""
    return hashlib.blake2b(payload, digest_size=DIGEST_BYTES).digest()
