"""Survey of a fleet's floor: the cells swept and left, and the owner of each cell left.

The owner is the robot with the least sum of its handicap and the travel time from its seed, as in
the robots' own division. Travel leads over the cells that robots report as reachable. Each robot
may send two million cells, on a lattice of its own, so the survey's size and search are bounded.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.fleet.observer.cells import FAR, MOST_SPAN, Seat, distances, mask_of, window_of
from fasaco_edge.fleet.observer.observed import MOST_MEMBERS, ObservedFleet, ObservedRobot
from fasaco_edge.grid.geometry import GridGeometry, Window
from fasaco_edge.wire.documents.fleet import TILE

# Largest number of steps searched from the seeds of a division, over all robots. In very large
# mazes, some cells get no owner.
MOST_STEPS = 60_000
# Largest number of cells in the rectangle around all cells; the limit for one robot is the same.
MOST_CELLS = (MOST_SPAN * TILE) ** 2
NOBODY = -1


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """The cells of a fleet's robots at one time.

    Attributes:
        robots: names of the robots included.
        geometry: placement of the cells in the fleet's frame; None without cells.
        owners: number of the robot that owns each cell left, int16 (rows, cols); else NOBODY.
        twice: cells that several robots have swept, bool (rows, cols).
        left: number of cells left to each robot, by name.
        area: number of cells that any robot can reach or has swept.
        swept: number of cells that any robot has swept.
        division: number of the division in force; 0 without a division.
        by: name of its author.
    """

    robots: frozenset[str] = frozenset()
    geometry: GridGeometry | None = None
    owners: NDArray[np.int16] = field(default_factory=lambda: np.zeros((0, 0), np.int16))
    twice: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0), np.bool_))
    left: Counter[str] = field(default_factory=Counter)
    area: int = 0
    swept: int = 0
    division: int = 0
    by: str = ""

    @property
    def cell_m2(self) -> float:
        """Area of a cell [m2]."""
        return 0.0 if self.geometry is None else self.geometry.resolution**2

    @property
    def twice_m2(self) -> float:
        """Area of the cells that several robots have swept [m2]."""
        return int(np.count_nonzero(self.twice)) * self.cell_m2

    @property
    def fraction(self) -> float | None:
        """Share of the cells that are swept; None while no cell is known."""
        return self.swept / self.area if self.area else None


def survey_of(members: ObservedFleet, now_ns: int) -> Survey:
    """Return the survey of a fleet, by the division in force at ``now_ns``."""
    divider = members.dividing(now_ns)
    seat = divider.seat if divider else next((member.seat for member in members), None)
    robots = frozenset(member.name for member in members)
    window = None if seat is None else _window(seat, members)
    if seat is None or window is None:
        return Survey(robots)
    ground, once, twice = (np.zeros((window.rows, window.cols), np.bool_) for _ in range(3))
    for member in members:
        ground |= mask_of(member.seat.carried(member.ground.cells(), seat), window)
        swept = mask_of(member.seat.carried(member.swept.cells(), seat), window)
        twice |= once & swept
        once |= swept
    owners = np.full(ground.shape, NOBODY, np.int16)
    if divider is not None:
        owners = owners_of(divider, members, ground, window)
        owners[once] = NOBODY
    counts = np.bincount(owners[owners != NOBODY], minlength=MOST_MEMBERS).tolist()
    return Survey(
        robots,
        seat.geometry(window),
        owners,
        twice,
        Counter({member.name: counts[member.number] for member in members}),
        area=int(np.count_nonzero(ground | once)),
        swept=int(np.count_nonzero(once)),
        division=divider.newest.division if divider else 0,
        by=divider.newest.by if divider else "",
    )


def _window(seat: Seat, members: ObservedFleet) -> Window | None:
    """Return the window of all cells on a lattice; cells far from earlier cells are left out."""
    joined = None
    for member in members:
        for tiles in (member.ground, member.swept):
            here = window_of(member.seat.carried(tiles.cells(), seat))
            around = Window.around(joined, here)
            if around is not None and around.rows * around.cols <= MOST_CELLS:
                joined = around
    return joined


def owners_of(
    divider: ObservedRobot,
    members: ObservedFleet,
    known: NDArray[np.bool_],
    window: Window,
    most_steps: int = MOST_STEPS,
) -> NDArray[np.int16]:
    """Return the number of the robot that owns each cell, int16 (rows, cols); NOBODY for none.

    Args:
        divider: a robot that sends the division.
        members: the robots.
        known: reachable cells, bool (rows, cols).
        window: window of ``known`` on the divider's lattice.
        most_steps: largest number of steps searched, over all robots.
    """
    first = np.full(known.shape, np.float32(np.inf))
    owners = np.full(known.shape, NOBODY, np.int16)
    if not divider.newest.parts:
        owners[known] = divider.number
        return owners
    for part in sorted(divider.newest.parts, key=lambda part: part.robot):
        member = members.get(part.robot)
        if member is None:
            continue
        away = distances(known, (part.row - window.row0, part.col - window.col0), most_steps)
        most_steps -= int(away[away < FAR].max(initial=0))
        times_s = away * np.float32(part.step_s) + np.float32(part.handicap_s)
        is_earlier = (times_s < first) & (away < FAR)
        owners[is_earlier] = member.number
        first[is_earlier] = times_s[is_earlier]
    return owners
