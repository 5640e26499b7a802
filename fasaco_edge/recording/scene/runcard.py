"""The run card, a text beside the map: the outcome of a run, a legend, and the settings."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from fasaco_edge.client.phrases import scale_words
from fasaco_edge.grid.geometry import StampedPose
from fasaco_edge.states import AT_WORK, TROUBLED
from fasaco_edge.text import duration, one_line
from fasaco_edge.wire.documents.json_text import Settings
from fasaco_edge.wire.documents.settings import known_settings
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.reasons import plain

# Markdown characters that end a cell, or make links, pictures and HTML.
MARK_UP = re.compile(r"[\\`\[\]<>!|]")

LEGEND = """\
- **Map** white free, black occupied, grey unknown; **turquoise** swept floor
- **Robot** red, its front yellow; its **track** green, from **start** to **end**
- **Path** to drive violet, the previous one pale
- **Pink frame** around all changes of the map that led to this path, and its reason
- **Blue line** a zone of the order, **orange line** a keep-out zone
- **Pheromone** left by the planner's ants, for its next ants: dark little, bright much
- **White line** over the pheromone: the path of that time"""


@dataclass(frozen=True, slots=True)
class RunDescription:
    """Description of a run.

    Attributes:
        robot: name of the robot.
        began: beginning of the recording, UTC, as text.
        version: version of the daemon; "" while unknown.
        config: configuration in the daemon's status.
        anchor: point (x, y) [m] of the map frame that is drawn at 0; None for the origin.
        outcome: outcome of the mission so far.
    """

    robot: str
    began: str
    version: str = ""
    config: Settings = field(default_factory=dict)
    anchor: tuple[float, float] | None = None
    outcome: str = ""

    @property
    def name(self) -> str:
        return f"{self.robot} {self.began}"

    def markdown(self) -> str:
        """Return the run card."""
        rows: list[tuple[str, object]] = [
            ("robot", self.robot),
            ("began", self.began),
            ("version", self.version or "unknown until the first status"),
        ]
        if self.anchor:
            x, y = self.anchor
            rows.append(("drawn from", f"x {x:.0f} m, y {y:.0f} m of the map's frame"))
        rows += sorted(flat_settings(self.config))
        table = "\n".join(
            f"| {markdown_cell(name)} | {markdown_cell(value)} |" for name, value in rows
        )
        head = f"{markdown_cell(self.outcome)}\n\n" if self.outcome else ""
        return f"{head}{LEGEND}\n\n| setting | value |\n|---|---|\n{table}\n"


def flat_settings(config: Settings, prefix: str = "") -> Iterator[tuple[str, str | float]]:
    """Yield the settings of a configuration by their dotted names, lists as text."""
    for name, value in config.items():
        if isinstance(value, dict):
            yield from flat_settings(value, f"{prefix}{name}.")
        elif isinstance(value, str | int | float):
            yield f"{prefix}{name}", value
        elif isinstance(value, list):
            yield f"{prefix}{name}", ", ".join(str(item) for item in value)


def markdown_cell(value: object) -> str:
    """Return a value as one line of plain text in a table of Markdown."""
    return MARK_UP.sub(r"\\\g<0>", one_line(str(value)))


def cells_of(status: Status) -> tuple[int, int] | None:
    """Return the numbers of covered and of reachable cells of the order; None if unknown."""
    if zones := status.mission.zones:
        return sum(zone.covered for zone in zones), sum(zone.cells for zone in zones)
    count = status.coverage
    return None if count is None else (count.covered, count.coverable)


# States without an outcome.
UNDER_WAY = AT_WORK - TROUBLED


class Outcome:
    """The outcome of a mission so far.

    Attributes:
        text: line in the run card; "" before the first status.
    """

    def __init__(self) -> None:
        self.text = ""
        self._began_ns = self._now_ns = 0
        self._state = ""

    def add_pose(self, stamped: StampedPose) -> None:
        """Note the time of the robot's clock; all stamps are 0 if it has none."""
        self._began_ns, self._now_ns = self._began_ns or stamped.stamp_ns, stamped.stamp_ns

    def add_status(self, status: Status) -> None:
        """Note a change of the mission's state."""
        if status.state == self._state:
            return
        self._state, self.text = status.state, "**under way**"
        if status.state in UNDER_WAY:
            return
        words = f"**{status.state}**"
        if self._now_ns > self._began_ns:
            words += f" after {duration(1e-9 * (self._now_ns - self._began_ns))}"
        if simulated := scale_words(known_settings(status.config).robot.time_scale):
            words += f" ({simulated})"
        facts = [plain(status.reason)] if status.reason else []
        floor = status.floor
        if floor is not None and floor.reachable_m2 and "swept" not in status.reason:
            facts.append(f"{floor.swept_m2:.1f} of {floor.reachable_m2:.1f} m2 swept")
        self.text = ": ".join([words, *filter(None, ["; ".join(facts)])])
