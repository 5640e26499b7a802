"""One line of each kind in ten seconds, whatever comes in."""

from __future__ import annotations

import logging

import pytest

from fasaco_edge.cli.console.logs import RateLimiter


class Storm:
    def __init__(self) -> None:
        self.now = 0.0
        self.lines: list[str] = []
        self.heard: list[logging.LogRecord] = []
        target = logging.Handler()
        target.emit = self._hear
        self.log = logging.Logger("storm")
        self.handler = RateLimiter(target, lambda: self.now)
        self.log.addHandler(self.handler)

    def fault(self, text: str, code: str = "malformed") -> None:
        self.log.warning("%s", text, extra={"event": "fault", "code": code})

    def _hear(self, record: logging.LogRecord) -> None:
        self.heard.append(record)
        self.lines.append(record.getMessage())


@pytest.fixture
def storm():
    return Storm()


def test_a_flood_becomes_one_line_with_a_count_of_the_others(storm):
    for number in range(1001):
        storm.now = 0.02 * number
        storm.fault(f"number {number}")
    assert storm.lines == [
        "number 0",
        "number 500 (and 499 more like it)",
        "number 1000 (and 499 more like it)",
    ]


def test_kinds_do_not_hide_each_other(storm):
    storm.fault("one")
    storm.fault("another", code="wrong_frame")
    storm.log.info("a line")
    storm.log.info("another line")
    storm.log.info("a line")
    assert storm.lines == ["one", "another", "a line", "another line"]


def test_suppressed_lines_are_counted_with_the_next_line(storm):
    """The next line of any kind flushes them once their interval is over."""
    for text in ("first", "second", "third"):
        storm.fault(text)
    storm.now = 11.0
    storm.log.info("later")
    assert storm.lines == ["first", "later", "third (and 1 more like it)"]
    storm.fault("fourth")
    assert storm.lines[-1].startswith("third"), "its ten seconds have begun again"


def test_and_at_the_end(storm):
    storm.fault("first")
    storm.fault("second")
    storm.handler.close()
    assert storm.lines == ["first", "second"]


def test_it_keeps_no_more_than_ten_seconds(storm):
    for number in range(10_000):
        storm.now = 0.1 * number
        storm.log.info("line %d", number)
    assert len(storm.lines) == 10_000
    assert len(storm.handler._kinds) <= 101
