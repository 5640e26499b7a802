"""Plain words for reasons that a daemon publishes in words of its own.

The published texts stay as they are: a replay compares them with those of old recordings.
"""

from __future__ import annotations

import re

WORDS = {
    "better further on": "a better path found for floor further ahead",
    "line polished": "the line ahead improved",
}
# The figure of a mission's ending that needs its reason.
_POSSIBLE = re.compile(r", or of ([\d.]+ m2) if walls are a pixel thinner than on the map")


def plain(text: str) -> str:
    """Return a text with the reasons in it in plain words."""
    for reason, words in WORDS.items():
        text = text.replace(reason, words)
    return _POSSIBLE.sub(lambda found: possible(found[1]), text)


def possible(area: str) -> str:
    """Return what could be reachable at most: ``area``, of floor."""
    return f" (of {area} if the map shows walls too thick)"
