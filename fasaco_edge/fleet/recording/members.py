"""The robots of a fleet as its recorder knows them: the messages and the notes of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from fasaco_edge.fleet.observer.cells import Place
from fasaco_edge.fleet.observer.members import GONE, Member, Members
from fasaco_edge.fleet.recording.notes import Note, NotedRobot, Pass
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.wire.documents.fleet import CellTile
from fasaco_edge.wire.documents.status import Status

# Longest distance between two poses that counts as driven; limits on cells and plans between two
# notes.
MOST_STEP_M = 2.0
MOST_PASSES, MOST_PLANS = 2_000, 200


@dataclass(slots=True)
class RecordedMember(Member):
    """A robot of the fleet, and its data since the last note."""

    _cell: Place | None = None
    _passes: list[Pass] = field(default_factory=list)
    _plans_ms: list[float] = field(default_factory=list)
    _plans: int = -1
    _driven_m: float = 0.0
    _new_swept: dict[Place, CellTile] = field(default_factory=dict)
    _new_ground: dict[Place, CellTile] = field(default_factory=dict)

    def move(self, pose: Pose2D, at_ms: int) -> None:
        """Take in a pose in its map frame."""
        if self.pose is not None:
            step_m = math.dist((pose.x, pose.y), (self.pose.x, self.pose.y))
            # A correction of its pose does not count as driven.
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

    def note(self, at_ms: int, now_ns: int, traffic: tuple[int, int]) -> Note:
        """Return what arrived since the last note."""
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
        """Return all cells received up to now."""
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

    def _note_cells(self, swept: Sequence[CellTile], ground: Sequence[CellTile]) -> None:
        self._new_swept.update(((tile.row, tile.col), tile) for tile in swept)
        self._new_ground.update(((tile.row, tile.col), tile) for tile in ground)

    def _forget(self) -> None:
        self._new_swept.clear()
        self._new_ground.clear()
        self._cell = None


class RecordedMembers(Members[RecordedMember]):
    """The recorded robots of one fleet, in order of joining."""

    def __init__(self) -> None:
        super().__init__(RecordedMember)
