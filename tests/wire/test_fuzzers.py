"""The fuzzers find what they are there to find; how often they do not is for campaigns to say."""

from __future__ import annotations

import warnings

import pytest

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.wire import schemas
from fasaco_edge.wire.messages.poses import encode_pose_stamped
from tests.campaigns.fuzz_wire import run_campaign
from tests.wire.decoders import DECODERS
from tests.wire.encoders import ENCODERS

MUTATIONS = 2000
POSE = schemas.POSE_STAMPED


def failures_of(schema: str) -> dict[str, int]:
    tally = run_campaign(schema, MUTATIONS, 0, lambda count: None)
    assert tally.mutations == MUTATIONS
    return {kind.split(",")[0]: failure["count"] for kind, failure in tally.failures.items()}


def test_a_campaign_repeats_itself() -> None:
    one, other = (run_campaign(POSE, MUTATIONS, 3, lambda count: None) for _ in range(2))
    assert (one.refused, one.read) == (other.refused, other.read)


def test_another_error_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    right = DECODERS[POSE]

    def decode(payload: bytes) -> object:
        if payload[16:17] == b"\xff":
            raise IndexError("no such frame")
        return right(payload)

    monkeypatch.setitem(DECODERS, POSE, decode)
    assert failures_of(POSE).keys() == {"IndexError in decode"}


def test_a_warning_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    right = DECODERS[POSE]

    def decode(payload: bytes) -> object:
        if len(payload) > 90:
            warnings.warn("long", RuntimeWarning, stacklevel=1)
        return right(payload)

    monkeypatch.setitem(DECODERS, POSE, decode)
    assert failures_of(POSE).keys() == {"RuntimeWarning in decode"}


def test_a_greedy_decoder_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    right = DECODERS[POSE]

    def decode(payload: bytes) -> object:
        room = bytearray(int.from_bytes(payload[12:16], "little") % 2**20)
        return right(payload) if room else None

    monkeypatch.setitem(DECODERS, POSE, decode)
    assert "AssertionError in peak_bytes" in failures_of(POSE)


def test_a_message_that_cannot_be_encoded_again_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def encode(message: object) -> bytes:
        raise MalformedMessage("not today")

    monkeypatch.setitem(ENCODERS, POSE, encode)
    assert failures_of(POSE).keys() == {"MalformedMessage in encode"}


def test_another_value_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    always = encode_pose_stamped(StampedPose(Pose2D(0.0, 0.0)))
    monkeypatch.setitem(ENCODERS, POSE, lambda message: always)
    assert failures_of(POSE).keys() == {"AssertionError in check_same"}
