"""Glyphs of a terminal, coloured half blocks or plain characters, and blocks of lines.

Python writes UTF-8 to a terminal of any usual locale, also C and POSIX (PEP 538, 540).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache

from rich.color import Color, ColorSystem
from rich.console import Console, RenderableType
from rich.segment import Segment
from rich.style import Style
from rich.text import Text

from fasaco_edge.client.phrases import BAD, GOOD, ORDER, PLAIN, Event, EventLog, clock
from fasaco_edge.drawing.palette import Colour
from fasaco_edge.watch import picture

HALF = "▀"
ARROWS = "→↗↑↖←↙↓↘"


# For each kind its colour and plain character. Colours are dark, so that the path stands out, and
# differ in brightness, not only in hue.
_LOOKS: dict[int, tuple[Colour, str]] = {
    picture.UNKNOWN: ((20, 22, 27), " "),
    picture.FLOOR: ((46, 50, 58), "."),
    picture.TO_COVER: ((98, 104, 116), "-"),
    picture.COVERED: ((24, 112, 82), "o"),
    picture.REVISITED: ((176, 122, 40), "8"),
    picture.WALL: ((214, 218, 226), "#"),
    picture.AHEAD: ((72, 128, 240), "+"),
    picture.NEXT: ((255, 240, 110), "*"),
    picture.ROBOT: ((222, 36, 56), "@"),
}

# Sixteen colours are too few: three kinds would have the same grey.
_SYSTEMS = {"256": ColorSystem.EIGHT_BIT, "truecolor": ColorSystem.TRUECOLOR}


@dataclass(frozen=True, slots=True)
class GlyphSet:
    """Capabilities of a terminal.

    Attributes:
        colours: the terminal's colours; None without colours, or with too few.
    """

    colours: ColorSystem | None

    @classmethod
    def of(cls, console: Console) -> GlyphSet:
        """Return the glyphs of a console, which evaluates NO_COLOR, TERM and COLORTERM."""
        colours = None if console.no_color else _SYSTEMS.get(console.color_system or "")
        return cls(colours)

    def lines(self, kinds: picture.Kinds) -> list[str]:
        """Return a picture, uint8 (2 * lines, columns), as lines of text."""
        upper, lower = kinds[0::2], kinds[1::2]
        return [_line(self, a.tobytes(), b.tobytes()) for a, b in zip(upper, lower, strict=True)]

    def sample(self, kind: int) -> Text:
        """Return the character of a kind for a legend."""
        text, above, below = _glyph(self, kind, kind)
        return Text(text, _style(self.colours, above, below) if self.colours else "")

    def bar(self, fraction: float, width: int) -> Text:
        """Return a bar of ``width`` characters, filled up to ``fraction``."""
        filled = round(min(max(fraction, 0.0), 1.0) * width)
        return Text("█" * filled, "green").append("░" * (width - filled), "bright_black")

    def scale(self, pixel_m: float, longest: int) -> str:
        """Return a scale bar of a round length [m], of at most ``longest`` characters."""
        decades = math.floor(math.log10(max(longest * pixel_m, pixel_m)))
        lengths = [digit * 10.0**decades for digit in (5, 2, 1)]
        length_m = next((m for m in lengths if m <= longest * pixel_m), lengths[-1])
        inner = max(round(length_m / pixel_m) - 2, 0)
        return f"├{'─' * inner}┤ {length_m:g} m"

    def drawn(self, segments: Iterable[Segment]) -> str:
        """Return rich's segments as text for this terminal."""
        if self.colours is None:
            return "".join(segment.text for segment in segments)
        return "".join(
            segment.style.render(segment.text, color_system=self.colours)
            if segment.style
            else segment.text
            for segment in segments
        )


# Cached, as most lines of a picture equal lines of the previous one.
@lru_cache(maxsize=512)
def _line(glyphs: GlyphSet, upper: bytes, lower: bytes) -> str:
    runs: list[str] = []
    begin = 0
    for end in range(1, len(upper) + 1):
        ends = end == len(upper)
        if ends or upper[end] != upper[begin] or lower[end] != lower[begin]:
            text, above, below = _glyph(glyphs, upper[begin], lower[begin])
            run = text * (end - begin)
            if glyphs.colours is not None:
                style = _style(glyphs.colours, above, below)
                run = style.render(run, color_system=glyphs.colours)
            runs.append(run)
            begin = end
    return "".join(runs)


