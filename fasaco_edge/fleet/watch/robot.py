"""A robot of a fleet as it is shown: its activity, its place, and its share of the floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fasaco_edge.fleet.observer.survey import Survey
from fasaco_edge.text import one_line

# States of a robot that does something for its mission.
AT_WORK = ("planning", "covering", "returning", "degraded")
# Longest text of a robot that shares a line with other texts [characters].
LONGEST = 40


@dataclass(frozen=True, slots=True, eq=False)
class FleetRobot:
    """A robot of the fleet at a time.

    Attributes:
        name: of the robot.
        state: of its mission, in its last message; one line.
        waits_for: name of the robot it waits for; "" for none.
        silent_s: time since its last message if it counts as gone; else None.
        away: why others give it no part of the remaining cells; "" if they do.
        x, y: its position in the fleet's frame, in its last message [m].
        swept_cells, swept_m2: cells it has swept, and their area.
        left_cells, left_m2: cells left to it by the division in force, and their area; None without
            a division.
        division: number of its division.
        revision: number of its path; None if not known.
        kb_s: rate of its messages to the fleet [kB/s].
    """

    name: str
    state: str
    waits_for: str
    silent_s: float | None
    away: str
    x: float
    y: float
    swept_cells: int
    swept_m2: float
    left_cells: int | None
    left_m2: float | None
    division: int
    revision: int | None
    kb_s: float

    @property
    def is_at_work(self) -> bool:
        """Whether it does something for its mission."""
        return self.silent_s is None and self.state in AT_WORK

    @property
    def doing(self) -> str:
        """Its activity in a few words."""
        if self.silent_s is not None:
            return "gone"
        return f"waits for {self.waits_for}" if self.waits_for else self.state or "no state"


def document_of(
    fleet: str, division: int, floor: Survey, robots: Sequence[FleetRobot]
) -> dict[str, object]:
    """Return a fleet as the object that ``--json`` prints."""
    return {
        "fleet": fleet,
        "at_work": sum(robot.is_at_work for robot in robots),
        "division": division,
        "cells": floor.area,
        "swept_cells": floor.swept,
        "swept_twice_cells": int(floor.twice.sum()),
        "swept_m2": round(floor.swept * floor.cell_m2, 2),
        "fraction": None if floor.fraction is None else round(floor.fraction, 4),
        "robots": [
            {
                "name": robot.name,
                "state": "gone" if robot.silent_s is not None else robot.state,
                "x": round(robot.x, 3),
                "y": round(robot.y, 3),
                "waits_for": robot.waits_for,
                "away": robot.away or None,
                "division": robot.division,
                "swept_cells": robot.swept_cells,
                "swept_m2": round(robot.swept_m2, 2),
                "part_cells": robot.left_cells,
                "path": robot.revision,
            }
            for robot in robots
        ],
    }


def short(text: str) -> str:
    """Return a robot's text as one short line."""
    line = one_line(text)
    return line if len(line) <= LONGEST else f"{line[: LONGEST - 3]}..."
