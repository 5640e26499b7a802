"""Panels as SVG, for a page: the same values that ``bench.chart`` draws with Pillow.

Colours of text and rules are the page's own, so that they follow its light and dark.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from fasaco_edge.bench.chart import Line, Panel
from fasaco_edge.text import Html, element

WIDTH = 640
# Left, top, right, bottom: room for numbers and names around the axes.
LEFT, TOP, RIGHT, BOTTOM = 118, 22, 14, 44
DOT = 3.2

Place = Callable[[float, float], tuple[float, float]]
"""Where a value lies on the element."""


def svg_of(panel: Panel, height: int) -> Html:
    """Return a panel as an SVG element ``height`` high, without its title and caption."""
    x0, x1, y0, y1 = LEFT, WIDTH - RIGHT, TOP, height - BOTTOM

    def place(x: float, y: float) -> tuple[float, float]:
        return x0 + panel.x.share(x) * (x1 - x0), y1 - panel.y.share(y) * (y1 - y0)

    return element(
        "svg",
        *_rules(panel, (x0, x1, y0, y1)),
        *(part for line in reversed(panel.lines) for part in _drawn(line, place)),
        viewBox=f"0 0 {WIDTH} {height}",
        role="img",
        aria_label=panel.title,
    )


def _rules(panel: Panel, box: tuple[float, float, float, float]) -> Iterator[Html]:
    x0, x1, y0, y1 = box
    for value, text in panel.x.ticks:
        x = x0 + panel.x.share(value) * (x1 - x0)
        yield element("line", class_="rule", x1=f"{x:.1f}", y1=y0, x2=f"{x:.1f}", y2=y1)
        yield _text(text, "tick", f"{x:.1f}", y1 + 16, "middle")
    for value, text in panel.y.ticks:
        y = y1 - panel.y.share(value) * (y1 - y0)
        yield element("line", class_="rule", x1=x0, y1=f"{y:.1f}", x2=x1, y2=f"{y:.1f}")
        yield _text(text, "tick", x0 - 8, f"{y + 4:.1f}", "end")
    yield _text(panel.x.label, "name", (x0 + x1) / 2, y1 + 36, "middle")
    yield _text(panel.y.label, "name", x0 - 8, y0 - 8, "end")


def _text(text: str, kind: str, x: float | str, y: float | str, anchor: str) -> Html:
    return element("text", text, class_=kind, x=x, y=y, text_anchor=anchor)


def _drawn(line: Line, place: Place) -> Iterator[Html]:
    places = [place(x, y) for x, y in line.points]
    colour = f"rgb({line.colour[0]},{line.colour[1]},{line.colour[2]})"
    if line.joined and len(places) > 1:
        points = Html(" ".join(f"{x:.1f},{y:.1f}" for x, y in places))
        width = f"{line.width:g}"
        yield element(
            "polyline",
            points=points,
            fill="none",
            stroke=colour,
            stroke_width=width,
            stroke_linejoin="round",
        )
    for x, y in places if line.dotted else ():
        dot = {"cx": f"{x:.1f}", "cy": f"{y:.1f}", "r": DOT}
        yield element("circle", fill=colour, fill_opacity=0.75, **dot)
