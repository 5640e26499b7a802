"""What arrived from a robot of a fleet since its last note."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from fasaco_edge.fleet.observer.cells import Place
from fasaco_edge.fleet.observer.members import GONE, Member
from fasaco_edge.fleet.recording.notes import Note, NotedRobot, Pass
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.wire.documents.fleet import CellTile
from fasaco_edge.wire.documents.status import Status

# Longest distance between two poses that counts as driven; limits on cells and plans between two
# notes.
MOST_STEP_M = 2.0
MOST_PASSES, MOST_PLANS = 2_000, 200


@dataclass(slots=True)
class Unnoted:
    """Poses, plans and cells of a robot since its last note."""

    _pose: Pose2D | None = None
    _cell: Place | None = None
    _passes: list[Pass] = field(default_factory=list)
    _plans_ms: list[float] = field(default_factory=list)
    _plans: int = -1
    _driven_m: float = 0.0
    _swept: dict[Place, CellTile] = field(default_factory=dict)
    _ground: dict[Place, CellTile] = field(default_factory=dict)

    def move(self, cell: Place, pose: Pose2D, at_ms: int) -> None:
        """Take in a pose in the robot's map frame, and its cell there."""
        if self._pose is not None:
            step_m = math.dist((pose.x, pose.y), (self._pose.x, self._pose.y))
            # A correction of its pose does not count as driven.
            self._driven_m += step_m if step_m < MOST_STEP_M else 0.0
        self._pose = pose
        if cell != self._cell and len(self._passes) < MOST_PASSES:
            self._cell = cell
            self._passes.append(Pass(at_ms, *cell))

    def note_status(self, status: Status) -> None:
        """Take in a status: the time of a plan that was made since the last."""
        plans, took_ms = status.plan.plans, status.latency_ms.plan
        if plans != self._plans and took_ms is not None and len(self._plans_ms) < MOST_PLANS:
            self._plans_ms.append(took_ms)
        self._plans = plans

    def note_cells(self, member: Member, *, has_moved: bool) -> None:
        """Take in the tiles that the newest message changed; those before may lie elsewhere."""
        if has_moved:
            self._swept.clear()
            self._ground.clear()
            self._cell = None
        for kept, news in zip((self._swept, self._ground), member.news, strict=True):
            kept.update(((tile.row, tile.col), tile) for tile in news)

    def note(self, member: Member, at_ms: int, now_ns: int, traffic: tuple[int, int]) -> Note:
        """Return what arrived since the last note."""
        said, is_gone = member.newest, member.is_gone(now_ns)
        pose = self._pose or Pose2D(said.x, said.y)
        note = Note(
            robot=member.number,
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
            swept=list(self._swept.values()),
            ground=list(self._ground.values()),
        )
        self._driven_m = 0.0
        self._passes, self._plans_ms, self._swept, self._ground = [], [], {}, {}
        return note


def in_force(member: Member, at_ms: int) -> Note:
    """Return all cells received from a robot up to now."""
    said = member.newest
    return Note(
        member.number, at_ms, said.state, said.x, said.y, said.waits_for, said.division,
        said.open_cells, 0, 0, 0.0, [], [], member.swept.tiles(), member.ground.tiles(), True,
    )  # fmt: skip


def noted(member: Member) -> NotedRobot:
    """Return a robot's name and seat."""
    seat = member.seat
    place = seat.cell_m, seat.lattice_deg, seat.x, seat.y, seat.deg
    return NotedRobot(member.name, member.newest.radius_m, *place)
