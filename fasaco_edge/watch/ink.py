"""What a picture is printed with: half blocks in the colours there are, or plain characters."""

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

from fasaco_edge.watch import picture

HALF = "▀"
ARROWS, PLAIN_ARROWS = "→↗↑↖←↙↓↘", ">/^\\<,v."

_KINDS = (
    picture.UNKNOWN,
    picture.FLOOR,
    picture.TO_COVER,
    picture.COVERED,
    picture.RECOVERED,
    picture.WALL,
    picture.AHEAD,
    picture.NEXT,
    picture.ROBOT,
)
# By kind. Dark, so that the path stands out; apart in brightness, not in hue alone.
_RGB = (
    (20, 22, 27),
    (46, 50, 58),
    (98, 104, 116),
    (24, 112, 82),
    (176, 122, 40),
    (214, 218, 226),
    (72, 128, 240),
    (255, 240, 110),
    (222, 36, 56),
)
# The nearest of sixteen would be the same grey for three of them.
_ANSI = (
    "black",
    "bright_black",
    "white",
    "green",
    "yellow",
    "bright_white",
    "bright_blue",
    "bright_magenta",
    "red",
)
_PLAIN = " .-o8#+*@"

_SYSTEMS = {
    "standard": ColorSystem.STANDARD,
    "256": ColorSystem.EIGHT_BIT,
    "truecolor": ColorSystem.TRUECOLOR,
}


@dataclass(frozen=True, slots=True)
class Ink:
    """What a terminal can show.

    Attributes:
        colours: None for no colours.
        unicode: whether it knows more than ASCII.
    """

    colours: ColorSystem | None
    unicode: bool

    @classmethod
    def of(cls, console: Console) -> Ink:
        """Return the ink of a console, which knows NO_COLOR, TERM and COLORTERM."""
        colours = None if console.no_color else _SYSTEMS.get(console.color_system or "")
        return cls(colours, console.encoding.startswith("utf"))

    def lines(self, kinds: picture.Kinds) -> list[str]:
        """Return a picture, uint8 (2 * lines, columns), as lines of text."""
        upper, lower = kinds[0::2], kinds[1::2]
        return [_line(self, a.tobytes(), b.tobytes()) for a, b in zip(upper, lower, strict=True)]

    def sample(self, kind: int) -> Text:
        """Return what stands for a kind in a legend, one character."""
        text, above, below = _glyph(self, kind, kind)
        return Text(text, _style(self.colours, above, below) if self.colours else "")

    def bar(self, fraction: float, width: int) -> Text:
        """Return a bar, ``width`` characters wide, that is filled to a share of it."""
        filled = round(min(max(fraction, 0.0), 1.0) * width)
        full, empty = "█░" if self.unicode else "#."
        return Text(full * filled, "green").append(empty * (width - filled), "bright_black")

    def scale(self, pixel_m: float, longest: int) -> str:
        """Return a bar that is a round length long [m], of at most ``longest`` characters."""
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


# Most lines of a picture are those of the one before.
@lru_cache(maxsize=512)
def _line(ink: Ink, upper: bytes, lower: bytes) -> str:
    runs: list[str] = []
    begin = 0
    for end in range(1, len(upper) + 1):
        ends = end == len(upper)
        if ends or upper[end] != upper[begin] or lower[end] != lower[begin]:
            runs.append(_run(ink, upper[begin], lower[begin], end - begin))
            begin = end
    return "".join(runs)


def _run(ink: Ink, upper: int, lower: int, length: int) -> str:
    text, above, below = _glyph(ink, upper, lower)
    if ink.colours is None:
        return text * length
    style = _style(ink.colours, above, below)
    return style.render(text * length, color_system=ink.colours)


def _glyph(ink: Ink, upper: int, lower: int) -> tuple[str, int, int]:
    """Return a character, and the kinds its ink and its paper have the colours of."""
    shown = max(upper, lower)
    if shown >= picture.HEADING:
        arrows = ARROWS if ink.unicode else PLAIN_ARROWS
        return arrows[shown - picture.HEADING], picture.WALL, picture.ROBOT
    if ink.colours is None:
        return _PLAIN[shown], shown, shown
    if not ink.unicode:
        return " ", shown, shown
    return (" ", upper, upper) if upper == lower else (HALF, upper, lower)


@lru_cache(maxsize=len(_KINDS) ** 2)
def _style(colours: ColorSystem, above: int, below: int) -> Style:
    if colours is ColorSystem.STANDARD:
        return Style(color=_ANSI[above], bgcolor=_ANSI[below])
    return Style(color=Color.from_rgb(*_RGB[above]), bgcolor=Color.from_rgb(*_RGB[below]))
