"""The card of a fleet's recording, shown beside the map: each robot's activity and colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fasaco_edge.drawing import palette
from fasaco_edge.recording.scene.runcard import markdown_cell

LEGEND = """\
- **Tint** swept by the robot of that colour, **pale** its share of what is left, **grey** by two
- **Line** bright its path, dark where it drove"""


@dataclass(frozen=True, slots=True)
class RobotRow:
    """Activity of a robot.

    Attributes:
        name, number: of the robot.
        state: of its mission.
        swept_m2: area of the cells it has swept.
        share_m2: area of the cells left to it.
        waits_for: name of the robot it waits for.
    """

    name: str
    number: int
    state: str
    swept_m2: float
    share_m2: float
    waits_for: str


def colour_of(number: int) -> tuple[int, int, int]:
    """Return the colour of the robot with a number."""
    return palette.ROBOTS[number % len(palette.ROBOTS)][1]


def card_of(title: str, rows: Sequence[RobotRow], twice_m2: float) -> str:
    """Return the card as Markdown."""
    swept_m2 = sum(row.swept_m2 for row in rows) - twice_m2
    lines = [f"**{markdown_cell(title)}**: {swept_m2:.1f} m2 swept, {twice_m2:.1f} by two", ""]
    lines += ["| robot | colour | state | swept m2 | left to it m2 |", "|---|---|---|---|---|"]
    for row in rows:
        state = f"waits for {row.waits_for}" if row.waits_for else row.state
        colour, _ = palette.ROBOTS[row.number % len(palette.ROBOTS)]
        cells = (row.name, colour, state, f"{row.swept_m2:.1f}", f"{row.share_m2:.1f}")
        lines.append(f"| {' | '.join(map(markdown_cell, cells))} |")
    return "\n".join(lines) + f"\n\n{LEGEND}\n"
