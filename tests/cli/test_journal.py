"""Log lines as the journal takes them from standard error."""

from __future__ import annotations

import logging
import os
import sys
from io import StringIO

import pytest

from fasaco_edge.cli.console.logs import JournalLine, is_journal


@pytest.fixture
def journal():
    log, written = logging.Logger("test"), StringIO()
    handler = logging.StreamHandler(written)
    handler.setFormatter(JournalLine("%(message)s"))
    log.addHandler(handler)
    return log, written


@pytest.mark.parametrize(
    ("level", "priority"), [("debug", 7), ("info", 6), ("warning", 4), ("error", 3)]
)
def test_each_level_has_its_priority(journal, level, priority):
    log, written = journal
    getattr(log, level)("%d is\nwrong", 7)
    assert written.getvalue() == f"<{priority}>7 is\\nwrong\n"


def test_each_line_of_a_traceback_has_its_priority(journal):
    log, written = journal
    try:
        raise ValueError("first\nsecond")
    except ValueError:
        log.exception("it went wrong")
    lines = written.getvalue().splitlines()
    assert lines[:2] == ["<3>it went wrong", "<3>    Traceback (most recent call last):"]
    assert lines[-1] == "<3>    second"
    assert all(line.startswith("<3>") for line in lines)


def test_it_is_the_journal_only_where_the_stream_is_the_same(tmp_path, monkeypatch):
    with (tmp_path / "log").open("w") as log:
        monkeypatch.setattr(sys, "stderr", log)
        there = os.fstat(log.fileno())
        for stream, is_it in (
            (f"{there.st_dev}:{there.st_ino}", True),
            (f"{there.st_dev}:{there.st_ino + 1}", False),
            ("", False),
        ):
            monkeypatch.setenv("JOURNAL_STREAM", stream)
            assert is_journal() == is_it
