"""Requests and responses of services, and diagnostics, as rosbags reads them."""

from __future__ import annotations

import pytest

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.wire import schemas
from fasaco_edge.wire.documents.replies import STATES, CoverageReport
from fasaco_edge.wire.documents.status import (
    BatteryReport,
    ClaimReport,
    ErrorCounts,
    LedgerReport,
    Status,
    SupervisedRecorder,
    TroubleReport,
)
from fasaco_edge.wire.messages.ros_node import (
    ERROR,
    OK,
    STALE,
    WARN,
    check_request,
    encode_diagnostics,
    encode_response,
    level_of,
    response_attachment,
)
from fasaco_edge.wire.ros_keys import attachment, attachment_of
from tests.wire import oracle

GID = bytes(range(16))


@pytest.mark.parametrize("payload", [b"\0\1\0\0\0", b"\0\1\0\0\0\0\0\0", b"\0\1\0\3\0\0\0\0"])
def test_a_request_is_a_byte_whatever_pads_it(payload: bytes) -> None:
    check_request(payload)


@pytest.mark.parametrize("payload", [b"", b"\0\1\0\0", b"\0\0\0\0\0", b"\0\1\0\0\0junk"])
def test_an_invalid_request_is_refused(payload: bytes) -> None:
    with pytest.raises(MalformedMessage, match="Trigger"):
        check_request(payload)


@pytest.mark.parametrize("message", ["", "paused: by command", "Küche", "ü" * 500, "a\0b\x1b"])
def test_a_response_is_read_by_others(message: str) -> None:
    for success in (True, False):
        told = oracle.from_bytes(oracle.TRIGGER_RESPONSE, encode_response(message, success=success))
        assert told.success == success
        if message.isprintable():
            assert told.message == message[:128]
        assert told.message.isprintable()


def test_a_response_has_number_and_gid_of_its_request() -> None:
    beside = response_attachment(attachment(42, 1, GID), 7)
    assert beside == attachment(42, 7, GID)
    assert attachment_of(beside) == (42, GID)
    for other in (b"", b"x" * 24, b"\xff" * 33):
        assert response_attachment(other, 7) == b""


def test_a_status_is_read_by_others() -> None:
    status = Status(
        robot="left",
        state="degraded",
        reason="no pose " + "x" * 400,
        coverage=CoverageReport(coverable=4, covered=1, remaining=3, fraction=0.25),
        battery=BatteryReport(level=0.5),
        errors=ErrorCounts(total=2, last="a map\nof 0 pixels"),
    )
    told = oracle.from_bytes(schemas.DIAGNOSTIC_ARRAY, encode_diagnostics(status, "node", 5))
    assert told.header.stamp.nanosec == 5
    (one,) = told.status
    assert (one.level, one.name, one.hardware_id) == (WARN, "node: mission", "left")
    assert one.message.startswith("degraded: no pose x")
    values = {value.key: value.value for value in one.values}
    assert (values["covered"], values["battery"], values["cells left"]) == ("0.2500", "0.500", "3")
    assert values["last refused"] == "a map\\nof 0 pixels"


def test_each_state_has_its_level() -> None:
    assert {level_of(Status(state=state)) for state in STATES} == {OK, WARN, ERROR}
    assert level_of(Status(state="blocked")) == ERROR
    assert level_of(Status(state="waiting for map")) == level_of(Status(state="paused")) == WARN
    assert level_of(Status(state="covering", ledger=LedgerReport(fault="disk full"))) == WARN
    assert level_of(Status(state="covering")) == OK
    assert level_of(Status(state="charging", troubles=(TroubleReport("no_current"),))) == WARN
    assert level_of(Status(state="done", recorder=SupervisedRecorder("disk full"))) == WARN
    assert level_of(Status(state="done", recorder=SupervisedRecorder("recording"))) == OK
    assert level_of(Status(state="blocked", claim=ClaimReport(stand="waits"))) == STALE
