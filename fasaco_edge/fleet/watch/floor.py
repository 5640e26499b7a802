"""The floor of a fleet: the cells of all its robots, swept and left, and the owner of each.

Each robot sends up to two million cells, on a lattice of its own. The floor made of them is
bounded, and its updates take at most a tenth of the time.
"""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass, field, replace

import numpy as np

from fasaco_edge.fleet.observer.cells import MOST_SPAN, Seat, mask_of, window_of
from fasaco_edge.fleet.observer.members import MOST_MEMBERS, NOBODY, Member, Members, owners_of
from fasaco_edge.grid.geometry import Window
from fasaco_edge.wire.documents.fleet import TILE

# Largest number of steps searched from the seeds of a division, over all robots: in the largest
# mazes that messages can hold, some cells get no owner.
MOST_STEPS = 60_000
# Largest edge of the rectangle around all cells, the same as for one robot.
MOST_CELLS = (MOST_SPAN * TILE) ** 2
# Least time between two surveys [s]; and as a multiple of the time that one takes.
LEAST_AGE_S, LEAST_REST = 1.0, 10.0


@dataclass(frozen=True, slots=True, eq=False)
class FleetFloor:
    """The cells of a fleet's robots at a time.

    Attributes:
        robots: names of the robots included.
        left: number of cells left to each robot, by name.
        area: number of cells that any robot can reach or has swept.
        swept: number of cells that any has swept.
        twice: number of cells that several have swept.
        cell_m2: area of one of the cells of these numbers [m2].
        division: number of the division in force; 0 without one.
        by: name of the robot that made it.
    """

    robots: frozenset[str] = frozenset()
    left: Counter[str] = field(default_factory=Counter)
    area: int = 0
    swept: int = 0
    twice: int = 0
    cell_m2: float = 0.0
    division: int = 0
    by: str = ""

    @property
    def fraction(self) -> float | None:
        """Share of the cells that is swept; None while no cell is known."""
        return self.swept / self.area if self.area else None


class FloorSurvey:
    """Updates the floor of a fleet after changes.

    Attributes:
        floor: the newest.
    """

    def __init__(self) -> None:
        self.floor = FleetFloor()
        self._key: object = None
        self._due_at = 0.0

    def update(self, members: Members[Member], now_ns: int) -> None:
        """Bring the floor up to date, if that is due."""
        divider = members.dividing(now_ns)
        division = None if divider is None else (divider.name, divider.newest.division)
        key = division, *((member.name, member.changes) for member in members)
        began = time.monotonic()
        if key == self._key or began < self._due_at:
            return
        self._key, self.floor = key, floor_of(members, divider)
        ended = time.monotonic()
        self._due_at = max(began + LEAST_AGE_S, ended + LEAST_REST * (ended - began))


def floor_of(members: Members[Member], divider: Member | None) -> FleetFloor:
    """Return the floor of robots, of which ``divider`` sends the division in force."""
    seats = [member.seat for member in members]
    if not seats:
        return FleetFloor()
    seat = seats[0] if divider is None else divider.seat
    robots = frozenset(member.name for member in members)
    window = _window(seat, members)
    if window is None:
        return FleetFloor(robots)
    ground, once, twice = (np.zeros((window.rows, window.cols), np.bool_) for _ in range(3))
    for member in members:
        ground |= mask_of(member.seat.carried(member.ground.cells(), seat), window)
        swept = mask_of(member.seat.carried(member.swept.cells(), seat), window)
        twice |= once & swept
        once |= swept
    floor = FleetFloor(
        robots,
        area=int(np.count_nonzero(ground | once)),
        swept=int(np.count_nonzero(once)),
        twice=int(np.count_nonzero(twice)),
        cell_m2=seat.cell_m**2,
    )
    if divider is None:
        return floor
    owners = owners_of(divider, members, ground, window, MOST_STEPS)
    owners[once] = NOBODY
    counts = np.bincount(owners[owners != NOBODY], minlength=MOST_MEMBERS)
    return replace(
        floor,
        left=Counter({member.name: int(counts[member.number]) for member in members}),
        division=divider.newest.division,
        by=divider.newest.by,
    )


def _window(seat: Seat, members: Members[Member]) -> Window | None:
    """Return the window of all cells on a lattice; a robot far from earlier ones is left out."""
    joined = None
    for member in members:
        for tiles in (member.ground, member.swept):
            here = window_of(member.seat.carried(tiles.cells(), seat))
            around = Window.around(joined, here)
            if around is not None and around.rows * around.cols <= MOST_CELLS:
                joined = around
    return joined
