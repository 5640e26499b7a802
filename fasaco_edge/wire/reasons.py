"""Plain words for the reasons in a daemon's published texts.

The published texts do not change, as a replay compares them with those of old recordings.
"""

from __future__ import annotations

import re

WORDS = {
    "better further on": "a better path found for floor further ahead",
    "line polished": "the line ahead improved",
}
# The recorder's word for a daemon that sends nothing.
SILENT = "the planner is silent"
# Part of the text at a mission's end, left out here: ``possible`` adds it to the swept floor.
_POSSIBLE = re.compile(r", or of [\d.]+ m2 if walls are a pixel thinner than on the map")

# A cell's indices say nothing to people, and its place is drawn on the map.
_AT_CELL = re.compile(r"(?<=path blocked) at cell \(-?\d+, -?\d+\)")
# "Every cell" would contradict "47 of 49 m2" beside it: a cell counts by its centre.
_ALL_COVERED = re.compile(r"every reachable cell( of the zones)? is covered")


def plain(text: str) -> str:
    """Return a text with the reasons in it in plain words."""
    for reason, words in WORDS.items():
        text = text.replace(reason, words)
    text = text.replace(SILENT, "no status came from the daemon")
    text = _ALL_COVERED.sub(r"the tool has passed the centre of every cell\1 that it reaches", text)
    return _AT_CELL.sub("", _POSSIBLE.sub("", text))


def possible(area: str) -> str:
    """Return a remark that the floor may have up to ``area``."""
    return f" (of {area} if the map shows walls too thick)"
