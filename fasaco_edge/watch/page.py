"""The whole screen: picture, figures beside it, legend and the latest events."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rich.console import Console, RenderableType
from rich.text import Text

from fasaco_edge.text import one_line
from fasaco_edge.watch import picture
from fasaco_edge.watch.events import BAD, GOOD, ORDER, PLAIN, Event
from fasaco_edge.watch.glyphs import GlyphSet
from fasaco_edge.watch.phrases import age, clock, percent
from fasaco_edge.watch.picture import MissionPicture
from fasaco_edge.watch.robot_view import RobotView
from fasaco_edge.watch.status_table import figures, state_colour
from fasaco_edge.wire.documents.status import Status

FAINT = "bright_black"
TONES = {PLAIN: "", GOOD: "green", BAD: "red", ORDER: "yellow"}
LEGEND = (
    (picture.COVERED, "covered"),
    (picture.RECOVERED, "twice"),
    (picture.TO_COVER, "to cover"),
    (picture.FLOOR, "not to cover"),
    (picture.WALL, "wall"),
    (picture.NEXT, "next 3 m"),
    (picture.AHEAD, "path"),
    (picture.HEADING, "robot"),
)
FIELD_LEGEND = (
    (picture.FIELD[0], "no path"),
    (picture.FIELD[len(picture.FIELD) // 2], "past path, or driven"),
    (picture.FIELD[-1], "every path"),
    (picture.WALL, "wall"),
    (picture.HEADING, "robot"),
)


@dataclass(frozen=True, slots=True)
class Layout:
    """Layout of a screen [characters]; figures of width 0 are left out.

    Attributes:
        columns, lines: of the picture.
        figures: width of the column beside it.
        entries: lines of events.
    """

    columns: int
    lines: int
    figures: int
    entries: int

    @classmethod
    def of(cls, width: int, height: int) -> Layout:
        """Return how to divide a screen."""
        figures = 0 if width < 64 else min(max(width * 2 // 5, 34), 50)
        entries = 0 if height < 14 else min(max(height // 5, 4), 14)
        # Above the picture the headline, below it the legend and a rule.
        lines = max(height - 2 - (entries + 1 if entries else 0), 0)
        return cls(width - figures - (1 if figures else 0), lines, figures, entries)


class Page:
    """Draws a robot view as lines of text; caches unchanged parts."""

    def __init__(self, console: Console) -> None:
        self._glyphs = GlyphSet.of(console)
        self._console = console
        self._picture = MissionPicture()
        self._kept: dict[str, tuple[object, list[str]]] = {}

    def lines(self, view: RobotView, now: float, width: int, height: int) -> list[str]:
        """Return ``height`` lines, each ``width`` characters wide.

        Args:
            view: what to show.
            now: time since the epoch [s].
            width, height: size of the screen, each at least 1 [characters].
        """
        layout = Layout.of(width, height)
        page = self._block(headline(view, now), width, 1)
        if layout.lines:
            page += self._middle(view, layout)
            whole, field = self._picture.path_is_whole, self._picture.shows_field
            key: object = (width, whole, field)
            page += self._keep("legend", key, lambda: self._block(self._legend(whole), width, 1))
        if layout.entries:
            key = (view.events.count, self._picture.pixel_m, width, layout)
            page += self._keep("log", key, lambda: self._log(view, width, layout))
        page += [" " * width] * (height - len(page))
        return page[:height]

    def toggle_field(self) -> bool:
        """Toggle the living trail in place of coverage and path; return whether it is shown."""
        self._picture.shows_field = not self._picture.shows_field
        return self._picture.shows_field

    def _middle(self, view: RobotView, layout: Layout) -> list[str]:
        drawn = self._picture.kinds(view, layout.columns, layout.lines)
        if drawn is None:
            left = self._block(Text("no map, no coverage yet", FAINT), layout.columns, layout.lines)
        else:
            left = self._glyphs.lines(drawn)
        if not layout.figures:
            return left
        # The status is a value: a new one is another object.
        key = (view.status, layout)
        right = self._keep("figures", key, lambda: self._figures(view.status, layout))
        return [f"{a} {b}" for a, b in zip(left, right, strict=True)]

    def _figures(self, status: Status | None, layout: Layout) -> list[str]:
        shown = Text("") if status is None else figures(status, layout.figures, self._glyphs)
        return self._block(shown, layout.figures, layout.lines)

    def _legend(self, path_is_whole: bool) -> Text:
        legend = Text()
        for kind, name in FIELD_LEGEND if self._picture.shows_field else LEGEND:
            cut = kind == picture.AHEAD and not path_is_whole
            label = f"to {picture.NEAR_M:g} m" if cut else name
            legend.append_text(self._glyphs.sample(kind)).append(f" {label} ", FAINT)
        return _on_a_line(legend)

    def _log(self, view: RobotView, width: int, layout: Layout) -> list[str]:
        rule, scale = "─" if self._glyphs.unicode else "-", ""
        if self._picture.pixel_m is not None:
            scale = self._glyphs.scale(self._picture.pixel_m, max(layout.columns // 4, 4))
        title = f" {scale}  lately " if scale else " lately "
        lines = self._block(_on_a_line(Text(f"{title}{rule * width}", FAINT)), width, 1)
        for entry in list(view.events.entries)[-layout.entries :]:
            lines += self._block(_entry(entry), width, 1)
        return lines

    def _block(self, shown: RenderableType, width: int, height: int) -> list[str]:
        """Return a renderable of rich as lines and columns of a given number."""
        options = self._console.options.update(width=width, height=None)
        lines = self._console.render_lines(shown, options, pad=True)[:height]
        drawn = [self._glyphs.drawn(line) for line in lines]
        return drawn + [" " * width] * (height - len(drawn))

    def _keep(self, name: str, key: object, draw: Callable[[], list[str]]) -> list[str]:
        kept = self._kept.get(name)
        if kept is None or kept[0] != key:
            kept = self._kept[name] = key, draw()
        return kept[1]


def headline(view: RobotView, now: float) -> Text:
    """Return the line that sums up the state."""
    line = Text().append(f" {view.robot} ", "bold reverse").append("  ")
    status, silent = view.status, view.silent_s(now)
    if view.trouble:
        line.append(f"waiting for the bus at {one_line(view.trouble)}", "red")
    elif view.gone_since is not None:
        gone = age(now - view.gone_since)
        line.append(f"the daemon has been gone for {gone}; waiting for it to return", "bold red")
    elif not view.is_here:
        others = ", ".join(sorted(view.robots - {view.robot}))
        line.append("waiting for a daemon of that name", "yellow")
        line.append(f"; on this bus: {one_line(others)}" if others else "")
    elif status is None:
        line.append("no status from the daemon yet", "yellow")
    elif silent:
        line.append(f"silent for {age(silent)}", "bold red")
    else:
        line.append(one_line(status.state).upper(), f"bold {state_colour(status.state)}")
        if status.coverage is not None:
            line.append(f"  {percent(status.coverage.fraction)} of cells")
        if status.path is not None:
            line.append(f"  path {status.path.revision}")
    return _on_a_line(line.append(f"   {clock(now)}   f trail   q quits", FAINT))


def _entry(entry: Event) -> Text:
    return _on_a_line(
        Text().append(f"{clock(entry.at_s)} ", FAINT).append(entry.text, TONES[entry.tone])
    )


def _on_a_line(text: Text) -> Text:
    text.no_wrap, text.overflow = True, "crop"
    return text
