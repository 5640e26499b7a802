"""The robots of a fleet as an observer knows them, and their shares in its division.

A cell belongs to the robot whose seed has the shortest travel time to it, plus its handicap, as in
the robots' own division; here over the cells that they report as reachable.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import FleetError
from fasaco_edge.fleet.mission.frames import placed_point
from fasaco_edge.fleet.observer.cells import (
    FAR,
    Cells,
    Seat,
    TileSet,
    distances,
    mask_of,
    together,
    window_of,
)
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.wire.documents.fleet import CellTile, FleetMember
from fasaco_edge.wire.limits import MAX_FLEET_PARTS

# Largest number of observed robots, that of a fleet. Silence after which a robot is gone, and after
# which its place is free for another [ns].
MOST_MEMBERS = MAX_FLEET_PARTS
GONE_NS, REPLACED_NS = 5_000_000_000, 60_000_000_000
# Messages beyond this rate are counted, not read [ns].
LEAST_SPACING_NS = 100_000_000
JOINED, GONE, WAITING = "joined", "gone", "waiting"


@dataclass(slots=True)
class Member:
    """A robot of the fleet.

    Attributes:
        name: its name on the bus.
        number: in order of joining, from 0.
        seat: position of its cells.
        newest: its newest message.
        received_ns: time of its newest message.
        swept, ground: cells it has swept, and can reach.
        changes: how often these cells have changed, or their seat.
        pose: its newest pose in its map frame.
    """

    name: str
    number: int
    seat: Seat
    newest: FleetMember
    received_ns: int
    swept: TileSet = field(default_factory=TileSet)
    ground: TileSet = field(default_factory=TileSet)
    changes: int = 0
    pose: Pose2D | None = None

    def is_due(self, at_ns: int) -> bool:
        """Return whether a message that arrived then is read."""
        return at_ns - self.received_ns >= LEAST_SPACING_NS

    def receive(self, said: FleetMember, at_ns: int) -> str:
        """Take in a message; return what has changed of its frame, "" for nothing."""
        moved = ""
        if self.is_moved_by(said):
            self.seat = Seat.of(said)
            for tiles in (self.swept, self.ground):
                tiles.clear()
            self.changes += 1
            self._forget()
            moved = f"its frame has changed: {said.frame!r}, {self.seat}"
        elif said.epoch != self.newest.epoch:
            self.swept.clear()
            self.changes += 1
        self.newest, self.received_ns = said, at_ns
        swept = self.swept.take(said.swept, grows=True)
        ground = self.ground.take(said.ground, grows=False)
        if swept or ground:
            self.changes += 1
            self._note_cells(swept, ground)
        return moved

    def is_moved_by(self, said: FleetMember) -> bool:
        """Return whether a message places its cells anew."""
        return Seat.of(said) != self.seat or said.frame != self.newest.frame

    def is_gone(self, now_ns: int) -> bool:
        """Return whether it is silent."""
        return now_ns - self.received_ns > GONE_NS

    def state(self, now_ns: int) -> str:
        """Return the state of its mission, or that it waits for another robot, or is gone."""
        if self.is_gone(now_ns):
            return GONE
        return WAITING if self.newest.waits_for else self.newest.state

    def placed(self, x: float, y: float) -> tuple[float, float]:
        """Return a point of its map frame in the fleet's frame [m]."""
        return placed_point(self.seat.frame, x, y)

    def _note_cells(self, swept: Sequence[CellTile], ground: Sequence[CellTile]) -> None:
        """Note the tiles that have changed."""

    def _forget(self) -> None:
        """Forget the notes of its cells: they lie elsewhere."""


M = TypeVar("M", bound=Member)


