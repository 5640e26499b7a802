"""Line charts, several on one picture, drawn with Pillow."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from PIL import Image, ImageDraw, ImageFont

from fasaco_edge.drawing import palette
from fasaco_edge.drawing.palette import Colour
from fasaco_edge.text import one_line

COLOURS: tuple[Colour, ...] = (
    palette.BLUE,
    palette.VERMILION,
    palette.GREEN,
    palette.PURPLE,
    palette.SKY,
    palette.ORANGE,
)

PANEL_PX = (430, 290)
# Left, top, right, bottom: space for numbers and names around a panel's axes.
BORDER_PX = (62, 64, 16, 46)
MARGIN_PX = 20
TITLE_PX, LABEL_PX, NUMBER_PX = 22, 14, 12
DOT_PX, LINE_PX, GOAL_PX = 3.0, 2, 13
# Opacity of a band's colour on white.
BAND_SHARE = 0.22
OVERSAMPLING = 3
MOST_TICKS = 6
# Longest text [characters].
MOST_CHARACTERS = 200

Box = tuple[float, float, float, float]
"""Left, upper, right and lower edge [px]."""
Placer = Callable[[float, float], tuple[float, float]]
"""Where a value (x, y) lies [px]."""


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis: its name, its ends, and the values marked on it, with their labels."""

    label: str
    low: float
    high: float
    ticks: tuple[tuple[float, str], ...]
    logarithmic: bool = False

    @classmethod
    def linear(cls, label: str, values: Sequence[float]) -> Axis:
        """Return an axis over ``values``, one at least, and zero, with round numbers on it."""
        low, high = min(*values, 0.0), max(*values, 0.0)
        step = _round_step((high - low or 1.0) / (MOST_TICKS - 1))
        first, last = math.floor(low / step), max(math.ceil(high / step), 1)
        ticks = tuple((step * k, f"{step * k:.6g}") for k in range(first, last + 1))
        return cls(label, step * first, step * last, ticks)

    @classmethod
    def decades(cls, label: str, values: Sequence[float]) -> Axis:
        """Return a logarithmic axis over ``values`` above zero, with powers of ten on it."""
        low = math.floor(math.log10(min(values)) + 1e-9)
        high = max(math.ceil(math.log10(max(values)) - 1e-9), low + 1)
        ticks = tuple((10.0**k, f"{10.0**k:,.10g}") for k in range(low, high + 1))
        return cls(label, 10.0**low, 10.0**high, ticks, True)

    @classmethod
    def marked(cls, label: str, values: Sequence[float]) -> Axis:
        """Return a logarithmic axis with a mark at each of ``values`` above zero."""
        ticks = tuple((value, f"{value:g}") for value in sorted(set(values)))
        return cls(label, ticks[0][0] / 1.5, ticks[-1][0] * 1.5, ticks, True)

    def share(self, value: float) -> float:
        """Return where a value lies: 0 at the low end, 1 at the high one."""
        if not self.logarithmic:
            return (value - self.low) / (self.high - self.low)
        # Values too small for the axis lie on its edge.
        return math.log(max(value, self.low) / self.low) / math.log(self.high / self.low)


@dataclass(frozen=True, slots=True)
class Line:
    """Points (x, y), joined or not, and around them a band (x, low, high).

    Attributes:
        label: its text in the key; "" for no entry.
        colour: of all its parts.
        points: in the order they are joined in.
        band: drawn pale.
        joined: whether a line goes through the points.
        dotted: whether each point is marked.
        width: of the line [px].
    """

    label: str
    colour: Colour
    points: tuple[tuple[float, float], ...]
    band: tuple[tuple[float, float, float], ...] = ()
    joined: bool = True
    dotted: bool = True
    width: float = LINE_PX


@dataclass(frozen=True, slots=True)
class Panel:
    """One chart: heading, a line below it, axes, lines, and goals (x, y) drawn as dashes."""

    title: str
    caption: str
    x: Axis
    y: Axis
    lines: tuple[Line, ...]
    goals: tuple[tuple[float, float], ...] = ()

    def placer(self, box: Box) -> Placer:
        """Return where values lie in a box, y downward as on a screen."""
        x0, y0, x1, y1 = box
        return lambda x, y: (
            x0 + self.x.share(x) * (x1 - x0),
            y1 - self.y.share(y) * (y1 - y0),
        )


