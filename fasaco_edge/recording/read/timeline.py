"""A recording by time: what was in force at any moment.

Poses, statuses and commands are kept in memory. Grids and paths are large: only their places in
the file are kept, and each is read on request.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bus.arrival import Arrival
from fasaco_edge.errors import UnreadableRecording
from fasaco_edge.recording import entities
from fasaco_edge.recording.arrow import pa
from fasaco_edge.recording.read.drawn import (
    DrawnGrid,
    DrawnLine,
    anchor_in,
    grids_in,
    lines_in,
    poses_in,
)
from fasaco_edge.recording.read.frames import BROKEN, Chunk, chunk_at, chunks, wall_ns
from fasaco_edge.recording.read.repair import open_part
from fasaco_edge.recording.read.robot_clock import RobotClock
from fasaco_edge.recording.read.run import RecordedSamples, read_run_record
from fasaco_edge.wire.documents.path_documents import PATH_DIGEST

GRIDS = (entities.MAP, entities.FLOOR, entities.PHEROMONE)
KEPT = ("status", "command", "rooms", PATH_DIGEST)
# Limit on the rows of poses and drawings of a file: one per ``ROW_BYTES``, plus ``FEW_ROWS``.
ROW_BYTES, FEW_ROWS = 8, 100_000


@dataclass(frozen=True, slots=True)
class Place:
    """Place of a drawing: its time [ns], open file, offset of the frame [bytes], row."""

    at_ns: int
    descriptor: int
    offset: int
    row: int


@dataclass(slots=True)
class Timeline:
    """Drawings and samples of a recording, in order of time.

    Attributes:
        clock: converts the recording's times to the robot's.
        ended_ns: end of the recording, since the epoch [ns].
        samples: statuses, commands, rooms and digests of paths.
        pose_ns, poses: times int64 (n,) [ns], and float64 (n, 3): x [m], y [m], yaw [rad].
    """

    clock: RobotClock
    ended_ns: int
    samples: Sequence[Arrival]
    pose_ns: NDArray[np.int64]
    poses: NDArray[np.float64]
    _drawn: _Drawn

    @property
    def began_ns(self) -> int:
        """Beginning of the recording, since the epoch [ns]."""
        return self.clock.began_ns

    def newest(self, entity: str, at_ns: int) -> Place | None:
        """Return the last drawing of an entity up to a time [ns]; None before the first one."""
        places = self._drawn.places.get(entity, [])
        index = bisect_right(places, at_ns, key=lambda place: place.at_ns)
        return places[index - 1] if index else None

    def samples_between(self, since_ns: int, until_ns: int) -> Sequence[Arrival]:
        """Return the samples received after ``since_ns`` and up to ``until_ns``."""
        first, last = (
            bisect_right(self.samples, at_ns, key=lambda one: one.wall_ns)
            for at_ns in (since_ns, until_ns)
        )
        return self.samples[first:last]

    def poses_between(self, since_ns: int, until_ns: int) -> NDArray[np.float64]:
        """Return the poses after ``since_ns`` and up to ``until_ns``, float64 (n, 3)."""
        first, last = np.searchsorted(self.pose_ns, (since_ns, until_ns), side="right")
        return self.poses[first:last]

    def grid(self, place: Place) -> DrawnGrid:
        """Read a drawn grid.

        Raises:
            UnreadableRecording: the file is damaged, or was changed.
        """
        return _first(partial(grids_in, anchor=self._drawn.anchor), place)

    def line(self, place: Place) -> DrawnLine:
        """Read a drawn line; errors as for ``grid``."""
        return _first(partial(lines_in, anchor=self._drawn.anchor), place)


Drawn = TypeVar("Drawn")


def _first(read: Callable[[pa.RecordBatch], Iterator[Drawn]], place: Place) -> Drawn:
    try:
        return next(read(chunk_at(place.descriptor, place.offset).batch.slice(place.row, 1)))
    except BROKEN as error:
        raise UnreadableRecording(f"the recording can no longer be read: {error}") from error


@contextmanager
def open_timeline(paths: Sequence[Path]) -> Iterator[Timeline]:
    """Open the parts of one run, in any order; the files stay open, even if they are deleted.

    Raises:
        UnreadableRecording: a file is missing or no recording, or there are no samples.
        DifferentRuns: the parts are not of one run.
    """
    record = read_run_record(paths, lambda: None)
    samples = sorted(RecordedSamples((), record.batches, KEPT), key=lambda one: one.wall_ns)
    drawn = _Drawn()
    with ExitStack() as files:
        for path in sorted(set(paths)):
            with open_part(path) as (recording, scan):
                descriptor = files.enter_context(path.open("rb")).fileno()
                left = scan.total_bytes // ROW_BYTES + FEW_ROWS
                for chunk in chunks(recording, scan):
                    left -= drawn.take(chunk, descriptor) if chunk is not None else 0
                    if left < 0:
                        raise ValueError("holds more rows than its size allows")
        for places in drawn.places.values():
            places.sort(key=lambda place: place.at_ns)
        pose_ns, poses = np.concatenate(drawn.pose_ns), np.concatenate(drawn.poses)
        poses[:, :2] += drawn.anchor
        order = np.argsort(pose_ns, kind="stable")
        ended_ns = max([record.ended_ns, *(one.wall_ns for one in samples[-1:])])
        yield Timeline(record.clock, ended_ns, samples, pose_ns[order], poses[order], drawn)


class _Drawn:
    """Places of drawings, and the poses, in the order of the files."""

    def __init__(self) -> None:
        self.anchor = np.zeros(2)
        self.places: dict[str, list[Place]] = defaultdict(list)
        self.pose_ns = [np.zeros(0, np.int64)]
        self.poses = [np.zeros((0, 3))]

    def take(self, chunk: Chunk, descriptor: int) -> int:
        """Take a chunk; return the number of rows kept."""
        entity, batch = chunk.entity, chunk.batch
        if chunk.is_static and entity == entities.WORLD:
            self.anchor = anchor_in(batch, self.anchor)
        if chunk.is_static or entity not in (*GRIDS, entities.PATH, entities.ROBOT):
            return 0
        times = wall_ns(batch)
        if entity == entities.ROBOT:
            self.pose_ns.append(np.array(times, np.int64))
            self.poses.append(poses_in(batch))
        else:
            rows = enumerate(times)
            self.places[entity] += [Place(at, descriptor, chunk.offset, row) for row, at in rows]
        return len(times)
