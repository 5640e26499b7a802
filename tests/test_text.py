"""Text from elsewhere shows all it holds, and does nothing."""

from __future__ import annotations

import functools
import json
import re
import unicodedata
from pathlib import Path

import pytest

import fasaco_edge
from fasaco_edge.text import MOST, json_line, lines, one_line, percent, shown

# What a terminal obeys or nobody sees, by Unicode's own tables. Signs that Arabic, Syriac and
# Kaithi numbers begin with are of a category with them, and seen.
SEEN = {0x600, 0x601, 0x602, 0x603, 0x604, 0x605, 0x6DD, 0x70F, 0x890, 0x891, 0x8E2}
SEEN |= {0x110BD, 0x110CD} | set(range(0x13430, 0x13440))


@functools.cache
def hidden():
    """Return all signs of Unicode that are not to be seen."""
    return [
        mark
        for mark in map(chr, range(0x110000))
        if unicodedata.category(mark) in ("Cc", "Cf", "Cs", "Zl", "Zp") and ord(mark) not in SEEN
    ]


@pytest.mark.parametrize(
    ("text", "seen"),
    [
        ("\x1b]0;title\x07", r"\x1b]0;title\x07"),
        ("\x9b31m", r"\x9b31m"),
        ("\x7f\x00", r"\x7f\x00"),
        ("a\nERROR b\r\tc", r"a\nERROR b\r\tc"),
        ("\u202egnp.exe", r"\u202egnp.exe"),
        ("a\u200bb\u2028c\u2029", r"a\u200bb\u2028c\u2029"),
        ("\udc9b", r"\udc9b"),
        ("\U000e0041", r"\U000e0041"),
        ("Küche 厨房 \N{BROOM} [red]", "Küche 厨房 \N{BROOM} [red]"),
    ],
)
def test_control_characters_are_made_visible(text, seen):
    assert one_line(text) == seen


def test_all_that_unicode_hides_is_seen():
    for mark in hidden():
        assert one_line(mark).isprintable()
        assert one_line(mark).isascii()
    assert lines("".join(hidden())).replace("\n", "").replace("\t", "").isprintable()


def test_line_ends_and_tabs_stay_where_they_are_meant():
    assert lines("a\n\tb\x1b") == "a\n\tb\\x1b"


def test_a_text_is_shown_up_to_a_length():
    assert one_line("x" * 10**6) == f"{'x' * MOST}… ({10**6 - MOST} more)"
    assert lines("x" * 30, 10) == "x" * 10 + "… (20 more)"
    assert lines("x" * 10**6) == "x" * 10**6


def test_a_value_is_shown_however_large_it_is():
    ring: list[object] = []
    ring.append(ring)
    for value in (ring, 10**5000, ["lol"] * 10**6, {"a": "\x1b" * 10**6}, "\u202e"):
        assert len(shown(value)) < 1000
        assert one_line(shown(value)) == shown(value)


def test_json_has_escapes_of_its_own():
    # Two halves of a pair beside each other would be one sign.
    text = "-".join(hidden())
    document = {text: [text, 1.5, None]}
    line = json_line(document)
    assert line.isascii()
    assert line.isprintable()
    assert json.loads(line) == document


@pytest.mark.parametrize(
    ("share", "digits", "text"),
    [
        (0.039, 1, "3.9 %"),
        (0.9999, 1, "99.9 %"),
        (1, 1, "100.0 %"),
        (0.999, 0, "99 %"),
        (1.5, 0, "150 %"),
    ],
)
def test_only_the_whole_is_shown_as_100_percent(share, digits, text):
    assert percent(share, digits) == text


def test_a_percent_sign_stands_apart():
    """Python writes {0.039:%} as 3.9%, ``text.percent`` as 3.9 %: so does the package."""
    package = Path(fasaco_edge.__file__).parent
    found = [
        f"{file.relative_to(package)}:{number}"
        for file in package.rglob("*.py")
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1)
        if re.search(r"%\}|\}%[\s\"']", line)
    ]
    assert not found
