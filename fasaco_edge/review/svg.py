"""Panels as SVG, for a page: the same values that ``bench.chart`` draws with Pillow.

Colours of text and rules are the page's own, so that they follow its light and dark.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from html import escape

from fasaco_edge.bench.chart import Line, Panel

WIDTH = 640
# Left, top, right, bottom: room for numbers and names around the axes.
LEFT, TOP, RIGHT, BOTTOM = 118, 22, 14, 44
DOT = 3.2

Place = Callable[[float, float], tuple[float, float]]
"""Where a value lies on the element."""


def svg_of(panel: Panel, height: int) -> str:
    """Return a panel as an SVG element ``height`` high, without its title and caption."""
    x0, x1, y0, y1 = LEFT, WIDTH - RIGHT, TOP, height - BOTTOM

    def place(x: float, y: float) -> tuple[float, float]:
        return x0 + panel.x.share(x) * (x1 - x0), y1 - panel.y.share(y) * (y1 - y0)

    parts = [
        f'<svg viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{escape(panel.title)}">',
        *_rules(panel, (x0, x1, y0, y1)),
        *(part for line in reversed(panel.lines) for part in _drawn(line, place)),
        "</svg>",
    ]
    return "\n".join(parts)


def _rules(panel: Panel, box: tuple[float, float, float, float]) -> Iterator[str]:
    x0, x1, y0, y1 = box
    for value, text in panel.x.ticks:
        x = x0 + panel.x.share(value) * (x1 - x0)
        yield f'<line class="rule" x1="{x:.1f}" y1="{y0}" x2="{x:.1f}" y2="{y1}"/>'
        yield f'<text class="tick" x="{x:.1f}" y="{y1 + 16}" text-anchor="middle">{text}</text>'
    for value, text in panel.y.ticks:
        y = y1 - panel.y.share(value) * (y1 - y0)
        yield f'<line class="rule" x1="{x0}" y1="{y:.1f}" x2="{x1}" y2="{y:.1f}"/>'
        yield (
            f'<text class="tick" x="{x0 - 8}" y="{y + 4:.1f}" text-anchor="end">'
            f"{escape(text)}</text>"
        )
    middle = (x0 + x1) / 2
    yield f'<text class="name" x="{middle}" y="{y1 + 36}" text-anchor="middle">'
    yield f"{escape(panel.x.label)}</text>"
    yield f'<text class="name" x="{x0 - 8}" y="{y0 - 8}" text-anchor="end">{escape(panel.y.label)}'
    yield "</text>"


def _drawn(line: Line, place: Place) -> Iterator[str]:
    places = [place(x, y) for x, y in line.points]
    colour = f"rgb({line.colour[0]},{line.colour[1]},{line.colour[2]})"
    if line.joined and len(places) > 1:
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
        yield (
            f'<polyline points="{points}" fill="none" stroke="{colour}" '
            f'stroke-width="{line.width:g}" stroke-linejoin="round"/>'
        )
    for x, y in places if line.dotted else ():
        yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{DOT}" fill="{colour}" fill-opacity="0.75"/>'
