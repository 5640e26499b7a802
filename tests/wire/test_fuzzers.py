"""The fuzzers find what they are there to find; how often they do not is for campaigns to say."""

from __future__ import annotations

import warnings
from typing import Any

import pytest

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.wire import schemas
from fasaco_edge.wire.messages.poses import encode_pose_stamped
from tests.campaigns import coverage_fuzz_wire as coverage_fuzz
from tests.campaigns.fuzz_wire import run_campaign
from tests.wire.decoders import DECODERS
from tests.wire.encoders import ENCODERS

MUTATIONS = 2000
POSE = schemas.POSE_STAMPED


def failures_of(schema: str) -> set[str]:
    tally = run_campaign(schema, MUTATIONS, 0, lambda count: None)
    assert tally.mutations == MUTATIONS
    return {kind.split(",")[0] for kind in tally.failures}


def test_a_campaign_repeats_itself() -> None:
    one, other = (run_campaign(POSE, MUTATIONS, 3, lambda count: None) for _ in range(2))
    assert (one.refused, one.read) == (other.refused, other.read)


def fail(payload: bytes) -> None:
    if payload[16:17] == b"\xff":
        raise IndexError("no such frame")


def warn(payload: bytes) -> None:
    if len(payload) > 90:
        warnings.warn("long", RuntimeWarning, stacklevel=1)


def waste(payload: bytes) -> None:
    bytearray(int.from_bytes(payload[12:16], "little") % 2**20)


@pytest.mark.parametrize(
    ("harm", "found"),
    [
        (fail, "IndexError in fail"),
        (warn, "RuntimeWarning in warn"),
        (waste, "AssertionError in peak_bytes"),
    ],
)
def test_a_faulty_decoder_is_found(monkeypatch: pytest.MonkeyPatch, harm: Any, found: str) -> None:
    right = DECODERS[POSE]

    def decode(payload: bytes) -> object:
        harm(payload)
        return right(payload)

    monkeypatch.setitem(DECODERS, POSE, decode)
    assert failures_of(POSE) == {found}


def test_a_message_that_cannot_be_encoded_again_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def encode(message: object) -> bytes:
        raise MalformedMessage("not today")

    monkeypatch.setitem(ENCODERS, POSE, encode)
    assert failures_of(POSE) == {"MalformedMessage in encode"}


def test_another_value_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    always = encode_pose_stamped(StampedPose(Pose2D(0.0, 0.0)))
    monkeypatch.setitem(ENCODERS, POSE, lambda message: always)
    assert failures_of(POSE) == {"AssertionError in check_same"}


def test_coverage_guided_fuzzing_runs() -> None:
    pytest.importorskip("atheris", reason="atheris is not installed")
    outcome = coverage_fuzz.fuzz(POSE, 2, 0)
    assert not outcome.failure
    assert outcome.executed > 1000
    assert min(outcome.seeds, outcome.corpus, outcome.edges) > 0
