"""Text from elsewhere, made safe to show: in a terminal, in a log and on a page.

Text from the bus, a file or a recording may contain terminal commands (escapes, C0 and C1
controls), characters that reverse or hide text (overrides, joiners, fillers), line ends that
imitate another line, and mark-up. All output to people uses this module: ``cli.console``,
``daemon.notify``, ``drawing``, ``review`` and ``serve``.
"""

from __future__ import annotations

import json
import re
import reprlib
from collections.abc import Collection
from difflib import get_close_matches

MOST = 2_000
"""Limit on a shown text [characters]; longer texts are cut."""

# Characters that control a terminal or are invisible: controls, line and paragraph separators,
# overrides and isolates, joiners, fillers, tags, lone surrogates. They are listed by code point,
# independent of the Unicode tables of a Python version.
_HIDDEN = (
    "\x00-\x1f\x7f-\x9f\xad\u034f\u061c\u115f\u1160\u17b4\u17b5\u180b-\u180f\u200b-\u200f"
    "\u2028-\u202e\u2060-\u206f\u3164\ufe00-\ufe0f\ufeff\uffa0\ufff0-\uffff\ud800-\udfff"
    "\U0001bca0-\U0001bca3\U0001d173-\U0001d17a\U000e0000-\U000e0fff"
)
_IN_A_LINE = re.compile(f"[{_HIDDEN}]")
_IN_LINES = re.compile(rf"(?![\n\t])[{_HIDDEN}]")

_SHOWN = reprlib.Repr()
_SHOWN.maxstring = _SHOWN.maxother = _SHOWN.maxlong = 200
_SHOWN.maxlist = _SHOWN.maxdict = 10
_SHOWN.maxlevel = 3


def one_line(text: str, most: int = MOST) -> str:
    r"""Return a text as one line, with ``_HIDDEN`` characters escaped: ESC becomes ``\x1b``."""
    return _IN_A_LINE.sub(_visible, _bounded(text, most))


def lines(text: str, most: int | None = None) -> str:
    """Return a text like ``one_line``, but keep line ends and tabs; None for no limit."""
    return _IN_LINES.sub(_visible, text if most is None else _bounded(text, most))


def shown(value: object) -> str:
    """Return a value as it was written, shortened if it is long, deep or contains itself."""
    try:
        return one_line(_SHOWN.repr(value))
    except (ValueError, RecursionError):  # an integer of thousands of digits; a very deep tree
        return f"a {type(value).__name__} too large to show"


def json_line(document: object) -> str:
    """Return a document as JSON in one line of printable ASCII."""
    # JSON does not escape DEL, which can only occur in strings.
    return json.dumps(document).replace("\x7f", "\\u007f")


def _bounded(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[:most]}… ({len(text) - most} more)"


def _visible(match: re.Match[str]) -> str:
    return ascii(match[0])[1:-1]


def is_reported(count: int) -> bool:
    """Return whether occurrence number ``count`` of a fault gets a line: 1, 2, 4, 8 ..."""
    return count & (count - 1) == 0


def percent(fraction: float, digits: int = 1) -> str:
    """Return a share in percent with ``digits`` decimals; 100 % only if it is the whole."""
    shown = min(100.0 * fraction, 100.0 - 10.0**-digits) if fraction < 1.0 else 100.0 * fraction
    return f"{shown:.{digits}f} %"


def duration(seconds: float) -> str:
    """Return a driving time in words."""
    if seconds < 60.0:
        return f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02} min" if hours else f"{minutes} min {rest:02} s"


def nearest(name: str, names: Collection[str], least: float = 0.6) -> list[str]:
    """Return the names that ``name`` probably stands for, without their unit or misspelt."""
    near = [each for each in names if each.startswith(f"{name}_")]
    return near or get_close_matches(name, names, 1, least)


def suggestion(word: str, names: Collection[str]) -> str:
    """Return a question for the name that ``word`` probably stands for; "" for none."""
    return "".join(f"did you mean {name}?" for name in nearest(word, names)[:1])
