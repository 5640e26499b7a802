"""Log of a fleet: a note per second of what each robot sent, recorded beside the drawings.

A review reads it. The notes of some seconds are written as one blob: deflated MessagePack with a
version in it. The first blob of each part also holds all cells received before, so that the part
can be read without earlier parts.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, field
from pathlib import Path
from typing import Annotated, Final

import msgspec
import numpy as np
from msgspec import Meta

from fasaco_edge.errors import DifferentRuns, UnreadableRecording
from fasaco_edge.fleet.observer.cells import Place
from fasaco_edge.fleet.observer.observed import GONE, ObservedRobot
from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.frames import chunks_in, column, pa
from fasaco_edge.recording.read.torn import HINT
from fasaco_edge.wire.documents.fleet import CellEdge, CellTile
from fasaco_edge.wire.documents.settings import known_settings
from fasaco_edge.wire.documents.status import Status

NOTES_VERSION: Final = 1
# Largest size of an inflated batch [bytes].
MOST_BYTES = 64_000_000
COMPONENT = f"{entities.INPUTS_ARCHETYPE}:{entities.INPUTS_COMPONENT}"

# Longest distance between two poses that counts as driven [m]; largest numbers of cells and of
# plans in a note.
MOST_STEP_M = 2.0
MOST_ENTERED, MOST_PLANS = 2_000, 200

Text = Annotated[str, Meta(max_length=256)]
Count = Annotated[int, Meta(ge=0, le=2**62)]


class EnteredCell(msgspec.Struct, frozen=True, array_like=True):
    """A cell that a robot entered, ``at_ms`` after the recording began."""

    at_ms: int
    row: int
    col: int


class Note(msgspec.Struct, array_like=True):
    """Data of a robot since its last note.

    Attributes:
        robot: its number in ``NoteBatch.robots``.
        at_ms: time since the recording began [ms].
        state: state of its mission; "gone" once it is silent.
        x, y: its position in its map frame [m].
        waits_for: name of the robot that it waits for; "" for none.
        division: number of the newest division of the cells that it knows.
        open_cells: number of cells known to it that are still to sweep.
        messages, bytes: number and bytes of its messages to the fleet.
        driven_m: distance driven [m].
        plans_ms: how long each reported plan took [ms].
        entered: cells that it entered.
        swept, ground: whole tiles that have changed; all tiles if ``is_repeated``.
        is_repeated: whether this note repeats the content of earlier parts.
        stamp_ms: stamp of its newest pose [ms]; 0 without a stamp, and in older recordings.
        time_scale: simulated seconds per second, as configured; 1 for a real robot.
    """

    robot: Count
    at_ms: Count
    state: Text
    x: float
    y: float
    waits_for: Text
    division: Count
    open_cells: Count
    messages: Count
    bytes: Count
    driven_m: float
    plans_ms: list[float]
    entered: list[EnteredCell]
    swept: list[CellTile]
    ground: list[CellTile]
    is_repeated: bool = False
    stamp_ms: Count = 0
    time_scale: float = 1.0


class NotedRobot(msgspec.Struct, frozen=True, array_like=True):
    """A robot of a fleet: its name, radius [m], and the placement of its cells (``cells.Seat``)."""

    name: Text
    radius_m: float
    cell_m: CellEdge
    lattice_deg: float
    x: float
    y: float
    deg: float


class NoteBatch(msgspec.Struct, frozen=True, array_like=True):
    """Notes of some seconds; ``run``, when the recording began [ns], identifies the recording."""

    version: int
    run: int
    fleet: Text
    robots: list[NotedRobot]
    notes: list[Note]


class _BatchHead(msgspec.Struct, frozen=True, array_like=True):
    version: int


@dataclass(slots=True)
class PendingNote:
    """Poses and plans of a robot since its last note."""

    _pose: Pose2D | None = None
    _stamp_ms: int = 0
    _time_scale: float = 1.0
    _cell: Place | None = None
    _entered: list[EnteredCell] = field(default_factory=list)
    _plans_ms: list[float] = field(default_factory=list)
    _plans: int = -1
    _driven_m: float = 0.0

    def move(self, cell: Place, stamped: StampedPose, at_ms: int) -> None:
        """Take in a pose in the robot's map frame, and its cell there."""
        pose = stamped.pose
        self._stamp_ms = max(stamped.stamp_ns, 0) // 1_000_000
        if self._pose is not None:
            step_m = math.dist((pose.x, pose.y), (self._pose.x, self._pose.y))
            # A correction of its pose does not count as driven.
            self._driven_m += step_m if step_m < MOST_STEP_M else 0.0
        self._pose = pose
        if cell != self._cell and len(self._entered) < MOST_ENTERED:
            self._cell = cell
            self._entered.append(EnteredCell(at_ms, *cell))

    def note_status(self, status: Status) -> None:
        """Take in a status: the time of a plan made since the last status, and the time scale."""
        if status.config:
            self._time_scale = known_settings(status.config).robot.time_scale
        plans, took_ms = status.plan.plans, status.latency_ms.plan
        if plans != self._plans and took_ms is not None and len(self._plans_ms) < MOST_PLANS:
            self._plans_ms.append(took_ms)
        self._plans = plans

    def forget_cell(self) -> None:
        """Forget the robot's cell: its frame has moved."""
        self._cell = None

    def note(
        self, member: ObservedRobot, at_ms: int, now_ns: int, traffic: tuple[int, int]
    ) -> Note:
        """Return a note of the data since the last note."""
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
            entered=self._entered,
            swept=member.swept.changed(),
            ground=member.ground.changed(),
            stamp_ms=self._stamp_ms,
            time_scale=self._time_scale,
        )
        self._driven_m, self._entered, self._plans_ms = 0.0, [], []
        return note


