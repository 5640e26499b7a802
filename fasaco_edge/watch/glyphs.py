"""The glyphs of a terminal: half blocks in the colours it has, or plain characters."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

from rich.color import Color, ColorSystem
from rich.console import Console
from rich.segment import Segment
from rich.style import Style
from rich.text import Text

from fasaco_edge.drawing.palette import Colour
from fasaco_edge.watch import picture

HALF = "▀"
ARROWS, PLAIN_ARROWS = "→↗↑↖←↙↓↘", ">/^\\<,v."


# For each kind its colour, ANSI colour and plain character. Colours are dark, so that the path
# stands out, and differ in brightness, not only in hue. The nearest ANSI colour would be one grey
# for three kinds.
_LOOKS: dict[int, tuple[Colour, str, str]] = {
    picture.UNKNOWN: ((20, 22, 27), "black", " "),
    picture.FLOOR: ((46, 50, 58), "bright_black", "."),
    picture.TO_COVER: ((98, 104, 116), "white", "-"),
    picture.COVERED: ((24, 112, 82), "green", "o"),
    picture.RECOVERED: ((176, 122, 40), "yellow", "8"),
    picture.WALL: ((214, 218, 226), "bright_white", "#"),
    picture.AHEAD: ((72, 128, 240), "bright_blue", "+"),
    picture.NEXT: ((255, 240, 110), "bright_magenta", "*"),
    picture.ROBOT: ((222, 36, 56), "red", "@"),
} | {
    # From black over violet and orange to yellow; few terminals have such colours of their own.
    kind: ((red, green, blue), ansi, plain)
    for kind, (red, green, blue, ansi, plain) in zip(
        picture.FIELD,
        (
            (34, 12, 74, "black", "1"),
            (84, 15, 109, "blue", "2"),
            (132, 32, 107, "magenta", "3"),
            (181, 50, 90, "red", "4"),
            (221, 81, 58, "bright_red", "5"),
            (246, 125, 21, "yellow", "6"),
            (252, 226, 100, "bright_yellow", "7"),
        ),
        strict=True,
    )
}

_SYSTEMS = {
    "standard": ColorSystem.STANDARD,
    "256": ColorSystem.EIGHT_BIT,
    "truecolor": ColorSystem.TRUECOLOR,
}


@dataclass(frozen=True, slots=True)
class GlyphSet:
    """Capabilities of a terminal.

    Attributes:
        colours: None for no colours.
        unicode: whether it knows more than ASCII.
    """

    colours: ColorSystem | None
    unicode: bool

    @classmethod
    def of(cls, console: Console) -> GlyphSet:
        """Return the glyphs of a console, which knows NO_COLOR, TERM and COLORTERM."""
        colours = None if console.no_color else _SYSTEMS.get(console.color_system or "")
        return cls(colours, console.encoding.startswith("utf"))

    def lines(self, kinds: picture.Kinds) -> list[str]:
        """Return a picture, uint8 (2 * lines, columns), as lines of text."""
        upper, lower = kinds[0::2], kinds[1::2]
        return [_line(self, a.tobytes(), b.tobytes()) for a, b in zip(upper, lower, strict=True)]

    def sample(self, kind: int) -> Text:
        """Return the character of a kind for a legend."""
        text, above, below = _glyph(self, kind, kind)
        return Text(text, _style(self.colours, above, below) if self.colours else "")

    def bar(self, fraction: float, width: int) -> Text:
        """Return a bar, ``width`` characters wide, that is filled to a share of it."""
        filled = round(min(max(fraction, 0.0), 1.0) * width)
        full, empty = "█░" if self.unicode else "#."
        return Text(full * filled, "green").append(empty * (width - filled), "bright_black")

    def scale(self, pixel_m: float, longest: int) -> str:
        """Return a scale bar of a round length [m], of at most ``longest`` characters."""
        decades = math.floor(math.log10(max(longest * pixel_m, pixel_m)))
        lengths = [digit * 10.0**decades for digit in (5, 2, 1)]
        length_m = next((m for m in lengths if m <= longest * pixel_m), lengths[-1])
        inner = max(round(length_m / pixel_m) - 2, 0)
        bar = f"├{'─' * inner}┤" if self.unicode else f"|{'-' * inner}|"
        return f"{bar} {length_m:g} m"

    def drawn(self, segments: Iterable[Segment]) -> str:
        """Return segments of rich as text for this terminal."""
        if self.colours is None:
            return "".join(segment.text for segment in segments)
        return "".join(
            segment.style.render(segment.text, color_system=self.colours)
            if segment.style
            else segment.text
            for segment in segments
        )


# The cache of drawn lines: most lines of a picture equal lines of the previous one.
@lru_cache(maxsize=512)
def _line(glyphs: GlyphSet, upper: bytes, lower: bytes) -> str:
    runs: list[str] = []
    begin = 0
    for end in range(1, len(upper) + 1):
        ends = end == len(upper)
        if ends or upper[end] != upper[begin] or lower[end] != lower[begin]:
            runs.append(_run(glyphs, upper[begin], lower[begin], end - begin))
            begin = end
    return "".join(runs)


def _run(glyphs: GlyphSet, upper: int, lower: int, length: int) -> str:
    text, above, below = _glyph(glyphs, upper, lower)
    if glyphs.colours is None:
        return text * length
    style = _style(glyphs.colours, above, below)
    return style.render(text * length, color_system=glyphs.colours)


def _glyph(glyphs: GlyphSet, upper: int, lower: int) -> tuple[str, int, int]:
    """Return a character, and the kinds that its foreground and background show."""
    shown = max(upper, lower)
    if shown >= picture.LETTER:
        letter = picture.LETTERS[shown - picture.LETTER]
        return letter if glyphs.unicode or letter.isascii() else "?", picture.WALL, picture.UNKNOWN
    if shown >= picture.HEADING:
        arrows = ARROWS if glyphs.unicode else PLAIN_ARROWS
        return arrows[shown - picture.HEADING], picture.WALL, picture.ROBOT
    if glyphs.colours is None:
        return _LOOKS[shown][2], shown, shown
    if not glyphs.unicode:
        return " ", shown, shown
    return (" ", upper, upper) if upper == lower else (HALF, upper, lower)


@lru_cache(maxsize=len(_LOOKS) ** 2)
def _style(colours: ColorSystem, above: int, below: int) -> Style:
    (rgb, ansi, _), (rgb_below, ansi_below, _) = _LOOKS[above], _LOOKS[below]
    if colours is ColorSystem.STANDARD:
        return Style(color=ansi, bgcolor=ansi_below)
    return Style(color=Color.from_rgb(*rgb), bgcolor=Color.from_rgb(*rgb_below))
