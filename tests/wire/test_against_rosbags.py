"""Golden messages with other names of frames: read and written as rosbags does."""

from __future__ import annotations

from typing import Any

import pytest

from tests.wire import oracle
from tests.wire.decoders import DECODERS
from tests.wire.encoders import ENCODERS
from tests.wire.facts import check_facts, facts_of
from tests.wire.soundness import check_same
from tests.wire.vectors import Vector, vectors

# Their encoders leave members out, round headings, or place the lattice anew.
REWRITTEN = ("battery_of_cells", "scan_with_intensities", "path", "pheromone")


def headers_of(message: Any) -> list[Any]:
    inner = [*getattr(message, "poses", ()), *getattr(message, "transforms", ())]
    return [part.header for part in (message, *inner) if hasattr(part, "header")]


def places_of(message: Any) -> list[Any]:
    return [part.pose.position for part in getattr(message, "poses", ())]


def renamed(vector: Vector, frame: str) -> tuple[bytes, dict[str, Any]]:
    """Return a vector with all its frames renamed by rosbags, and what its index says then."""
    message, facts = oracle.from_bytes(vector.schema, vector.payload), dict(vector.facts)
    if hasattr(message, "child_frame_id"):
        message.child_frame_id = frame
    for header in headers_of(message):
        header.frame_id = frame
    if "frames" in facts:
        facts["frames"] = [frame] * len(facts["frames"])
    elif hasattr(message, "header"):
        facts["frame"] = frame
    return oracle.to_bytes(vector.schema, message), facts


@pytest.mark.parametrize("frame", oracle.FRAMES)
@pytest.mark.parametrize("vector", vectors("valid"), ids=lambda vector: vector.name)
def test_a_message_equals_that_of_rosbags(vector: Vector, frame: str) -> None:
    """Each length of a name moves what stands behind it to other offsets."""
    schema = vector.schema
    payload, facts = renamed(vector, frame)
    message = DECODERS[schema](payload)
    check_facts(facts_of(message), facts)
    if schema in ENCODERS:
        ours = ENCODERS[schema](message)
        check_same(DECODERS[schema](ours), message)
        theirs = oracle.from_bytes(schema, ours)
        assert oracle.to_bytes(schema, theirs) == ours
        assert ours == payload or vector.name.startswith(REWRITTEN)
        # All poses of a path carry its frame and stamp.
        assert all(header == theirs.header for header in headers_of(theirs))
        assert places_of(theirs) == places_of(oracle.from_bytes(schema, payload))
