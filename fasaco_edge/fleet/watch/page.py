"""The whole screen of a fleet: table of its robots, and the latest events."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console, Group
from rich.text import Text

from fasaco_edge.client.phrases import clock, percent
from fasaco_edge.fleet.watch.robot import FleetRobot, short
from fasaco_edge.fleet.watch.table import robot_table, total_rows
from fasaco_edge.fleet.watch.view import FleetView
from fasaco_edge.text import one_line
from fasaco_edge.watch.blocks import FAINT, Blocks, on_a_line
from fasaco_edge.watch.page import Layout


class FleetPage:
    """Draws a fleet's view as lines of text; caches unchanged parts."""

    def __init__(self, console: Console) -> None:
        self._blocks = Blocks(console)

    def lines(self, view: FleetView, now: float, width: int, height: int) -> list[str]:
        """Return ``height`` lines, each ``width`` characters wide.

        Args:
            view: what to show.
            now: time since the epoch [s].
            width, height: size of the screen, each at least 1 [characters].
        """
        blocks, robots, layout = self._blocks, view.robots(now), Layout.of(width, height)
        page = blocks.block(headline(view, robots, now), width, 1)
        # The legend's line is the table's.
        page += self._table(view, robots, now, width, min(layout.lines + 1, height - 1))
        if layout.entries:
            key = (view.events.count, width, layout)
            page += blocks.keep(
                "log", key, lambda: blocks.log(view.events, width, layout.entries, None)
            )
        return page + [" " * width] * (height - len(page))

    def _table(
        self, view: FleetView, robots: Sequence[FleetRobot], now: float, width: int, lines: int
    ) -> list[str]:
        if not robots or not lines:
            return self._blocks.block(Text(""), width, lines)
        totals = total_rows(view.floor, view.unheard(now), width, self._blocks.glyphs)
        room = lines - len(totals) - 1
        if room <= len(robots):
            return self._blocks.block(robot_table(robots, width, lines), width, lines)
        return self._blocks.block(
            Group(robot_table(robots, width, room), "", *totals), width, lines
        )


def headline(view: FleetView, robots: Sequence[FleetRobot], now: float) -> Text:
    """Return a line that sums up the fleet's activity."""
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