def _glyph(glyphs: GlyphSet, upper: int, lower: int) -> tuple[str, int, int]:
    shown = max(upper, lower)
    if shown >= picture.LETTER:
        return picture.LETTERS[shown - picture.LETTER], picture.WALL, picture.UNKNOWN
    if shown >= picture.HEADING:
        return ARROWS[shown - picture.HEADING], picture.WALL, picture.ROBOT
    if glyphs.colours is None:
        return _LOOKS[shown][1], shown, shown
    return (" ", upper, upper) if upper == lower else (HALF, upper, lower)


@lru_cache(maxsize=2 * len(_LOOKS) ** 2)
def _style(_: ColorSystem, above: int, below: int) -> Style:
    """Return a character's style: one object per colour system, as it caches its rendering."""
    front, back = _LOOKS[above][0], _LOOKS[below][0]
    return Style(color=Color.from_rgb(*front), bgcolor=Color.from_rgb(*back))


FAINT = "bright_black"
TONES = {PLAIN: "", GOOD: "green", BAD: "red", ORDER: "yellow"}


class ScreenBlocks:
    """Draws rich's renderables as lines of a given width; unchanged blocks are cached.

    Attributes:
        glyphs: glyphs of the terminal.
    """

    def __init__(self, console: Console) -> None:
        self.glyphs = GlyphSet.of(console)
        self._console = console
        self._kept: dict[str, tuple[object, list[str]]] = {}

    def block(self, shown: RenderableType, width: int, height: int) -> list[str]:
        """Return a renderable as ``height`` lines of ``width`` characters.

        If there are more lines, the last one says how many are left out.
        """
        options = self._console.options.update(width=width, height=None)
        lines = self._console.render_lines(shown, options, pad=True)
        if len(lines) > height > 1:
            more = Text(f"{len(lines) - height + 1} more rows: enlarge the terminal", FAINT)
            lines[height - 1 :] = self._console.render_lines(more, options, pad=True)
        lines = lines[:height]
        drawn = [self.glyphs.drawn(line) for line in lines]
        return drawn + [" " * width] * (height - len(drawn))

    def keep(self, name: str, key: object, draw: Callable[[], list[str]]) -> list[str]:
        """Return the block of a name, drawn again only if the key has changed."""
        kept = self._kept.get(name)
        if kept is None or kept[0] != key:
            kept = self._kept[name] = key, draw()
        return kept[1]

    def legend(self, entries: Iterable[tuple[int, str]]) -> Text:
        """Return a line with a sample of each kind and its name."""
        legend = Text()
        for kind, name in entries:
            legend.append_text(self.glyphs.sample(kind)).append(f" {name} ", FAINT)
        return on_a_line(legend)

    def log(
        self, events: EventLog, width: int, entries: int, scale: tuple[float, int] | None
    ) -> list[str]:
        """Return the newest events below a rule.

        Args:
            events: all events.
            width: width of the lines [characters].
            entries: largest number of events shown.
            scale: edge of a pixel [m], and length of the longest scale bar; None for no scale.
        """
        bar = f" {self.glyphs.scale(*scale)} " if scale is not None else ""
        lines = self.block(on_a_line(Text(f"{bar} lately {'─' * width}", FAINT)), width, 1)
        for entry in list(events.entries)[-entries:]:
            lines += self.block(_entry(entry), width, 1)
        return lines


def with_keys(line: Text, width: int, *keys: str) -> Text:
    """Return a headline, followed by as many of the texts ``keys`` as fit into ``width``."""
    for key in keys:
        if line.cell_len + len(key) + 3 <= width:
            line.append(f"   {key}", FAINT)
    return on_a_line(line)


def on_a_line(text: Text) -> Text:
    """Return a text that is cut to fit one line."""
    text.no_wrap, text.overflow = True, "crop"
    return text


def _entry(entry: Event) -> Text:
    return on_a_line(
        Text().append(f"{clock(entry.at_s)} ", FAINT).append(entry.text, TONES[entry.tone])
    )
