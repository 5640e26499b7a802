"""Panels as SVG, for a page: the same values that ``bench.chart`` draws with Pillow.

Colours of text and rules are the page's own, so that they follow its light and dark.

How the page looks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

from fasaco_edge.drawing.chart import Line, Panel
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


STYLE: Final = """
:root { --paper: #fbfbfa; --card: #ffffff; --ink: #1f2937; --faint: #5b6472; --rule: #dfe3e8;
  --good: #0b6e4f; --good-paper: #e2f4ec; --bad: #a3320b; --bad-paper: #fdebe3;
  --open: #6b5200; --open-paper: #fbf2d5; }
@media (prefers-color-scheme: dark) {
  :root { --paper: #14171c; --card: #1c2027; --ink: #e6e9ee; --faint: #a3acba; --rule: #343b46;
    --good: #7fe0bb; --good-paper: #123328; --bad: #ffb59b; --bad-paper: #41200f;
    --open: #f0d583; --open-paper: #3a3010; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink);
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Liberation Sans", sans-serif; }
main { max-width: 1100px; margin: 0 auto; padding: 32px 24px 64px; }
h1 { font-size: 28px; line-height: 1.2; margin: 0 0 12px; overflow-wrap: anywhere; }
h2 { font-size: 20px; margin: 40px 0 12px; }
h3 { font-size: 16px; margin: 0; }
p { margin: 6px 0; }
.kind { color: var(--faint); margin: 0; }
.lead { max-width: 72ch; color: var(--faint); }
.verdict { display: table; padding: 4px 12px; border-radius: 6px; font-weight: 600; }
.verdict.good { color: var(--good); background: var(--good-paper); }
.verdict.bad { color: var(--bad); background: var(--bad-paper); }
.verdict.open { color: var(--open); background: var(--open-paper); }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(130px, 1fr)); gap: 12px;
  margin: 20px 0; }
.tiles div { background: var(--card); border: 1px solid var(--rule); border-radius: 8px;
  padding: 12px 14px; }
.tiles b { display: block; font-size: 22px; line-height: 1.3; white-space: nowrap; }
.tiles span { color: var(--faint); font-size: 14px; line-height: 1.3; display: block; }
figure { margin: 0; min-width: 0; }
.maps { display: grid; gap: 20px; }
.maps.two { grid-template-columns: 1fr 1fr; }
.maps img { max-width: 100%; display: block; margin: 0 auto 12px; border-radius: 8px;
  border: 1px solid var(--rule); }
.charts { display: grid; grid-template-columns: 1fr; gap: 16px; }
.chart { background: var(--card); border: 1px solid var(--rule); border-radius: 8px;
  padding: 14px 16px; }
.chart p { color: var(--faint); font-size: 14px; margin: 0 0 4px; }
.chart svg { width: 100%; max-width: 900px; display: block; margin: 0 auto; }
svg .rule { stroke: var(--rule); }
svg .tick { fill: var(--faint); font-size: 12px; }
svg .name { fill: var(--ink); font-size: 12px; }
.dot { display: inline-block; width: 11px; height: 11px; border-radius: 50%; margin-right: 7px; }
.wide { overflow-x: auto; margin: 8px 0 16px; }
table { border-collapse: collapse; background: var(--card); border: 1px solid var(--rule);
  font-variant-numeric: tabular-nums; }
th, td { padding: 5px 14px; text-align: right; border-top: 1px solid var(--rule);
  vertical-align: top; }
th { color: var(--faint); font-weight: 600; font-size: 14px; }
th:first-child, td:first-child, .told td:last-child, .told th:last-child,
.plain td { text-align: left; }
.plain td:first-child { color: var(--faint); white-space: nowrap; }
footer { margin-top: 48px; color: var(--faint); font-size: 14px; }
@media (max-width: 720px) { .maps.two { grid-template-columns: 1fr; }
  main { padding: 20px 14px 40px; } }
"""
