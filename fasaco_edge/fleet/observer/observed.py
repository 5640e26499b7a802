"""Members of a fleet, as an observer knows them from their messages."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from fasaco_edge.errors import FleetError
from fasaco_edge.fleet.mission.frames import placed_point
from fasaco_edge.fleet.observer.cells import Seat, TileSet
from fasaco_edge.wire.documents.fleet import FleetMember
from fasaco_edge.wire.limits import MAX_FLEET_PARTS

# Largest number of robots observed.
MOST_MEMBERS = MAX_FLEET_PARTS
# Silence after which a robot is gone [ns].
GONE_NS = 5_000_000_000
# Least time between two messages of a robot; messages in between are not read [ns].
LEAST_SPACING_NS = 100_000_000
JOINED, GONE, WAITING = "joined", "gone", "waiting"


@dataclass(slots=True)
class ObservedRobot:
    """A robot of the fleet.

    Attributes:
        name: its name on the bus.
        number: its number in the order of joining, from 0.
        seat: placement of its cells.
        newest: its newest message.
        received_ns: time of its newest message [ns].
        swept, ground: cells that it has swept; cells that it can reach.
        changes: number of changes of these cells and of their seat.
    """

    name: str
    number: int
    seat: Seat
    newest: FleetMember
    received_ns: int
    swept: TileSet = field(default_factory=TileSet)
    ground: TileSet = field(default_factory=TileSet)
    changes: int = 0

    def receive(self, said: FleetMember, at_ns: int) -> str:
        """Take in a message; return how its frame has changed, or ""."""
        moved = ""
        if self.is_moved_by(said):
            self.seat = Seat.of(said)
            for tiles in (self.swept, self.ground):
                tiles.clear()
            self.changes += 1
            moved = f"its frame has changed: {said.frame!r}, {self.seat}"
        elif said.epoch != self.newest.epoch:
            self.swept.clear()
            self.changes += 1
        self.newest, self.received_ns = said, at_ns
        swept = self.swept.take(said.swept, grows=True)
        ground = self.ground.take(said.ground, grows=False)
        self.changes += swept or ground
        return moved

    def is_moved_by(self, said: FleetMember) -> bool:
        """Return whether a message changes its seat or its frame."""
        return Seat.of(said) != self.seat or said.frame != self.newest.frame

    def is_gone(self, now_ns: int) -> bool:
        """Return whether it has been silent for too long."""
        return now_ns - self.received_ns > GONE_NS

    def state(self, now_ns: int) -> str:
        """Return the state of its mission, or WAITING for another robot, or GONE."""
        if self.is_gone(now_ns):
            return GONE
        return WAITING if self.newest.waits_for else self.newest.state

    def placed(self, x: float, y: float) -> tuple[float, float]:
        """Return a point of its map frame in the fleet's frame [m]."""
        return placed_point(self.seat.frame, x, y)


class ObservedFleet:
    """The robots of one fleet, in order of joining."""

    def __init__(self) -> None:
        self._by_name: dict[str, ObservedRobot] = {}

    def receive(self, robot: str, said: FleetMember, at_ns: int) -> tuple[ObservedRobot, str]:
        """Take in a message; return its robot, and JOINED, how its frame has changed, or "".

        Raises:
            FleetError: the largest number of robots is reached.
        """
        member = self._by_name.get(robot)
        if member is None:
            if len(self) >= MOST_MEMBERS:
                raise FleetError(f"{robot}: {MOST_MEMBERS} robots of a fleet are observed at most")
            member = self._by_name[robot] = ObservedRobot(
                robot, len(self), Seat.of(said), said, at_ns
            )
            member.receive(said, at_ns)
            return member, JOINED
        if at_ns - member.received_ns < LEAST_SPACING_NS:
            return member, ""
        return member, member.receive(said, at_ns)

    def get(self, robot: str) -> ObservedRobot | None:
        """Return a robot; None if it has not joined."""
        return self._by_name.get(robot)

    def __iter__(self) -> Iterator[ObservedRobot]:
        return iter(self._by_name.values())

    def __len__(self) -> int:
        return len(self._by_name)

    def dividing(self, now_ns: int) -> ObservedRobot | None:
        """Return a robot that sends the division in force; None if no robot sends a division.

        A robot that is alone sends a number without parts: all cells left are its own. Messages of
        absent robots count only if all robots are absent.
        """
        dividing = [member for member in self if member.newest.division]
        present = [member for member in dividing if not member.is_gone(now_ns)] or dividing
        return min(present, key=lambda m: (-m.newest.division, m.newest.by), default=None)