def note_of_all_cells(member: ObservedRobot, at_ms: int) -> Note:
    """Return a note of all cells received from a robot up to now."""
    said = member.newest
    return Note(
        member.number, at_ms, said.state, said.x, said.y, said.waits_for, said.division,
        said.open_cells, 0, 0, 0.0, [], [], member.swept.tiles(), member.ground.tiles(), True,
    )  # fmt: skip


def noted(member: ObservedRobot) -> NotedRobot:
    """Return a robot's entry in a batch."""
    return NotedRobot(member.name, member.newest.radius_m, *astuple(member.seat))


def encode_notes(batch: NoteBatch) -> bytes:
    """Return a batch as a blob."""
    return zlib.compress(msgspec.msgpack.encode(batch), 6)


def decode_notes(blob: bytes) -> NoteBatch:
    """Return the batch of a blob.

    Raises:
        ValueError, msgspec.DecodeError: the blob is malformed, or of another version.
    """
    inflate = zlib.decompressobj()
    try:
        body = inflate.decompress(blob, MOST_BYTES)
    except zlib.error as error:
        raise ValueError(f"notes of a fleet: {error}") from error
    if inflate.unconsumed_tail or not inflate.eof:
        raise ValueError("notes of a fleet: they break off, or are too long")
    version = msgspec.msgpack.decode(body, type=_BatchHead).version
    if version != NOTES_VERSION:
        raise ValueError(f"notes of a fleet of version {version}, not {NOTES_VERSION}")
    batch = msgspec.msgpack.decode(body, type=NoteBatch)
    if any(note.robot >= len(batch.robots) for note in batch.notes):
        raise ValueError("notes of a fleet: a note names a robot that is not listed")
    return batch


def read_notes(paths: Sequence[Path]) -> list[NoteBatch]:
    """Return the batches in the parts of one run, in order of time.

    Raises:
        UnreadableRecording: a file is missing, damaged, or no recording of a fleet.
        DifferentRuns: the parts are not of one run.
    """
    batches = [batch for path in sorted(set(paths)) for batch in _batches(path)]
    if not batches:
        names = ", ".join(str(path) for path in paths)
        raise UnreadableRecording(
            f"{names}: holds no notes of a fleet",
            hint="no robot sent anything meanwhile: check the fleet's name, and the endpoint",
        )
    if len({batch.run for batch in batches}) > 1:
        raise DifferentRuns(f"parts of different runs: {', '.join(map(str, paths))}")
    return sorted(batches, key=lambda batch: batch.notes[0].at_ms if batch.notes else 0)


def numbers_of(paths: Sequence[Path]) -> dict[str, int]:
    """Return the number of each robot in a recording, by name; the number decides its colour.

    Raises:
        UnreadableRecording, DifferentRuns: see ``read_notes``.
    """
    return {
        robot.name: number
        for batch in read_notes(paths)
        for number, robot in enumerate(batch.robots)
    }


def _batches(path: Path) -> Iterator[NoteBatch]:
    for chunk in chunks_in(path):
        if chunk.entity != entities.FLEET_NOTES:
            continue
        for blob in column(chunk.batch, COMPONENT, pa.list_(pa.uint8())) or ():
            try:
                yield decode_notes(np.asarray(blob.values, np.uint8).tobytes())
            except (ValueError, msgspec.DecodeError) as error:
                raise UnreadableRecording(f"{path}: {error}", hint=HINT) from error
