"""A recording by time: what was in force at any moment, and the grids and lines drawn in it."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bus.arrival import Arrival
from fasaco_edge.errors import UnreadableRecording
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.frames import BROKEN, chunk_at, column, pa, wall_ns
from fasaco_edge.recording.read.robot_clock import RobotClock, known_of, poses_of
from fasaco_edge.recording.read.run import (
    PLACE,
    POINT,
    POSES,
    STATUSES,
    DrawingPlace,
    RecordedSamples,
    read_run_record,
)
from fasaco_edge.recording.read.torn import open_part
from fasaco_edge.wire.documents.path_documents import PATH_DIGEST

_STRIPS = pa.list_(pa.list_(pa.field("item", POINT, nullable=False)))
_TURN = pa.list_(pa.list_(pa.field("item", pa.float32(), nullable=False), 4))
_DATA = pa.list_(pa.list_(pa.field("item", pa.uint8(), nullable=False)))
_CELL = pa.list_(pa.float32())


@dataclass(frozen=True, slots=True, eq=False)
class DrawnGrid:
    """A grid as it was drawn.

    Attributes:
        at_ns: time by the recorder's clock [ns].
        geometry: its size and place in the map frame.
        pixels: uint8 (rows, cols), row 0 has the smallest y; the opacity, if the pixels are RGBA.
    """

    at_ns: int
    geometry: GridGeometry
    pixels: NDArray[np.uint8]


@dataclass(frozen=True, slots=True, eq=False)
class DrawnLine:
    """A drawn line, reduced to its corners.

    Attributes:
        at_ns: time by the recorder's clock [ns].
        revision: revision of the path in force then; 0 for none.
        xy: float64 (n, 2), its corners in the map frame [m]; n is 0 if the line was removed.
    """

    at_ns: int
    revision: int
    xy: NDArray[np.float64]


Drawn = TypeVar("Drawn")
Reader = Callable[[pa.RecordBatch, NDArray[np.float64]], Iterator[Drawn]]


def read_drawings(
    places: Iterable[DrawingPlace], read: Reader[Drawn], anchor: NDArray[np.float64]
) -> Iterator[Drawn]:
    """Yield the drawings at places, by ``grids_in`` or ``lines_in``; of each chunk all at once.

    Raises:
        UnreadableRecording: a file is gone, or is damaged.
    """
    for path, in_file in groupby(places, key=lambda place: place.path):
        with open_part(path) as (recording, _):
            for offset, rows in groupby(in_file, key=lambda place: place.offset):
                batch = chunk_at(recording.fileno(), offset).batch
                for place in rows:
                    yield from read(batch.slice(place.row, 1), anchor)


def grids_in(batch: pa.RecordBatch, anchor: NDArray[np.float64]) -> Iterator[DrawnGrid]:
    """Yield the grid of each row of a batch; ``anchor``: the origin of drawings (x, y) [m].

    Raises:
        ValueError: the batch holds something else.
    """
    data = column(batch, "GridMap:data", _DATA)
    cells = column(batch, "GridMap:cell_size", _CELL)
    places = column(batch, "GridMap:translation", PLACE)
    turns = column(batch, "GridMap:quaternion", _TURN)
    if data is None or cells is None or places is None:
        return
    formats = batch.column("GridMap:format").to_pylist()
    dx, dy = anchor.tolist()
    for row, at_ns in enumerate(wall_ns(batch)):
        pixels = np.asarray(data[row].values[0].values, np.uint8)
        rows, cols = int(formats[row][0]["height"]), int(formats[row][0]["width"])
        cell_m, (x, y, _) = cells[row].as_py()[0], places[row].as_py()[0]
        if pixels.size not in (rows * cols, 4 * rows * cols) or not cell_m > 0:
            raise ValueError(f"a grid of {pixels.size} pixels, stated {rows} x {cols}")
        yaw = 0.0
        if turns is not None:
            _, _, sine, cosine = turns[row].as_py()[0]
            yaw = 2.0 * math.atan2(sine, cosine)
        # An image's row 0 is its top; the last channel is the opacity.
        upright = pixels.reshape(rows, cols, -1)[::-1, :, -1] if pixels.size else pixels
        geometry = GridGeometry(rows, cols, cell_m, Pose2D(x + dx, y + dy, yaw))
        yield DrawnGrid(at_ns, geometry, np.ascontiguousarray(upright).reshape(rows, cols))


def lines_in(batch: pa.RecordBatch, anchor: NDArray[np.float64]) -> Iterator[DrawnLine]:
    """Yield the line of each row of a batch; arguments and errors as for ``grids_in``."""
    strips, times = column(batch, "LineStrips3D:strips", _STRIPS), wall_ns(batch)
    numbers = [0] * len(times)
    if entities.REPLAN in batch.schema.names:
        numbers = [number or 0 for number in batch.column(entities.REPLAN).to_pylist()]
    for at_ns, number, row in zip(times, numbers, strips or (), strict=False):
        points = row.values.flatten().flatten() if len(row.values) else ()
        xyz = np.asarray(points, np.float64).reshape(-1, 3)
        yield DrawnLine(at_ns, number, xyz[:, :2] + anchor)


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
    _drawn: Mapping[str, Sequence[DrawingPlace]]
    _anchor: NDArray[np.float64]
    _files: Mapping[Path, int]

    @property
    def began_ns(self) -> int:
        """Beginning of the recording, since the epoch [ns]."""
        return self.clock.began_ns

    def newest(self, entity: str, at_ns: int) -> DrawingPlace | None:
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

    def grid(self, place: DrawingPlace) -> DrawnGrid:
        """Read a drawn grid.

        Raises:
            UnreadableRecording: the file is damaged, or was changed.
        """
        return self._read(grids_in, place)

    def line(self, place: DrawingPlace) -> DrawnLine:
        """Read a drawn line; errors as for ``grid``."""
        return self._read(lines_in, place)

    def _read(self, read: Reader[Drawn], place: DrawingPlace) -> Drawn:
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
