"""JSON documents as structs: strict readers refuse, tolerant ones take what fits."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.planners.path import CoveragePath, Saved
from fasaco_edge.wire.documents.json_text import (
    MAX_TEXT,
    decode_document,
    decode_json,
    decode_tolerant,
    encode_json,
    tolerant,
)
from fasaco_edge.wire.documents.path_documents import PathAttachment, PlanFigures, Rectangle
from fasaco_edge.wire.documents.replies import CoverageReport, ZoneReport
from fasaco_edge.wire.documents.settings import known_settings
from fasaco_edge.wire.documents.status import Status, SupervisedRecorder
from fasaco_edge.wire.limits import MAX_JSON_DEPTH, MAX_JSON_INTEGER

TWO = CoverageReport(coverable=2)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=10,
)
MEMBERS = [field.encode_name for field in msgspec.structs.fields(Status)]


def test_a_status_comes_back_as_it_was():
    status = Status(
        state="covering",
        coverage=CoverageReport(coverable=3, covered=1),
        recorder=SupervisedRecorder("starting", 2),
        config={"robot": {"radius_m": 0.2}},
    )
    payload = encode_json(status)
    assert decode_document(payload, Status) == decode_tolerant(payload, Status) == status
    assert b"lost" not in payload


def test_a_strict_reader_refuses_what_a_tolerant_one_leaves_out():
    payload = encode_json({"state": "done", "coverage": {"covered": "all", "coverable": 3}})
    with pytest.raises(MalformedMessage, match="covered"):
        decode_document(payload, Status)
    status = decode_tolerant(payload, Status)
    assert (status.state, status.coverage) == ("done", CoverageReport(coverable=3))


@pytest.mark.parametrize(
    ("document", "expected"),
    [
        ({}, Status()),
        ({"weather": "rain"}, Status()),
        ({"state": 5, "reason": None}, Status()),
        ({"reason": "x" * 900}, Status(reason="x" * MAX_TEXT)),
        ({"threads": True}, Status()),
        ({"threads": MAX_JSON_INTEGER + 1, "rss_mb": 10**400}, Status()),
        ({"threads": 0, "cpu_s": -1.0, "rss_mb": 1e16}, Status()),
        ({"coverage": {"fraction": 1.1, "covered": -1, "coverable": 2}}, Status(coverage=TWO)),
        ({"rss_mb": 5, "plan": []}, Status(rss_mb=5.0)),
        ({"errors": {"total": 1, "by_code": {"a": 1, "b": "2"}}}, {"a": 1}),
        ({"mission": {"zones": [{"name": "k", "pass": 2}, 7]}}, (ZoneReport("k", pass_number=2),)),
    ],
)
def test_members_that_do_not_fit_keep_their_defaults(document, expected):
    status = tolerant(document, Status)
    assert expected in (status, status.errors.by_code, status.mission.zones)


# What a publisher on the bus may write in place of a number.
NO_NUMBERS = {
    "400 digits": "9" * 400,
    "beyond 64 bits": str(MAX_JSON_INTEGER + 1),
    "negative": "-1",
    "text": '"7"',
    "NaN": "NaN",
    "infinity": "1e999",
    "1e308": "1e308",
    "object": "{}",
}


@pytest.mark.parametrize("written", NO_NUMBERS.values(), ids=NO_NUMBERS)
@pytest.mark.parametrize("member", ["covered", "covered_m2"])
def test_a_strict_reader_refuses_numbers_out_of_range(written, member):
    payload = f'{{"state": "done", "coverage": {{"{member}": {written}}}}}'.encode()
    with pytest.raises(MalformedMessage):
        decode_document(payload, Status)


@pytest.mark.parametrize("name", ["400 digits", "beyond 64 bits", "1e308", "infinity", "NaN"])
def test_no_reader_accepts_a_number_beyond_the_limits(name):
    """Untyped members (settings, an order, those of later versions) are checked, too."""
    payload = f'{{"state": "done", "config": {{"later": [{NO_NUMBERS[name]}]}}}}'.encode()
    for decode in (decode_tolerant, decode_document):
        with pytest.raises(MalformedMessage):
            decode(payload, Status)


def test_a_fault_names_the_member_and_the_limit():
    with pytest.raises(MalformedMessage, match=r"object\.plan\.plans must be from -9223"):
        decode_json(b'{"plan": {"plans": %s}}' % (b"9" * 400))
    with pytest.raises(MalformedMessage, match=r"object\.x\[1\] must be .* 1e\+15, got 1e\+300"):
        decode_json(b'{"x": [0.0, 1e300]}')
    with pytest.raises(MalformedMessage, match=r"message\.order must be .* to 9223372036854775807"):
        encode_json({"order": 10**400})


def test_a_document_is_nested_no_deeper_than_its_limit():
    def nested(levels: int) -> bytes:
        return b'{"a":' * levels + b"1" + b"}" * levels

    assert decode_json(nested(MAX_JSON_DEPTH))
    for levels in (MAX_JSON_DEPTH + 1, 900, 100_000):
        with pytest.raises(MalformedMessage, match="nested too deeply"):
            decode_json(nested(levels))


def test_a_rectangle_is_whole_or_missing():
    edges = {"x_min": 0, "y_min": 0, "x_max": 1, "y_max": 2}
    assert tolerant({"changed": edges}, PathAttachment).changed == Rectangle(0.0, 0.0, 1.0, 2.0)
    assert tolerant({"changed": edges | {"x_min": "0"}}, PathAttachment).changed is None


@pytest.mark.parametrize("corner", [[], [1], [1, 0, 5], [1, "0"], [1, "9" * 400], "10", None])
def test_a_corner_has_two_coordinates_or_is_left_out(corner):
    """Who draws or lists a polygon takes a corner for two numbers."""
    area = {"name": "a", "polygon": [[0, 0], corner, [1, 1]]}
    document = {"mission": {"keep_outs": [area]}, "config": {"mission": {"zones": [area]}}}
    status = tolerant(document, Status)
    zones = known_settings(status.config).mission.zones
    for known in (status.mission.keep_outs[0], zones[0]):
        assert known.polygon == ((0.0, 0.0), (1.0, 1.0))


def test_a_repair_that_costs_more_has_saved_nothing():
    path = CoveragePath(np.zeros((1, 2), np.int32), "near-optimal", 1, saved=Saved(0.5, -0.3))
    figures = PlanFigures.of(path)
    assert (figures.saved_by_ants_s, figures.saved_by_local_search_s) == (0.5, 0.0)


def test_savings_of_ants_are_listed_by_velocity():
    saved = Saved.of(9_000_000, np.array([8, 3, 1]), np.array([1_500_000, 0, 500_000]))
    figures = PlanFigures.of(CoveragePath(np.zeros((1, 2), np.int32), "p", 1, saved=saved))
    assert (figures.saved_by_ants_s, figures.saved_by_local_search_s) == (2.0, 7.0)
    assert figures.saved_by_velocity_s == {"8": 1.5, "1": 0.5}


def test_unknown_members_may_be_nested_to_the_limit_of_json():
    deep: dict = {}
    for _ in range(900):
        deep = {"a": deep}
    assert tolerant({"state": "done", "deep": deep}, Status) == Status(state="done")


def test_no_attachment_is_an_empty_one():
    assert decode_tolerant(b"", PathAttachment) == PathAttachment()


@given(st.dictionaries(st.sampled_from(MEMBERS), JSON))
@example({"robot": None, "config": {"robot": [math.inf]}})
def test_a_tolerant_reader_takes_any_object(document):
    status = tolerant(document, Status)
    assert decode_document(encode_json(status), Status) == status
    known_settings(status.config)
