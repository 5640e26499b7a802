"""The robots of a fleet as its recorder knows them, from what each of them tells."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from fasaco_edge.errors import FleetError
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.mission.fleet.frames import placed_point
from fasaco_edge.recording.fleet.cells import Place, Seat, TileSet
from fasaco_edge.recording.fleet.notes import Note, NotedRobot, Pass
from fasaco_edge.wire.documents.fleet import CellTile, FleetMember
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.limits import MAX_FLEET_PARTS

# Robots of a fleet that are recorded: as many as one may have. A robot silent for this long is
# gone, and gives its place to another after that [ns].
MOST_MEMBERS = MAX_FLEET_PARTS
GONE_NS, REPLACED_NS = 5_000_000_000, 60_000_000_000
# Messages beyond this rate are counted, not read [ns].
LEAST_SPACING_NS = 100_000_000
# Distance between two poses that is driven; cells and plans between two notes.
MOST_STEP_M = 2.0
MOST_PASSES, MOST_PLANS = 2_000, 200
JOINED, GONE, WAITING = "joined", "gone", "waiting"


@dataclass(slots=True)
class RecordedMember:
    """A robot of the fleet.

    Attributes:
        name: on the bus.
        number: in order of joining, from 0.
        seat: of its cells.
        newest: its newest message.
        heard_ns: time of that.
        swept, ground: cells it has swept, and can reach.
        pose: its newest pose in its map frame.
    """

    name: str
    number: int
    seat: Seat
    newest: FleetMember
    heard_ns: int
    swept: TileSet = field(default_factory=TileSet)
    ground: TileSet = field(default_factory=TileSet)
    pose: Pose2D | None = None
    _cell: Place | None = None
    _passes: list[Pass] = field(default_factory=list)
    _plans_ms: list[float] = field(default_factory=list)
    _plans: int = -1
    _driven_m: float = 0.0
    _new_swept: dict[Place, CellTile] = field(default_factory=dict)
    _new_ground: dict[Place, CellTile] = field(default_factory=dict)

    def is_due(self, at_ns: int) -> bool:
        """Tell whether a message that arrived then is read."""
        return at_ns - self.heard_ns >= LEAST_SPACING_NS

    def hear(self, said: FleetMember, at_ns: int) -> str:
        """Take in a message; return what has changed of its frame, "" for nothing."""
        moved = ""
        if self.is_moved_by(said):
            self.seat = Seat.of(said)
            for tiles in (self.swept, self.ground):
                tiles.clear()
            self._new_swept.clear()
            self._new_ground.clear()
            self._cell = None
            moved = f"its frame has changed: {said.frame!r}, {self.seat}"
        elif said.epoch != self.newest.epoch:
            self.swept.clear()
        self.newest, self.heard_ns = said, at_ns
        for tile in self.swept.take(said.swept, grows=True):
            self._new_swept[tile.row, tile.col] = tile
        for tile in self.ground.take(said.ground, grows=False):
            self._new_ground[tile.row, tile.col] = tile
        return moved

    def is_moved_by(self, said: FleetMember) -> bool:
        """Tell whether a message places its cells anew."""
        return Seat.of(said) != self.seat or said.frame != self.newest.frame

    def move(self, pose: Pose2D, at_ms: int) -> None:
        """Take in a pose in its map frame."""
        if self.pose is not None:
            step_m = math.dist((pose.x, pose.y), (self.pose.x, self.pose.y))
            # A correction of its place is no driving.
            self._driven_m += step_m if step_m < MOST_STEP_M else 0.0
        self.pose = pose
        cell = self.seat.cell_at(pose.x, pose.y)
        if cell != self._cell and len(self._passes) < MOST_PASSES:
            self._cell = cell
            self._passes.append(Pass(at_ms, *cell))

    def note_status(self, status: Status) -> None:
        """Take in a status: the time of a plan that was made since the last."""
        plans, took_ms = status.plan.plans, status.latency_ms.plan
        if plans != self._plans and took_ms is not None and len(self._plans_ms) < MOST_PLANS:
            self._plans_ms.append(took_ms)
        self._plans = plans

    def is_gone(self, now_ns: int) -> bool:
        """Tell whether it is silent."""
        return now_ns - self.heard_ns > GONE_NS

    def state(self, now_ns: int) -> str:
        """Return the state of its mission, or that it waits for another, or is gone."""
        if self.is_gone(now_ns):
            return GONE
        return WAITING if self.newest.waits_for else self.newest.state

    def placed(self, x: float, y: float) -> tuple[float, float]:
        """Return a point of its map frame in the fleet's frame [m]."""
        return placed_point(self.seat.frame, x, y)

    def note(self, at_ms: int, now_ns: int, traffic: tuple[int, int]) -> Note:
        """Return what was heard since the last note."""
        said = self.newest
        pose = self.pose or Pose2D(said.x, said.y)
        is_gone = self.is_gone(now_ns)
        note = Note(
            robot=self.number,
            at_ms=at_ms,
            state=GONE if is_gone else said.state,
            x=round(pose.x, 3),
            y=round(pose.y, 3),
            waits_for="" if is_gone else said.waits_for,
            division=said.division,
            open_cells=said.open_cells,
            messages=traffic[0],
            bytes=traffic[1],
            driven_m=round(self._driven_m, 3),
            plans_ms=[round(ms, 2) for ms in self._plans_ms],
            passes=self._passes,
            swept=list(self._new_swept.values()),
            ground=list(self._new_ground.values()),
        )
        self._driven_m = 0.0
        self._passes, self._plans_ms, self._new_swept, self._new_ground = [], [], {}, {}
        return note

    def in_force(self, at_ms: int) -> Note:
        """Return all cells told so far."""
        said = self.newest
        return Note(
            self.number, at_ms, said.state, said.x, said.y, said.waits_for, said.division,
            said.open_cells, 0, 0, 0.0, [], [], self.swept.tiles(), self.ground.tiles(), True,
        )  # fmt: skip

    def noted(self) -> NotedRobot:
        """Return its name and seat."""
        seat = self.seat
        return NotedRobot(
            self.name, self.newest.radius_m, seat.cell_m, seat.lattice_deg, seat.x, seat.y, seat.deg
        )


