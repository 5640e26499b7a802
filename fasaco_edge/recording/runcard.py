"""The run card: what a stranger has to know before looking at the rest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from fasaco_edge.recording.fields import Json

# Settings that say most about a run come first, the others by name.
FIRST = ("planner", "cell_m", "robot_radius_m", "seed")

LEGEND = """\
- **Map** white free, black occupied, grey unknown
- **Tint** blue covered, orange covered more than once
- **Path** violet, pale the one before; **trail** green
- **Pink** an obstacle came or went
- **Pheromone** dark little, bright much, black none"""


@dataclass(frozen=True, slots=True)
class RunDescription:
    """What is known of a run.

    Attributes:
        robot: name of the robot.
        began: when the recording began, UTC, as text.
        version: of the planner; "" while unknown.
        config: its configuration, as its status gives it.
    """

    robot: str
    began: str
    version: str = ""
    config: dict[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """What the run is called."""
        return f"{self.robot} {self.began}"

    def properties(self) -> dict[str, str]:
        """Return the run's properties, flat, all as text: another version's types may differ."""
        known = {"robot": self.robot, "began": self.began, "version": self.version}
        settings = {
            name.replace(".", "_"): str(value) for name, value in flat_settings(self.config)
        }
        return {name: value for name, value in (settings | known).items() if value}

    def markdown(self) -> str:
        """Return the run card."""
        rows = [
            ("robot", self.robot),
            ("began", self.began),
            ("version", self.version or "unknown until the first status"),
        ]
        rows += sorted(flat_settings(self.config), key=_rank)
        table = "\n".join(f"| {name} | {_cell(value)} |" for name, value in rows)
        return f"{LEGEND}\n\n| setting | value |\n|---|---|\n{table}\n"


def flat_settings(config: Json, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the settings of a configuration by their dotted names, lists as text."""
    for name, value in config.items():
        if isinstance(value, dict):
            yield from flat_settings(value, f"{prefix}{name}.")
        elif isinstance(value, str | int | float):
            yield f"{prefix}{name}", value
        elif isinstance(value, list):
            yield f"{prefix}{name}", ", ".join(str(item) for item in value)


def _rank(setting: tuple[str, Any]) -> tuple[int, str]:
    leaf = setting[0].rpartition(".")[2]
    return (FIRST.index(leaf) if leaf in FIRST else len(FIRST), setting[0])


def _cell(value: object) -> str:
    return str(value).replace("|", "\\|").replace("\n", " ")
