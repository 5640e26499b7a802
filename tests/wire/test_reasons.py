"""Plain words for published reasons: they follow the texts that the mission publishes."""

from __future__ import annotations

import ast
import inspect

from fasaco_edge.client.phrases import swept
from fasaco_edge.mission.events import BETTER
from fasaco_edge.mission.line import floor_left, published_line
from fasaco_edge.wire.documents.replies import FloorLeft, FloorReport
from fasaco_edge.wire.reasons import WORDS, plain


def literals(module: object) -> str:
    tree = ast.walk(ast.parse(inspect.getsource(module)))
    return "".join(
        n.value for n in tree if isinstance(n, ast.Constant) and isinstance(n.value, str)
    )


def test_each_reason_is_published_by_a_mission() -> None:
    assert set(WORDS) == {BETTER, "line polished"}
    assert "line polished" in literals(published_line)
    assert " m2 if walls are a pixel thinner than on the map" in literals(floor_left)


def test_a_reason_is_shown_in_plain_words() -> None:
    assert plain(f"path 3, 9 steps: {BETTER}").endswith("steps: " + WORDS[BETTER])
    ending = (
        "47.8 of 49.4 m2 of floor swept, or of 53.7 m2 if walls are a pixel thinner than on the map"
    )
    possible = " (of 53.7 m2 if the map shows walls too thick)"
    assert plain(ending) == "47.8 of 49.4 m2 of floor swept"
    assert swept(FloorReport(47.8, 49.4, (FloorLeft(1.6),), (), 53.7)).endswith(" m2" + possible)
    assert plain("path blocked at cell (-7, 17)") == "path blocked"
    for text in ("map: 3 cells more", "path blocked", "map: passages changed at 2 cells", ""):
        assert plain(text) == text
