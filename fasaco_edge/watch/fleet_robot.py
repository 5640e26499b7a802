"""A robot of a fleet as it is shown: what it does, where it is, and its share of the floor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.text import one_line
from fasaco_edge.watch.fleet_floor import FleetFloor

# States of a robot that does something for its mission.
AT_WORK = ("planning", "covering", "returning", "degraded")
# Longest text of a robot's that is shown in a line with others [characters].
LONGEST = 40


@dataclass(frozen=True, slots=True, eq=False)
class FleetRobot:
    """A robot of the fleet at a time; places are in the fleet's frame.

    Attributes:
        name: of the robot.
        number: in order of joining, as in ``FleetFloor.parts``.
        place: among the names of all robots, from 0: it keeps its colour when others go.
        state: of its mission, in its last message; one line.
        waits_for: name of the robot it waits for; "" for none.
        silent_s: time since its last message, where that is so long that it is gone; else None.
        away: why others give it no part of what is left; "" where they do.
        x, y: its position [m].
        yaw: its heading [rad]; None where it is not known.
        radius_m: of its disc [m].
        ahead: points of the path's next metres, float64 (n, 2) [m].
        swept_cells, swept_m2: cells it has swept, and their area.
        left_cells, left_m2: cells left to it by the division in force, and their area; None without
            a division.
        division: number of its division.
        revision: number of its path; None where it is not known.
        kb_s: what it tells its fleet [kB/s].
    """

    name: str
    number: int
    place: int
    state: str
    waits_for: str
    silent_s: float | None
    away: str
    x: float
    y: float
    yaw: float | None
    radius_m: float
    ahead: NDArray[np.float64]
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
        """What it does, in a few words."""
        if self.silent_s is not None:
            return "gone"
        return f"waits for {self.waits_for}" if self.waits_for else self.state or "no state"


def document_of(
    fleet: str, division: int, floor: FleetFloor, robots: Sequence[FleetRobot]
) -> dict[str, object]:
    """Return a fleet as the object that ``--json`` prints."""
    return {
        "fleet": fleet,
        "at_work": sum(robot.is_at_work for robot in robots),
        "division": division,
        "cells": floor.area,
        "swept_cells": floor.swept,
        "swept_twice_cells": floor.twice,
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
    """Return a text of a robot's as one short line."""
    line = one_line(text)
    return line if len(line) <= LONGEST else f"{line[: LONGEST - 3]}..."


def heading_to(at: tuple[float, float], ahead: NDArray[np.float64]) -> float | None:
    """Return the heading towards the next point of the path that is not where the robot is."""
    way = ahead - at
    far = np.hypot(way[:, 0], way[:, 1]) > 0.05
    if not far.any():
        return None
    dx, dy = way[far][0]
    return math.atan2(dy, dx)
