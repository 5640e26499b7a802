"""Arrival: a sample from the bus, with the time at which it came."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

from fasaco_edge.bus.session import Sample

PATH_DIGEST = "path_digest"
"""Topic that stands for a path in a recording: with its attachment and, as payload, the ``digest``
of its points, float64 x, y [m]."""
DIGEST_BYTES = 16


@dataclass(frozen=True, slots=True)
class Arrival:
    """A sample, its topic, and when it came.

    Attributes:
        topic: name of its row in ``wire.topics``: "map", "pose" ...
        sample: the sample.
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
