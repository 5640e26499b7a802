"""The whole screen: picture, figures, legend and what happened lately."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rich.console import Console, RenderableType
from rich.text import Text

from fasaco_edge.text import one_line
from fasaco_edge.watch import picture
from fasaco_edge.watch.figures import figures, state_colour
from fasaco_edge.watch.ink import Ink
from fasaco_edge.watch.phrases import age, clock, percent
from fasaco_edge.watch.picture import Picturing
from fasaco_edge.watch.robot_view import BAD, GOOD, ORDER, PLAIN, Event, RobotView
from fasaco_edge.wire.status import Status

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


@dataclass(frozen=True, slots=True)
class Plan:
    """How a screen is divided [characters]; figures of width 0 are left out.

    Attributes:
        columns, lines: of the picture.
        figures: width of the column beside it.
        entries: lines of what happened lately.
    """

    columns: int
    lines: int
    figures: int
    entries: int

    @classmethod
    def of(cls, width: int, height: int) -> Plan:
        """Return how to divide a screen."""
        figures = 0 if width < 64 else min(max(width * 2 // 5, 34), 50)
        entries = 0 if height < 14 else min(max(height // 5, 4), 14)
        # Above the picture the headline, below it the legend and a rule.
        lines = max(height - 2 - (entries + 1 if entries else 0), 0)
        return cls(width - figures - (1 if figures else 0), lines, figures, entries)


class Page:
    """Draws what is known as lines of text; keeps what did not change."""

    def __init__(self, console: Console) -> None:
        self._ink = Ink.of(console)
        self._console = console
        self._picturing = Picturing()
        self._kept: dict[str, tuple[object, list[str]]] = {}

    def lines(self, view: RobotView, now: float, width: int, height: int) -> list[str]:
        """Return ``height`` lines, each ``width`` characters wide.

        Args:
            view: what to show.
            now: time since the epoch [s].
            width, height: size of the screen, each at least 1 [characters].
        """
        plan = Plan.of(width, height)
        page = self._block(headline(view, now), width, 1)
        if plan.lines:
            page += self._middle(view, plan)
            whole = self._picturing.path_is_whole
            key: object = (width, whole)
            page += self._keep("legend", key, lambda: self._block(self._legend(whole), width, 1))
        if plan.entries:
            key = (view.events.count, self._picturing.pixel_m, width, plan)
            page += self._keep("log", key, lambda: self._log(view, width, plan))
        page += [" " * width] * (height - len(page))
        return page[:height]

    def _middle(self, view: RobotView, plan: Plan) -> list[str]:
        drawn = self._picturing.kinds(view, plan.columns, plan.lines)
        if drawn is None:
            left = self._block(Text("no map, no coverage yet", FAINT), plan.columns, plan.lines)
        else:
            left = self._ink.lines(drawn)
        if not plan.figures:
            return left
        # The status is a value: a new one is another object.
        key = (view.status, plan)
        right = self._keep("figures", key, lambda: self._figures(view.status, plan))
        return [f"{a} {b}" for a, b in zip(left, right, strict=True)]

    def _figures(self, status: Status | None, plan: Plan) -> list[str]:
        shown = Text("") if status is None else figures(status, plan.figures, self._ink)
        return self._block(shown, plan.figures, plan.lines)

    def _legend(self, path_is_whole: bool) -> Text:
        legend = Text()
        for kind, name in LEGEND:
            cut = kind == picture.AHEAD and not path_is_whole
            told = f"to {picture.NEAR_M:g} m" if cut else name
            legend.append_text(self._ink.sample(kind)).append(f" {told} ", FAINT)
        return _on_a_line(legend)

    def _log(self, view: RobotView, width: int, plan: Plan) -> list[str]:
        rule, scale = "─" if self._ink.unicode else "-", ""
        if self._picturing.pixel_m is not None:
            scale = self._ink.scale(self._picturing.pixel_m, max(plan.columns // 4, 4))
        title = f" {scale}  lately " if scale else " lately "
        lines = self._block(_on_a_line(Text(f"{title}{rule * width}", FAINT)), width, 1)
        for entry in list(view.events.entries)[-plan.entries :]:
            lines += self._block(_entry(entry), width, 1)
        return lines

    def _block(self, shown: RenderableType, width: int, height: int) -> list[str]:
        """Return something of rich in so many lines and columns."""
        options = self._console.options.update(width=width, height=None)
        lines = self._console.render_lines(shown, options, pad=True)[:height]
        drawn = [self._ink.drawn(line) for line in lines]
        return drawn + [" " * width] * (height - len(drawn))

    def _keep(self, name: str, key: object, draw: Callable[[], list[str]]) -> list[str]:
        kept = self._kept.get(name)
        if kept is None or kept[0] != key:
            kept = self._kept[name] = key, draw()
        return kept[1]


def headline(view: RobotView, now: float) -> Text:
    """Return the line that says how it stands."""
    line = Text().append(f" {view.robot} ", "bold reverse").append("  ")
    status, silent = view.status, view.silent_s(now)
    if view.trouble:
        line.append(f"waiting for the bus at {one_line(view.trouble)}", "red")
    elif view.gone_since is not None:
        gone = age(now - view.gone_since)
        line.append(f"the daemon is gone for {gone}; waiting for it to come back", "bold red")
    elif not view.is_here:
        others = ", ".join(sorted(view.robots - {view.robot}))
        line.append("waiting for a daemon of that name", "yellow")
        line.append(f"; on this bus: {one_line(others)}" if others else "")
    elif status is None:
        line.append("the daemon has said nothing yet", "yellow")
    elif silent:
        line.append(f"silent for {age(silent)}", "bold red")
    else:
        line.append(one_line(status.state).upper(), f"bold {state_colour(status.state)}")
        if status.coverage is not None:
            line.append(f"  {percent(status.coverage.fraction)} covered")
        if status.path is not None:
            line.append(f"  path {status.path.revision}")
    return _on_a_line(line.append(f"   {clock(now)}   q quits", FAINT))


def _entry(entry: Event) -> Text:
    return _on_a_line(
        Text().append(f"{clock(entry.at_s)} ", FAINT).append(entry.text, TONES[entry.tone])
    )


def _on_a_line(text: Text) -> Text:
    text.no_wrap, text.overflow = True, "crop"
    return text
