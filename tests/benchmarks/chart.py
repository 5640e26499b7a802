"""Line charts, one below the other on a picture, drawn with Pillow."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from PIL import Image, ImageDraw, ImageFont

from fasaco_edge.drawing import palette
from fasaco_edge.drawing.palette import Colour
from fasaco_edge.text import one_line

PANEL_PX = (430, 290)
# Left, top, right, bottom: space for numbers and names around a panel's axes.
BORDER_PX = (62, 64, 16, 46)
MARGIN_PX = 20
LABEL_PX, NUMBER_PX = 14, 12
DOT_PX = 3.0
OVERSAMPLING = 3
MOST_TICKS = 6
# Longest text [characters].
MOST_CHARACTERS = 200


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis: its name, its ends, and the values marked on it, with their labels."""

    label: str
    low: float
    high: float
    ticks: tuple[tuple[float, str], ...]

    @classmethod
    def linear(cls, label: str, values: Sequence[float]) -> Axis:
        """Return an axis over ``values``, one at least, and zero, with round numbers on it."""
        low, high = min(*values, 0.0), max(*values, 0.0)
        step = _round_step((high - low or 1.0) / (MOST_TICKS - 1))
        first, last = math.floor(low / step), max(math.ceil(high / step), 1)
        ticks = tuple((step * k, f"{step * k:.6g}") for k in range(first, last + 1))
        return cls(label, step * first, step * last, ticks)

    def share(self, value: float) -> float:
        """Return where a value lies: 0 at the low end, 1 at the high one."""
        return (value - self.low) / (self.high - self.low)


@dataclass(frozen=True, slots=True)
class Line:
    """Points (x, y), joined by a line of that width [px]; or a dot at each, for width 0."""

    colour: Colour
    points: tuple[tuple[float, float], ...]
    width: float


@dataclass(frozen=True, slots=True)
class Panel:
    """One chart: heading, a line below it, axes, and lines."""

    title: str
    caption: str
    x: Axis
    y: Axis
    lines: tuple[Line, ...]


def draw_panels(panels: Sequence[Panel]) -> Image.Image:
    """Return a picture, RGB, of panels, one below the other."""
    width, height = PANEL_PX
    size = (2 * MARGIN_PX + width, len(panels) * height + MARGIN_PX)
    sheet = Image.new("RGB", (size[0] * OVERSAMPLING, size[1] * OVERSAMPLING), palette.PAPER)
    pen = _Pen(ImageDraw.Draw(sheet))
    for row, panel in enumerate(panels):
        _draw_panel(pen, panel, MARGIN_PX, row * height)
    return sheet.reduce(OVERSAMPLING)


class _Pen:
    """Draws in pixels of the finished picture."""

    def __init__(self, draw: ImageDraw.ImageDraw) -> None:
        self._draw = draw

    def text(self, x: float, y: float, text: str, size: int, colour: Colour, anchor: str) -> None:
        text = one_line(text, MOST_CHARACTERS)
        font = ImageFont.load_default(size * OVERSAMPLING)
        self._draw.text((x * OVERSAMPLING, y * OVERSAMPLING), text, colour, font, anchor=anchor)

    def line(self, points: Sequence[tuple[float, float]], colour: Colour, width: float) -> None:
        scaled = [(x * OVERSAMPLING, y * OVERSAMPLING) for x, y in points]
        self._draw.line(scaled, colour, round(width * OVERSAMPLING), joint="curve")

    def dot(self, x: float, y: float, radius: float, colour: Colour) -> None:
        box = (x - radius, y - radius, x + radius, y + radius)
        self._draw.ellipse(tuple(edge * OVERSAMPLING for edge in box), colour)


def _draw_panel(pen: _Pen, panel: Panel, left: float, top: float) -> None:
    """Draw a panel whose upper left corner is (left, top)."""
    x0, y0 = left + BORDER_PX[0], top + BORDER_PX[1]
    x1, y1 = left + PANEL_PX[0] - BORDER_PX[2], top + PANEL_PX[1] - BORDER_PX[3]
    pen.text(x0, top + 8, panel.title, LABEL_PX, palette.INK, "lt")
    pen.text(x0, top + 28, panel.caption, NUMBER_PX, palette.FAINT_INK, "lt")

    def place(x: float, y: float) -> tuple[float, float]:
        return x0 + panel.x.share(x) * (x1 - x0), y1 - panel.y.share(y) * (y1 - y0)

    for value, text in panel.x.ticks:
        x, _ = place(value, panel.y.low)
        pen.line([(x, y0), (x, y1)], palette.RULE, 0.7)
        pen.text(x, y1 + 6, text, NUMBER_PX, palette.FAINT_INK, "mt")
    for value, text in panel.y.ticks:
        _, y = place(panel.x.low, value)
        pen.line([(x0, y), (x1, y)], palette.RULE, 0.7)
        pen.text(x0 - 6, y, text, NUMBER_PX, palette.FAINT_INK, "rm")
    pen.text((x0 + x1) / 2, y1 + 24, panel.x.label, NUMBER_PX, palette.INK, "mt")
    pen.text(x0 - 6, y0 - 8, panel.y.label, NUMBER_PX, palette.INK, "rb")

    # The first line matters most, so it lies on top.
    for line in reversed(panel.lines):
        places = [place(x, y) for x, y in line.points]
        if line.width and len(places) > 1:
            pen.line(places, line.colour, line.width)
        for x, y in () if line.width else places:
            pen.dot(x, y, DOT_PX, line.colour)


def _round_step(least: float) -> float:
    """Return the smallest of 1, 2, 5, 10, 20, ... (and 0.5, 0.2, ...) not below ``least``."""
    power = 10.0 ** math.floor(math.log10(least))
    return power * min(step for step in (1, 2, 5, 10) if step * power >= least * (1 - 1e-9))
