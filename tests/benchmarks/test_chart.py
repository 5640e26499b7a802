"""Charts: names and numbers stand beside what is drawn, and not on it."""

import pytest

from fasaco_edge.drawing import palette
from tests.benchmarks import chart
from tests.benchmarks.chart import Axis, Line, Panel, draw_panels

X, Y = Axis.linear("s", [100.0]), Axis.linear("%", [100.0])


def panel(points, caption=""):
    lines = (Line("left", palette.BLUE, points), Line("right", palette.VERMILION, points))
    return Panel("Title", caption, X, Y, lines)


@pytest.mark.parametrize(
    ("points", "is_low", "is_left"),
    [
        (((0.0, 0.0), (50.0, 60.0), (100.0, 100.0)), False, True),
        (((0.0, 100.0), (100.0, 0.0)), False, False),
        (((0.0, 0.0), (0.0, 100.0), (100.0, 100.0)), True, False),
    ],
)
def test_the_key_stands_where_no_line_runs(points, is_low, is_left, monkeypatch):
    placed = []
    text = chart._Pen.text
    monkeypatch.setattr(
        chart._Pen,
        "text",
        lambda pen, x, y, words, *rest: (
            placed.append((words, x, y)),
            text(pen, x, y, words, *rest),
        ),
    )
    picture = draw_panels("", (), [panel(points)], 1)
    ((x, y),) = {(x, y) for words, x, y in placed if words == "left"}
    assert (y > picture.height / 2) == is_low
    assert (x < picture.width / 2) == is_left


def test_the_unit_stands_below_the_caption(monkeypatch):
    """Beside it they would be read as one."""
    placed = {}
    text = chart._Pen.text
    monkeypatch.setattr(
        chart._Pen,
        "text",
        lambda pen, x, y, words, size, colour, anchor: (
            placed.setdefault(words, (y - size if anchor[1] == "b" else y, size)),
            text(pen, x, y, words, size, colour, anchor),
        ),
    )
    draw_panels("", (), [panel(((0.0, 0.0),), caption="what is shown")], 1)
    upper, size = placed["what is shown"]
    assert placed["%"][0] > upper + size
