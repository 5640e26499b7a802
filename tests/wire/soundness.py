"""What holds of any bytes given to a decoder, for all that send it broken ones."""

from __future__ import annotations

import contextlib
import math
import tracemalloc
from typing import Any

import numpy as np

from fasaco_edge.errors import MalformedMessage
from tests.wire.decoders import DECODERS
from tests.wire.encoders import ENCODERS

# Largest peak of memory per byte of a payload. The poses of a path are copied, checked, and divided
# into points and headings: 1.45 times its bytes. Cells are copied once, if one is refused.
PEAK_PER_BYTE = 2
# Memory that Python needs for itself [bytes].
PEAK_AT_LEAST = 8192


def is_read(schema: str, payload: bytes) -> bool:
    """Tell whether a payload is read or refused.

    Raises:
        AssertionError: it was read, but is not what the contract promises, cannot be
            encoded, or is another value when that is decoded.
        Exception: anything but MalformedMessage that the decoder let out.
    """
    try:
        message = DECODERS[schema](payload)
    except MalformedMessage:
        return False
    check_sound(message)
    if schema in ENCODERS:
        check_same(DECODERS[schema](ENCODERS[schema](message)), message)
    return True


def peak_bytes(schema: str, payload: bytes) -> int:
    """Return the most memory that decoding took at once [bytes]; tracemalloc must be on.

    Raises:
        AssertionError: it is more than the payload justifies.
    """
    tracemalloc.reset_peak()
    before = tracemalloc.get_traced_memory()[0]
    with contextlib.suppress(MalformedMessage):
        DECODERS[schema](payload)
    peak = tracemalloc.get_traced_memory()[1] - before
    most = PEAK_AT_LEAST + PEAK_PER_BYTE * len(payload)
    assert peak <= most, f"{peak} bytes for a payload of {len(payload)}, at most {most}"
    return peak


def check_sound(message: Any) -> None:
    if isinstance(message, tuple):
        for transform in message:
            place = transform.planar()
            assert max(abs(place.x), abs(place.y)) <= 2e7
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
        assert all(map(math.isfinite, (geometry.origin.x, geometry.origin.y, geometry.origin.yaw)))
    pose = getattr(message, "pose", None)
    if pose is not None:
        assert max(abs(pose.x), abs(pose.y)) <= 2e7
        assert abs(pose.yaw) <= np.pi
    if hasattr(message, "xy"):
        assert np.isfinite(message.xy).all()
        assert np.isfinite(message.yaw).all()
        assert message.xy.shape == (len(message.yaw), 2)
    if hasattr(message, "frame"):
        assert len(message.frame.encode()) <= 256


def check_same(again: Any, message: Any) -> None:
    """Check that a message came back as it was, but for the last digits of its angles."""
    assert type(again) is type(message)
    for name in ("frame", "stamp_ns", "window", "cohort", "velocity", "ants", "best_steps"):
        assert getattr(again, name, None) == getattr(message, name, None), name
    for name in ("cells", "xy"):
        assert np.array_equal(getattr(again, name, 0), getattr(message, name, 0)), name
    if hasattr(message, "geometry"):
        ours, theirs = again.geometry, message.geometry
        assert (ours.rows, ours.cols) == (theirs.rows, theirs.cols)
        assert ours.resolution == theirs.resolution
        # The encoder of pheromone places it on the lattice, wherever it came from.
        if hasattr(message, "cells"):
            assert (ours.origin.x, ours.origin.y) == (theirs.origin.x, theirs.origin.y)
            check_turns(ours.origin.yaw, theirs.origin.yaw)
    if hasattr(message, "pose"):
        assert (again.pose.x, again.pose.y) == (message.pose.x, message.pose.y)
        check_turns(again.pose.yaw, message.pose.yaw)
    if hasattr(message, "yaw"):
        check_turns(again.yaw, message.yaw)


def check_turns(ours: Any, theirs: Any) -> None:
    """Check that two yaws, or arrays of them [rad], point the same way."""
    turns = np.asarray(ours) - np.asarray(theirs)
    # Half a turn is +pi or -pi.
    assert (np.abs(np.sin(turns / 2)) <= 1e-14).all(), "yaw"