class Members:
    """The robots of one fleet, in order of joining."""

    def __init__(self) -> None:
        self._by_name: dict[str, RecordedMember] = {}

    def hear(self, robot: str, said: FleetMember, at_ns: int) -> tuple[RecordedMember, str]:
        """Take in a message; return its robot, and what is new: JOINED, what moved, or "".

        Raises:
            FleetError: there are as many robots as are recorded.
        """
        member = self._by_name.get(robot)
        if member is None:
            member = RecordedMember(robot, self._number(robot, at_ns), Seat.of(said), said, at_ns)
            self._by_name[robot] = member
            member.hear(said, at_ns)
            return member, JOINED
        if not member.is_due(at_ns):
            return member, ""
        return member, member.hear(said, at_ns)

    def _number(self, robot: str, at_ns: int) -> int:
        """Return the number of a robot that joins: the next, or that of one long gone."""
        if len(self) < MOST_MEMBERS:
            return len(self)
        longest = min(self, key=lambda member: member.heard_ns)
        if at_ns - longest.heard_ns < REPLACED_NS:
            raise FleetError(f"{robot}: {MOST_MEMBERS} robots of a fleet are recorded at most")
        del self._by_name[longest.name]
        return longest.number

    def get(self, robot: str) -> RecordedMember | None:
        """Return a robot; None if it has not joined."""
        return self._by_name.get(robot)

    def __iter__(self) -> Iterator[RecordedMember]:
        return iter(sorted(self._by_name.values(), key=lambda member: member.number))

    def __len__(self) -> int:
        return len(self._by_name)

    def dividing(self, now_ns: int) -> RecordedMember | None:
        """Return a robot that tells the division in force; None if none tells one.

        One left alone tells a new number without parts: all that is left is its own. What a robot
        that is gone told last counts only where all are gone.
        """
        dividing = [member for member in self if member.newest.division]
        telling = [member for member in dividing if not member.is_gone(now_ns)] or dividing
        return min(telling, key=lambda m: (-m.newest.division, m.newest.by), default=None)