class Members(Generic[M]):
    """The robots of one fleet, in order of joining.

    ``make`` returns a robot by its name, number, seat, first message and the time of that [ns].
    """

    def __init__(self, make: Callable[[str, int, Seat, FleetMember, int], M]) -> None:
        self._make = make
        self._by_name: dict[str, M] = {}

    def receive(self, robot: str, said: FleetMember, at_ns: int) -> tuple[M, str]:
        """Take in a message; return its robot, and the change: JOINED, what moved, or "".

        Raises:
            FleetError: the largest number of robots is reached.
        """
        member = self._by_name.get(robot)
        if member is None:
            member = self._make(robot, self._number(robot, at_ns), Seat.of(said), said, at_ns)
            self._by_name[robot] = member
            member.receive(said, at_ns)
            return member, JOINED
        if not member.is_due(at_ns):
            return member, ""
        return member, member.receive(said, at_ns)

    def _number(self, robot: str, at_ns: int) -> int:
        """Return the number of a robot that joins: the next, or that of a robot long gone."""
        if len(self) < MOST_MEMBERS:
            return len(self)
        longest = min(self, key=lambda member: member.received_ns)
        if at_ns - longest.received_ns < REPLACED_NS:
            raise FleetError(f"{robot}: {MOST_MEMBERS} robots of a fleet are observed at most")
        del self._by_name[longest.name]
        return longest.number

    def get(self, robot: str) -> M | None:
        """Return a robot; None if it has not joined."""
        return self._by_name.get(robot)

    def __iter__(self) -> Iterator[M]:
        return iter(sorted(self._by_name.values(), key=lambda member: member.number))

    def __len__(self) -> int:
        return len(self._by_name)

    def dividing(self, now_ns: int) -> M | None:
        """Return a robot that sends the division in force; None if none sends one.

        A single remaining robot sends a new number without parts: all cells left are its own. The
        last message of an absent robot counts only if all robots are absent.
        """
        dividing = [member for member in self if member.newest.division]
        present = [member for member in dividing if not member.is_gone(now_ns)] or dividing
        return min(present, key=lambda m: (-m.newest.division, m.newest.by), default=None)


NOBODY = -1


@dataclass(frozen=True, slots=True, eq=False)
class Shares:
    """Owners of the remaining cells.

    Attributes:
        geometry: of the cells, in the fleet's frame.
        owners: number of the robot of each cell, int16 (rows, cols); NOBODY for none.
        cells: number of cells of each robot, by its name.
    """

    geometry: GridGeometry
    owners: NDArray[np.int16]
    cells: Counter[str]


def union_on(seat: Seat, members: Members[M], what: str) -> Cells:
    """Return all robots' cells on one's lattice, int64 (n, 2); ``what``: "swept" or "ground"."""
    return together(member.seat.carried(getattr(member, what).cells(), seat) for member in members)


def shares_of(members: Members[M], now_ns: int) -> Shares | None:
    """Return the shares by the division in force at a time; None before there is one."""
    divider = members.dividing(now_ns)
    if divider is None:
        return None
    ground = union_on(divider.seat, members, "ground")
    window = window_of(ground)
    if window is None:
        return None
    known = mask_of(ground, window)
    owners = owners_of(divider, members, known, window)
    owners[mask_of(union_on(divider.seat, members, "swept"), window)] = NOBODY
    names = {member.number: member.name for member in members}
    counted = zip(*np.unique(owners[owners != NOBODY], return_counts=True), strict=True)
    cells = Counter({names[int(number)]: int(count) for number, count in counted})
    return Shares(divider.seat.geometry(window), owners, cells)


def owners_of(
    divider: M,
    members: Members[M],
    known: NDArray[np.bool_],
    window: Window,
    most_steps: int | None = None,
) -> NDArray[np.int16]:
    """Return the number of the robot that a division gives each cell to; NOBODY for none.

    Args:
        divider: a robot that sends the division.
        members: the robots.
        known: reachable cells, bool (rows, cols).
        window: of these cells, on the divider's lattice.
        most_steps: largest number of steps searched, over all robots; None for no limit.
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
        if most_steps is not None:
            most_steps -= int(away[away < FAR].max(initial=0))
        times_s = away * np.float32(part.step_s) + np.float32(part.handicap_s)
        is_earlier = (times_s < first) & (away < FAR)
        owners[is_earlier] = member.number
        first[is_earlier] = times_s[is_earlier]
    return owners


def swept_twice(members: Members[M]) -> tuple[GridGeometry, NDArray[np.bool_]] | None:
    """Return the cells that two or more robots swept, and where they lie; None for none."""
    seats = [member.seat for member in members]
    if len(seats) < 2:
        return None
    each = [member.seat.carried(member.swept.cells(), seats[0]) for member in members]
    cells, counts = np.unique(
        np.concatenate([np.unique(one, axis=0) for one in each]), axis=0, return_counts=True
    )
    twice = cells[counts > 1]
    window = window_of(twice)
    if window is None:
        return None
    return seats[0].geometry(window), mask_of(twice, window)
