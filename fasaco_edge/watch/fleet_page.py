"""The whole screen of a fleet: picture, table of its robots, legend and the latest events."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rich.console import Console, Group
from rich.text import Text

from fasaco_edge.client.phrases import clock, percent
from fasaco_edge.text import one_line
from fasaco_edge.watch import picture
from fasaco_edge.watch.blocks import FAINT, Blocks, on_a_line
from fasaco_edge.watch.fleet_picture import FleetPicture
from fasaco_edge.watch.fleet_robot import FleetRobot, short
from fasaco_edge.watch.fleet_table import robot_table, total_rows
from fasaco_edge.watch.fleet_view import FleetView
from fasaco_edge.watch.page import Layout

# In the colour of the first robot.
LEGEND = (
    (picture.HEADING + picture.EIGHTHS, "robot"),
    (picture.WAYS[0], "next metres"),
    (picture.SWEPT[0], "swept"),
    (picture.PARTS[0], "its part"),
    (picture.TWICE, "swept by two"),
    (picture.TO_COVER, "no part"),
    (picture.WALL, "wall"),
)


class FleetPage:
    """Draws a fleet's view as lines of text; caches unchanged parts."""

    def __init__(self, console: Console) -> None:
        self._blocks = Blocks(console)
        self._picture = FleetPicture()

    def lines(self, view: FleetView, now: float, width: int, height: int) -> list[str]:
        """Return ``height`` lines, each ``width`` characters wide.

        Args:
            view: what to show.
            now: time since the epoch [s].
            width, height: size of the screen, each at least 1 [characters].
        """
        blocks, robots, layout = self._blocks, view.robots(now), Layout.of(width, height)
        # On a narrow screen the table is below the picture.
        below = 0 if layout.figures else min(len(robots) + 1, layout.lines // 2)
        layout = replace(layout, lines=layout.lines - below)
        page = blocks.block(headline(view, robots, now), width, 1)
        if layout.lines:
            page += self._middle(view, robots, now, layout)
            page += self._table(view, robots, now, width, below)
            page += blocks.keep("legend", width, lambda: blocks.block(self._legend(), width, 1))
        if layout.entries:
            pixel_m = self._picture.pixel_m
            scale = None if pixel_m is None else (pixel_m, max(layout.columns // 4, 4))
            key = (view.events.count, scale, width, layout)
            page += blocks.keep(
                "log", key, lambda: blocks.log(view.events, width, layout.entries, scale)
            )
        page += [" " * width] * (height - len(page))
        return page[:height]

    def _middle(
        self, view: FleetView, robots: Sequence[FleetRobot], now: float, layout: Layout
    ) -> list[str]:
        drawn = self._picture.kinds(robots, view.maps(), view.floor, layout.columns, layout.lines)
        if drawn is None:
            nothing = Text("no robot of this fleet yet", FAINT)
            left = self._blocks.block(nothing, layout.columns, layout.lines)
        else:
            left = self._blocks.glyphs.lines(drawn)
        if not layout.figures:
            return left
        right = self._table(view, robots, now, layout.figures, layout.lines)
        return [f"{a} {b}" for a, b in zip(left, right, strict=True)]

    def _table(
        self, view: FleetView, robots: Sequence[FleetRobot], now: float, width: int, lines: int
    ) -> list[str]:
        if not robots or not lines:
            return self._blocks.block(Text(""), width, lines)
        glyphs = self._blocks.glyphs
        totals = total_rows(view.floor, view.unheard(now), width, glyphs)
        room = lines - len(totals) - 1
        if room <= len(robots):
            return self._blocks.block(robot_table(robots, width, lines, glyphs), width, lines)
        table = robot_table(robots, width, room, glyphs)
        return self._blocks.block(Group(table, "", *totals), width, lines)

    def _legend(self) -> Text:
        return self._blocks.legend(LEGEND)


def headline(view: FleetView, robots: Sequence[FleetRobot], now: float) -> Text:
    """Return the line that sums up what the fleet does."""
    line = Text().append(f" {short(view.fleet)} ", "bold reverse").append("  ")
    present = [robot for robot in robots if robot.silent_s is None]
    if view.trouble:
        line.append(f"waiting for the bus at {one_line(view.trouble)}", "red")
    elif not robots:
        line.append("waiting for robots of this fleet", "yellow")
        others = ", ".join(sorted(view.others))
        line.append(f"; on this bus: {others}" if others else "")
    elif not present:
        line.append("all robots are gone", "bold red")
    else:
        at_work = sum(robot.is_at_work for robot in robots)
        if all(robot.state == "done" for robot in present):
            line.append("DONE", "bold blue").append("  ")
        line.append(f"{at_work} of {len(robots)} robots at work", "bold green" if at_work else "")
        if view.floor.fraction is not None:
            line.append(f"  {percent(view.floor.fraction)} of cells")
    return on_a_line(line.append(f"   {clock(now)}   q quits", FAINT))
