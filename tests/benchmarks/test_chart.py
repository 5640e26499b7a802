"""Charts: their names, and the numbers on their axes."""

from fasaco_edge.drawing import palette
from tests.benchmarks import chart
from tests.benchmarks.chart import Axis, Line, Panel, draw_panels


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
    lines = (Line(palette.BLUE, ((0.0, 0.0),), 0),)
    axes = Axis.linear("s", [100.0]), Axis.linear("%", [100.0])
    draw_panels([Panel("Title", "what is shown", *axes, lines)])
    upper, size = placed["what is shown"]
    assert placed["%"][0] > upper + size


def test_an_axis_has_round_numbers():
    axis = Axis.linear("%", [0.3, 1.9])
    assert (axis.low, axis.high) == (0.0, 2.0)
    assert [text for _, text in axis.ticks] == ["0", "0.5", "1", "1.5", "2"]
    assert Axis.linear("%", [0.0]).high > 0.0
