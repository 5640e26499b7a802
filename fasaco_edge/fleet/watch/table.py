"""The table of a fleet: one row per robot with its activity, and the total of all robots."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from fasaco_edge.client import phrases
from fasaco_edge.fleet.watch.floor import FleetFloor
from fasaco_edge.fleet.watch.robot import FleetRobot, short
from fasaco_edge.watch.blocks import FAINT
from fasaco_edge.watch.glyphs import GlyphSet
from fasaco_edge.watch.status_table import LONGEST_BAR, state_colour

# Largest width of names, beside a third of the table; table width from which units and rates are
# shown, and largest table width [characters].
LEAST_NAME, UNITS, RATES, WIDEST = 12, 40, 47, 80
GONE_COLOUR, WAITING_COLOUR = "red", "yellow"


def robot_table(robots: Sequence[FleetRobot], width: int, lines: int) -> Table:
    """Return a table of robots of a given width, in at most ``lines`` >= 1 lines."""
    table = Table.grid(padding=(0, 1), pad_edge=False)
    table.width = width = min(width, WIDEST)
    longest = max([len(robot.name) for robot in robots], default=5)
    # If each robot has room for a second line, its activity is shown in full.
    is_folded = 2 * len(robots) < lines
    name = min(max(longest, 5), max(LEAST_NAME, width // 3))
    table.add_column(width=name, no_wrap=True, overflow="ellipsis")
    table.add_column(ratio=1, no_wrap=not is_folded, overflow="fold" if is_folded else "ellipsis")
    unit = " m2" if width >= UNITS else ""
    heads = [f"swept{unit}", f"left{unit}", *(["kB/s"] if width >= RATES else [])]
    for head in heads:
        table.add_column(width=max(len(head), 6 if unit else 5), justify="right", no_wrap=True)
    table.add_row(*(Text(head, FAINT) for head in ("robot", "does", *heads)))
    shown = robots if len(robots) < lines else robots[: max(lines - 2, 0)]
    for robot in shown:
        table.add_row(*_row(robot)[: 2 + len(heads)])
    if more := len(robots) - len(shown):
        table.add_row("", Text(f"{more} more", FAINT))
    return table


def _row(robot: FleetRobot) -> list[Text]:
    left = "-" if robot.left_m2 is None else f"{robot.left_m2:.1f}"
    return [
        Text(robot.name, FAINT if robot.silent_s is not None else ""),
        _doing(robot),
        Text(f"{robot.swept_m2:.1f}"),
        Text(left),
        Text(f"{robot.kb_s:.1f}", FAINT),
    ]


def _doing(robot: FleetRobot) -> Text:
    if robot.silent_s is not None:
        return Text(f"gone for {phrases.age(robot.silent_s)}", GONE_COLOUR)
    colour = WAITING_COLOUR if robot.waits_for else state_colour(robot.state)
    doing = Text(robot.doing, colour)
    if robot.away and robot.away != robot.state:
        away = "not heard by others" if robot.away == "gone" else robot.away
        doing.append(f" ({away})", WAITING_COLOUR)
    return doing


def total_rows(
    floor: FleetFloor, unheard: Sequence[str], width: int, glyphs: GlyphSet
) -> list[Text]:
    """Return lines with the total of all robots, and the names of silent robots."""
    silent = [Text(f"not heard: {', '.join(unheard)}", GONE_COLOUR)] if unheard else []
    if floor.fraction is None:
        return silent
    swept_m2, area_m2 = floor.swept * floor.cell_m2, floor.area * floor.cell_m2
    share = Text(phrases.percent(floor.fraction), "bold")
    share.append(f" swept: {swept_m2:.1f} of {area_m2:.1f} m2", "not bold")
    lines = [share, glyphs.bar(floor.fraction, min(width, LONGEST_BAR))]
    if floor.twice:
        lines.append(Text(f"{floor.twice * floor.cell_m2:.1f} m2 swept by two or more"))
    if floor.division:
        by = f" by {short(floor.by)}" if floor.by else ""
        lines.append(Text(f"division {floor.division}{by}", FAINT))
    return lines + silent
