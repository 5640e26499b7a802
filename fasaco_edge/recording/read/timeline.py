"""A recording by time: what was in force at any moment."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bus.arrival import Arrival
from fasaco_edge.errors import UnreadableRecording
from fasaco_edge.recording.read.drawn import (
    Drawn,
    DrawnGrid,
    DrawnLine,
    Place,
    Reader,
    grids_in,
    lines_in,
)
from fasaco_edge.recording.read.frames import BROKEN, chunk_at
from fasaco_edge.recording.read.robot_clock import RobotClock, known_of, poses_of
from fasaco_edge.recording.read.run import (
    POSES,
    STATUSES,
    RecordedSamples,
    read_run_record,
)
from fasaco_edge.wire.documents.path_documents import PATH_DIGEST

KEPT = ("status", "command", "rooms", PATH_DIGEST)


@dataclass(slots=True)
class Timeline:
    """Drawings and samples of a recording, in order of time.

    Attributes:
        clock: conversion of the recording's times to the robot's.
        ended_ns: end of the recording, since the epoch [ns].
        samples: statuses, commands, rooms and digests of paths.
        pose_ns, poses: times int64 (n,) [ns], and float64 (n, 3): x [m], y [m], yaw [rad].
    """

    clock: RobotClock
    ended_ns: int
    samples: Sequence[Arrival]
    pose_ns: NDArray[np.int64]
    poses: NDArray[np.float64]
    _drawn: Mapping[str, Sequence[Place]]
    _anchor: NDArray[np.float64]
    _files: Mapping[Path, int]

    @property
    def began_ns(self) -> int:
        """Beginning of the recording, since the epoch [ns]."""
        return self.clock.began_ns

    def newest(self, entity: str, at_ns: int) -> Place | None:
        """Return the last drawing of an entity up to a time [ns]; None before the first one."""
        places = self._drawn.get(entity, ())
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
        return self._read(grids_in, place)

    def line(self, place: Place) -> DrawnLine:
        """Read a drawn line; errors as for ``grid``."""
        return self._read(lines_in, place)

    def _read(self, read: Reader[Drawn], place: Place) -> Drawn:
        try:
            batch = chunk_at(self._files[place.path], place.offset).batch
            return next(read(batch.slice(place.row, 1), self._anchor))
        except BROKEN as error:
            raise UnreadableRecording(f"the recording can no longer be read: {error}") from error


@contextmanager
def open_timeline(paths: Sequence[Path]) -> Iterator[Timeline]:
    """Open the parts of one run, in any order; the files stay open, even if they are deleted.

    Raises:
        UnreadableRecording: a file is missing or no recording, or there are no samples.
        DifferentRuns: the parts are not of one run.
    """
    with ExitStack() as files:
        yield _timeline(paths, files)


def _timeline(paths: Sequence[Path], files: ExitStack) -> Timeline:
    record = read_run_record(paths)
    statuses, poses, kept = (
        RecordedSamples((), record.batches, topics) for topics in (STATUSES, POSES, KEPT)
    )
    found = sorted(poses_of(known_of(statuses), poses), key=lambda one: one[0])
    samples = sorted(kept, key=lambda one: one.wall_ns)
    places = [(each.pose.x, each.pose.y, each.pose.yaw) for _, each in found]
    return Timeline(
        clock=record.clock,
        ended_ns=max([record.ended_ns, *(one.wall_ns for one in samples[-1:])]),
        samples=samples,
        pose_ns=np.array([at_ns for at_ns, _ in found], np.int64),
        poses=np.array(places, np.float64).reshape(-1, 3),
        # Not the whole record, whose samples take much memory.
        _drawn=record.drawn,
        _anchor=record.anchor,
        _files={path: files.enter_context(path.open("rb")).fileno() for path in paths},
    )
