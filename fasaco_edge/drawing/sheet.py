"""Sheet around a plot: title and caption above, colour bar, scale bar and key below."""

from __future__ import annotations

import functools
import math
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from fasaco_edge.drawing import palette
from fasaco_edge.drawing.palette import Colour
from fasaco_edge.text import one_line

MARGIN = 28
MIN_WIDTH = 640
TITLE_PX, TEXT_PX = 25, 15
LINE_PX = 22
FOOT_PX = 34
BAR_PX = (220, 10)
SYMBOL_PX = 16
OVERSAMPLING = 4
# Longest line of a caption [characters].
MOST_CHARACTERS = 400

# Pillow's built-in font, which needs no file, has few letters beyond ASCII.
IN_FONT = frozenset("·°±…“”‘’")
SPELT_OUT = str.maketrans({"×": "x", "–": "-", "—": "-", "→": "->", "≤": "<=", "≥": ">="})


@dataclass(frozen=True, slots=True)
class KeyEntry:
    """One symbol of the key.

    Attributes:
        symbol: "tile", "hatch", "disc" or "square".
        colour: its colour.
        label: its meaning.
    """

    symbol: str
    colour: Colour
    label: str


@dataclass(frozen=True, slots=True)
class Sheet:
    """The surroundings of a plot.

    Attributes:
        title: one line, large.
        lines: caption, small.
        key: symbols and their meaning.
        bar: labels at the beginning and the end of the colour bar; None for no bar.
        scale: pixels per unit of the plot.
        unit: unit of the scale bar.
    """

    title: str
    lines: Sequence[str]
    key: Sequence[KeyEntry]
    bar: tuple[str, str] | None
    scale: float
    unit: str = "m"

    def around(self, plot: Image.Image) -> Image.Image:
        """Return the finished picture, RGB, with ``plot`` in its middle."""
        inner = max(plot.width, MIN_WIDTH)
        title = wrapped([self.title], TITLE_PX, inner)
        caption = wrapped(self.lines, TEXT_PX, inner)
        key_rows = _flowed(self.key, inner)
        head = len(title) * (LINE_PX + 10) + len(caption) * LINE_PX + 8
        foot = FOOT_PX + 8 + len(key_rows) * (LINE_PX + 4)
        sheet = Image.new(
            "RGB", (inner + 2 * MARGIN, head + plot.height + foot + 2 * MARGIN), palette.PAPER
        )
        draw = ImageDraw.Draw(sheet)
        y = MARGIN
        for line in title:
            draw.text((MARGIN, y - 4), line, palette.INK, font_of(TITLE_PX))
            y += LINE_PX + 10
        for line in caption:
            draw.text((MARGIN, y), line, palette.FAINT_INK, font_of(TEXT_PX))
            y += LINE_PX
        x, y = MARGIN + (inner - plot.width) // 2, MARGIN + head
        sheet.paste(plot, (x, y))
        draw.rectangle((x - 1, y - 1, x + plot.width, y + plot.height), outline=palette.RULE)
        y += plot.height + 18
        self._scale_bar(draw, MARGIN, y, plot.width)
        if self.bar is not None:
            self._colour_bar(sheet, draw, self.bar, MARGIN + inner, y)
        for row, entries in enumerate(key_rows):
            for left, entry in entries:
                place = (MARGIN + left, y + FOOT_PX + row * (LINE_PX + 4))
                sheet.paste(_symbol(entry), place)
                after = (place[0] + SYMBOL_PX + 8, place[1] + SYMBOL_PX // 2)
                draw.text(after, entry.label, palette.INK, font_of(TEXT_PX), anchor="lm")
        return sheet

    def _scale_bar(self, draw: ImageDraw.ImageDraw, x: int, y: int, plot_width: int) -> None:
        length = _round_length(min(plot_width, 4 * BAR_PX[0]) / 4 / self.scale)
        right = x + round(length * self.scale)
        for left_end, upper, right_end, lower in (
            (x, y + 4, right, y + 5),
            (x, y, x + 1, y + 9),
            (right - 1, y, right, y + 9),
        ):
            draw.rectangle((left_end, upper, right_end, lower), palette.INK)
        draw.text(
            (right + 10, y + 5),
            f"{length:g} {self.unit}",
            palette.INK,
            font_of(TEXT_PX),
            anchor="lm",
        )

    @staticmethod
    def _colour_bar(
        sheet: Image.Image, draw: ImageDraw.ImageDraw, bar: tuple[str, str], right: int, y: int
    ) -> None:
        font = font_of(TEXT_PX)
        before, after = bar
        draw.text((right, y + 5), after, palette.INK, font, anchor="rm")
        end = right - math.ceil(font.getlength(after)) - 10
        width, height = BAR_PX
        colours = palette.gradient(np.linspace(0, 1, width))
        sheet.paste(Image.fromarray(np.tile(colours, (height, 1, 1))), (end - width, y))
        draw.text((end - width - 10, y + 5), before, palette.INK, font, anchor="rm")


@functools.cache
def font_of(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Return the font of all text, ``size`` pixels high."""
    return ImageFont.load_default(size)


def _drawable(text: str) -> str:
    """Return ``text`` in letters that the font has: m² becomes m2, é becomes e."""
    decomposed = "".join(
        letter if letter in IN_FONT else unicodedata.normalize("NFKD", letter)
        for letter in one_line(text, MOST_CHARACTERS).translate(SPELT_OUT)
    )
    return "".join(
        letter if letter.isascii() or letter in IN_FONT else "?"
        for letter in decomposed
        if not unicodedata.combining(letter)
    )


def wrapped(lines: Sequence[str], size: int, width: int) -> list[str]:
    """Return ``lines`` in letters that the font has, broken to fit into ``width`` [px]."""
    font, broken = font_of(size), []
    for line in map(_drawable, lines):
        current = ""
        for word in line.split():
            longer = f"{current} {word}".strip()
            if current and font.getlength(longer) > width:
                broken.append(current)
                longer = word
            current = longer
        broken.append(current)
    return [line for line in broken if line]


def _flowed(entries: Sequence[KeyEntry], width: int) -> list[list[tuple[int, KeyEntry]]]:
    rows: list[list[tuple[int, KeyEntry]]] = []
    left = width
    for entry in entries:
        wide = SYMBOL_PX + 8 + math.ceil(font_of(TEXT_PX).getlength(entry.label)) + 26
        if not rows or left + wide > width:
            rows.append([])
            left = 0
        rows[-1].append((left, entry))
        left += wide
    return rows


def _symbol(entry: KeyEntry) -> Image.Image:
    size = SYMBOL_PX * OVERSAMPLING
    image = Image.new("RGB", (size, size), palette.PAPER)
    draw = ImageDraw.Draw(image)
    box = (0, 0, size - 1, size - 1)
    if entry.symbol == "disc":
        draw.ellipse(box, entry.colour)
        draw.ellipse((size * 0.33, size * 0.33, size * 0.67, size * 0.67), palette.PAPER)
    elif entry.symbol == "hatch":
        for start in range(-size, size, size // 3):
            draw.line((start, size, start + size, 0), entry.colour, size // 10)
    else:
        draw.rectangle(box, entry.colour)
        if entry.symbol == "square":
            draw.rectangle((size * 0.35, size * 0.35, size * 0.65, size * 0.65), palette.PAPER)
    if entry.symbol in ("tile", "hatch"):
        draw.rectangle(box, outline=palette.RULE, width=OVERSAMPLING)
    return image.reduce(OVERSAMPLING)


def _round_length(most: float) -> float:
    """Return the largest of 1, 2, 5, 10, 20, ... (and 0.5, 0.2, ...) not above ``most``."""
    power = 10.0 ** math.floor(math.log10(most))
    return power * max(step for step in (1, 2, 5) if step * power <= most * (1 + 1e-9))
