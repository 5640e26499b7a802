"""Blocks of a page: rich's renderables as lines of a given width, cached while unchanged."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from rich.console import Console, RenderableType
from rich.text import Text

from fasaco_edge.client.events import BAD, GOOD, ORDER, PLAIN, Event, EventLog
from fasaco_edge.client.phrases import clock
from fasaco_edge.watch.glyphs import GlyphSet

FAINT = "bright_black"
TONES = {PLAIN: "", GOOD: "green", BAD: "red", ORDER: "yellow"}


class Blocks:
    """Draws blocks of lines for a terminal.

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
            more = Text(f"{len(lines) - height + 1} more rows: a taller terminal", FAINT)
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
    """Return a headline with as many of ``keys``, texts at its end, as fit into ``width``."""
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
