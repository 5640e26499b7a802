"""Watch of one robot, and its screen: picture, figures beside it, legend and the latest events."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

from rich.console import Console, RenderableType
from rich.text import Text

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.client import phrases
from fasaco_edge.client.feed import Feed
from fasaco_edge.client.phrases import age, clock
from fasaco_edge.errors import MalformedMessage
from fasaco_edge.states import TROUBLED
from fasaco_edge.text import one_line, percent
from fasaco_edge.watch import picture
from fasaco_edge.watch.glyphs import FAINT, ScreenBlocks, with_keys
from fasaco_edge.watch.live import Watched
from fasaco_edge.watch.picture import MissionPicture, RobotView
from fasaco_edge.watch.status_table import figures, state_colour
from fasaco_edge.wire.documents.json_text import decode_json

LEGEND = (
    (picture.COVERED, "covered"),
    (picture.REVISITED, "twice"),
    (picture.TO_COVER, "to cover"),
    (picture.FLOOR, "not to cover"),
    (picture.WALL, "wall"),
    (picture.NEXT, "next 3 m"),
    (picture.AHEAD, "path"),
    (picture.HEADING, "robot"),
)


@dataclass(frozen=True, slots=True)
class Layout:
    """Layout of a screen [characters]; figures of width 0 are left out.

    Attributes:
        columns, lines: size of the picture.
        figures: width of the column beside it.
        entries: number of lines of events.
    """

    columns: int
    lines: int
    figures: int
    entries: int

    @classmethod
    def of(cls, width: int, height: int) -> Layout:
        """Return the layout of a screen of this size."""
        figures = 0 if width < 64 else min(max(width * 2 // 5, 34), 50)
        entries = 0 if height < 14 else min(max(height // 5, 4), 14)
        # The headline is above the picture, the legend and a rule are below it.
        lines = max(height - 2 - (entries + 1 if entries else 0), 0)
        return cls(width - figures - (1 if figures else 0), lines, figures, entries)


class Page:
    """Drawing of a robot's view as lines of text, with a cache for unchanged parts."""

    def __init__(self, console: Console) -> None:
        self._blocks = ScreenBlocks(console)
        self._picture = MissionPicture()

    def lines(self, view: RobotView, now: float, width: int, height: int, *keys: str) -> list[str]:
        """Return ``height`` lines, each ``width`` characters wide.

        Args:
            view: what to show.
            now: time since the epoch [s].
            width, height: size of the screen, each at least 1 [characters].
            keys: hints for the headline, if they fit.
        """
        layout = Layout.of(width, height)
        page = self._blocks.block(headline(view, now, width, *keys), width, 1)
        if layout.lines:
            page += self._middle(view, time_to_go(view, now), layout)
            whole = self._picture.path_is_whole
            key: object = (width, whole)
            page += self._blocks.keep(
                "legend", key, lambda: self._blocks.block(self._legend(whole), width, 1)
            )
        if layout.entries:
            key = (view.events.count, self._picture.pixel_m, width, layout)
            page += self._blocks.keep("log", key, lambda: self._log(view, width, layout))
        page += [" " * width] * (height - len(page))
        return page[:height]

    def _middle(self, view: RobotView, to_go: str, layout: Layout) -> list[str]:
        drawn = self._picture.kinds(view, layout.columns, layout.lines)
        if drawn is None:
            left = self._blocks.block(
                Text("no map, no coverage yet", FAINT), layout.columns, layout.lines
            )
        else:
            left = self._blocks.glyphs.lines(drawn)
        if not layout.figures:
            return left
        # Statuses are immutable: a new status is another object.
        key = (view.status, view.rooms, to_go, layout)
        right = self._blocks.keep("figures", key, lambda: self._figures(view, to_go, layout))
        return [f"{a} {b}" for a, b in zip(left, right, strict=True)]

    def _figures(self, view: RobotView, to_go: str, layout: Layout) -> list[str]:
        shown: RenderableType = Text("")
        if view.status is not None:
            glyphs = self._blocks.glyphs
            shown = figures(view.status, view.rooms, to_go, layout.figures, glyphs)
        return self._blocks.block(shown, layout.figures, layout.lines)

    def _legend(self, path_is_whole: bool) -> Text:
        near = f"to {picture.NEAR_M:g} m"
        return self._blocks.legend(
            (kind, near if kind == picture.AHEAD and not path_is_whole else name)
            for kind, name in LEGEND
        )

    def _log(self, view: RobotView, width: int, layout: Layout) -> list[str]:
        pixel_m = self._picture.pixel_m
        scale = None if pixel_m is None else (pixel_m, max(layout.columns // 4, 4))
        return self._blocks.log(view.events, width, layout.entries, scale)


def time_to_go(view: RobotView, now: float) -> str:
    """Return the time that the rest of the path takes, in words; "" if not known."""
    words = "" if view.status is None else phrases.time_to_go(view.status)
    return f"at least {words}" if words and view.grows(now) else words


def headline(view: RobotView, now: float, width: int, *keys: str) -> Text:
    """Return a line that sums up the state, for a width [characters]."""
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
        if status.troubles and status.state not in TROUBLED:
            line.append("  IN TROUBLE", "bold red")
        if status.coverage is not None:
            line.append(f"  {percent(status.coverage.fraction)} of cells")
        if status.path is not None:
            to_go = time_to_go(view, now)
            line.append(f"  path {status.path.revision}")
            line.append(f", {to_go} to go" if to_go else "")
        # The robot moves this much faster on the screen; the time to go is in real seconds.
        scale = view.settings.robot.time_scale
        line.append(f"  {scale:g} x real time" if scale != 1.0 else "", "dim")
    return with_keys(line, width, *keys, clock(now))


class RobotWatch(Watched):
    """The watch of one robot."""

    most_wait_s = 1.0
    view: RobotView

    def __init__(self, feed: Feed, view: RobotView, console: Console) -> None:
        self._feed, self.view = feed, view
        self._page = Page(console)
        self._statuses: list[bytes] = []

    def take(self, timeout_s: float) -> bool:
        items = self._feed.take(timeout_s)
        now = phrases.steady_now()
        for topic, item in items:
            self.view.take(topic, item, now)
        self._statuses = [
            item.payload for topic, item in items if topic == "status" and isinstance(item, Sample)
        ]
        self.view.trouble = self._feed.trouble
        return bool(items)

    def documents(self) -> list[dict[str, object]]:
        """Return the statuses that the last ``take`` received."""
        found = []
        for payload in self._statuses:
            # The view reports unreadable statuses.
            with suppress(MalformedMessage):
                found.append(decode_json(payload))
        return found

    def document(self) -> dict[str, object]:
        """Return the newest status."""
        return decode_json(self.view.document)

    def line(self, now: float) -> str:
        view, status = self.view, self.view.status
        if view.trouble:
            return f"waiting for the bus at {one_line(view.trouble)}"
        if view.gone_since is not None:
            return "waiting for the daemon to return"
        if not view.is_here:
            return f"waiting for a daemon of robot {view.robot}"
        if status is None:
            return "no status from the daemon yet"
        if view.silent_s(now):
            return "the daemon is silent"
        return phrases.figures(status)

    def page(self, now: float, width: int, height: int, *keys: str) -> list[str]:
        return self._page.lines(self.view, now, width, height, *keys)

    def is_known(self) -> bool:
        """Return whether a status of the robot's daemon has arrived."""
        return self.view.status is not None and self.view.is_here

    def is_whole(self) -> bool:
        """Return whether map, coverage and path are known."""
        view = self.view
        return view.map is not None and view.coverage is not None and view.walk.revision > 0
