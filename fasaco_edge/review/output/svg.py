"""Charts as SVG, of the panels that ``drawing.chart`` draws with Pillow.

Text and rules get their colours from the page's style.
"""

from __future__ import annotations

from collections.abc import Iterator

from fasaco_edge.drawing.chart import Line, Panel, Placer
from fasaco_edge.text import Html, element

WIDTH = 640
# Left, top, right, bottom: space for numbers and names around the axes.
LEFT, TOP, RIGHT, BOTTOM = 118, 22, 14, 44
DOT = 3.2


def svg_of(panel: Panel, height: int) -> Html:
    """Return a panel as an SVG element ``height`` high, without its title and caption."""
    box = LEFT, TOP, WIDTH - RIGHT, height - BOTTOM
    place = panel.placer(box)
    return element(
        "svg",
        *_rules(panel, box),
        *(part for line in reversed(panel.lines) for part in _drawn(line, place)),
        viewBox=f"0 0 {WIDTH} {height}",
        role="img",
        aria_label=panel.title,
    )


def _rules(panel: Panel, box: tuple[int, int, int, int]) -> Iterator[Html]:
    (x0, y0, x1, y1), place = box, panel.placer(box)
    for value, text in panel.x.ticks:
        x, _ = place(value, panel.y.low)
        yield element("line", class_="rule", x1=f"{x:.1f}", y1=y0, x2=f"{x:.1f}", y2=y1)
        yield _text(text, "tick", f"{x:.1f}", y1 + 16, "middle")
    for value, text in panel.y.ticks:
        _, y = place(panel.x.low, value)
        yield element("line", class_="rule", x1=x0, y1=f"{y:.1f}", x2=x1, y2=f"{y:.1f}")
        yield _text(text, "tick", x0 - 8, f"{y + 4:.1f}", "end")
    yield _text(panel.x.label, "name", (x0 + x1) / 2, y1 + 36, "middle")
    yield _text(panel.y.label, "name", x0 - 8, y0 - 8, "end")


def _drawn(line: Line, place: Placer) -> Iterator[Html]:
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


def _text(text: str, kind: str, x: float | str, y: float | str, anchor: str) -> Html:
    return element("text", text, class_=kind, x=x, y=y, text_anchor=anchor)
