"""Log lines as the journal takes them."""

from __future__ import annotations

import logging
import os
import socket
import sys

import pytest

from fasaco_edge.cli.console.logs import JournalHandler, encode_entry, is_journal, message_id


def decode(entry: bytes) -> dict[str, str]:
    """Read an entry as the protocol says, by a code of our own."""
    fields = {}
    while entry:
        line, _, rest = entry.partition(b"\n")
        name, is_short, value = line.partition(b"=")
        if not is_short:
            size = int.from_bytes(rest[:8], "little")
            value, rest = rest[8 : 8 + size], rest[8 + size + 1 :]
        fields[name.decode()] = value.decode()
        entry = rest
    return fields


@pytest.fixture
def journal(tmp_path):
    """A socket in place of the journal's, and a logger that speaks to it."""
    address = str(tmp_path / "journal")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as heard:
        heard.bind(address)
        heard.settimeout(5.0)
        log = logging.Logger("test")
        handler = JournalHandler(address)
        log.addHandler(handler)
        yield heard, log
        handler.close()


def test_a_line_has_its_priority_and_its_place(journal):
    heard, log = journal
    log.error("%d is wrong", 7)
    fields = decode(heard.recv(65536))
    assert (fields["MESSAGE"], fields["PRIORITY"]) == ("7 is wrong", "3")
    assert (fields["SYSLOG_IDENTIFIER"], fields["FASACO_LOGGER"]) == ("fasaco-edge", "test")
    assert (fields["CODE_FILE"], fields["CODE_FUNC"]) == (
        __file__,
        "test_a_line_has_its_priority_and_its_place",
    )
    assert "MESSAGE_ID" not in fields


@pytest.mark.parametrize(("level", "priority"), [("debug", "7"), ("info", "6"), ("warning", "4")])
def test_each_level_has_its_priority(journal, level, priority):
    heard, log = journal
    getattr(log, level)("x")
    assert decode(heard.recv(65536))["PRIORITY"] == priority


def test_an_event_can_be_looked_for(journal):
    heard, log = journal
    log.warning("bad", extra={"event": "fault", "code": "malformed_message"})
    fields = decode(heard.recv(65536))
    assert fields["FASACO_EVENT"] == "fault"
    assert fields["FASACO_CODE"] == "malformed_message"
    assert fields["MESSAGE_ID"] == message_id("fault") == "a80b495b694a1a7a2b2db9ccd41db2d3"


def test_lines_of_an_error_stay_together(journal):
    heard, log = journal
    try:
        raise ValueError("first\nsecond")
    except ValueError:
        log.exception("it went wrong")
    message = decode(heard.recv(65536))["MESSAGE"]
    assert message.startswith("it went wrong\nTraceback")
    assert message.endswith("first\nsecond")


def test_any_text_comes_back():
    fields = {"A": "", "B": "x=y", "C": "one\n\ntwo=\n", "D": "Ä\n" * 5}
    assert decode(encode_entry(fields)) == fields


def test_a_line_that_is_too_long_is_cut(journal):
    heard, log = journal
    log.info("x" * 10_000_000)
    assert set(decode(heard.recv(1 << 20))["MESSAGE"]) == {"x"}


def test_without_a_journal_standard_error_hears_it(tmp_path, capsys):
    log = logging.Logger("test")
    log.addHandler(JournalHandler(str(tmp_path / "nobody")))
    log.warning("heard")
    assert capsys.readouterr().err == "<4>heard\n"
    log.handlers[0].close()


def test_it_is_the_journal_only_where_the_stream_is_the_same(tmp_path, monkeypatch):
    with (tmp_path / "log").open("w") as log:
        monkeypatch.setattr(sys, "stderr", log)
        there = os.fstat(log.fileno())
        assert is_journal({"JOURNAL_STREAM": f"{there.st_dev}:{there.st_ino}"})
        assert not is_journal({"JOURNAL_STREAM": f"{there.st_dev}:{there.st_ino + 1}"})
        assert not is_journal({})