def draw_panels(
    title: str, captions: Sequence[str], panels: Sequence[Panel | None], columns: int
) -> Image.Image:
    """Return a picture, RGB, of panels in rows of ``columns``, below a title and captions.

    A place may be left empty: None.
    """
    width, height = PANEL_PX
    rows = -(-len(panels) // columns)
    head = MARGIN_PX + TITLE_PX + 10 + len(captions) * (LABEL_PX + 6)
    size = (2 * MARGIN_PX + columns * width, head + rows * height + MARGIN_PX)
    sheet = Image.new("RGB", (size[0] * OVERSAMPLING, size[1] * OVERSAMPLING), palette.PAPER)
    pen = _Pen(ImageDraw.Draw(sheet))
    pen.text(MARGIN_PX, MARGIN_PX, title, TITLE_PX, palette.INK, "lt")
    for line, caption in enumerate(captions):
        y = MARGIN_PX + TITLE_PX + 10 + line * (LABEL_PX + 6)
        pen.text(MARGIN_PX, y, caption, LABEL_PX, palette.FAINT_INK, "lt")
    for index, panel in enumerate(panels):
        if panel is None:
            continue
        row, column = divmod(index, columns)
        _draw_panel(pen, panel, MARGIN_PX + column * width, head + row * height)
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

    def area(self, points: Sequence[tuple[float, float]], colour: Colour) -> None:
        self._draw.polygon([(x * OVERSAMPLING, y * OVERSAMPLING) for x, y in points], colour)

    def dot(self, x: float, y: float, radius: float, colour: Colour) -> None:
        box = (x - radius, y - radius, x + radius, y + radius)
        self._draw.ellipse(tuple(edge * OVERSAMPLING for edge in box), colour)


def _draw_panel(pen: _Pen, panel: Panel, left: float, top: float) -> None:
    """Draw a panel whose upper left corner is (left, top)."""
    x0, y0 = left + BORDER_PX[0], top + BORDER_PX[1]
    x1, y1 = left + PANEL_PX[0] - BORDER_PX[2], top + PANEL_PX[1] - BORDER_PX[3]
    pen.text(x0, top + 8, panel.title, LABEL_PX, palette.INK, "lt")
    pen.text(x0, top + 28, panel.caption, NUMBER_PX, palette.FAINT_INK, "lt")
    place = panel.placer((x0, y0, x1, y1))

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

    for line in reversed(panel.lines):
        if len(line.band) > 1:
            upper = [place(x, high) for x, _, high in line.band]
            lower = [place(x, low) for x, low, _ in reversed(line.band)]
            pen.area(upper + lower, _pale(line.colour))
    # The first line matters most, so it lies on top.
    for line in reversed(panel.lines):
        places = [place(x, y) for x, y in line.points]
        if line.joined and len(places) > 1:
            pen.line(places, line.colour, line.width)
        for x, y in places if line.dotted else ():
            pen.dot(x, y, DOT_PX, line.colour)
    for x, y in (place(*goal) for goal in panel.goals):
        pen.line([(x - GOAL_PX, y), (x + GOAL_PX, y)], palette.INK, LINE_PX)
    _draw_key(pen, panel, (x0, y0, x1, y1))


def _draw_key(pen: _Pen, panel: Panel, box: Box) -> None:
    """Draw the names of the lines into the corner that the fewest points lie in."""
    lines = [line for line in panel.lines if line.label]
    if not lines:
        return
    font = ImageFont.load_default(NUMBER_PX)
    wide = max(font.getlength(line.label) for line in lines) + 24
    high = len(lines) * (NUMBER_PX + 5) + 5
    x0, y0, x1, y1 = box
    place = panel.placer(box)
    drawn = [at for line in panel.lines for at in _along(line, place)]

    def points_in(corner: tuple[float, float]) -> int:
        left, top = corner
        return sum(left <= x <= left + wide and top <= y <= top + high for x, y in drawn)

    corners = [(left, top) for top in (y0, y1 - high) for left in (x1 - wide, x0)]
    left, top = min(corners, key=points_in)
    for row, line in enumerate(lines):
        y = top + 10 + row * (NUMBER_PX + 5)
        pen.dot(left + wide - 14, y, 4, line.colour)
        pen.text(left + wide - 24, y, line.label, NUMBER_PX, palette.INK, "rm")


def _along(line: Line, place: Placer) -> list[tuple[float, float]]:
    """Return places along a line [px], of unjoined points those alone."""
    places = [place(x, y) for x, y in line.points]
    if not line.joined:
        return places
    between = [
        (a + part / 8 * (c - a), b + part / 8 * (d - b))
        for (a, b), (c, d) in pairwise(places)
        for part in range(8)
    ]
    return between + places[-1:]


def _pale(colour: Colour) -> Colour:
    red, green, blue = (round(255 - BAND_SHARE * (255 - channel)) for channel in colour)
    return red, green, blue


def _round_step(least: float) -> float:
    """Return the smallest of 1, 2, 5, 10, 20, ... (and 0.5, 0.2, ...) not below ``least``."""
    power = 10.0 ** math.floor(math.log10(least))
    return power * min(step for step in (1, 2, 5, 10) if step * power >= least * (1 - 1e-9))
