"""Readers of the grids and lines drawn in a recording."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.frames import chunk_at, column, pa, wall_ns
from fasaco_edge.recording.read.repair import open_part

_POINT = pa.list_(pa.field("item", pa.float32(), nullable=False), 3)
_STRIPS = pa.list_(pa.list_(pa.field("item", _POINT, nullable=False)))
_PLACE = pa.list_(_POINT)
_TURN = pa.list_(pa.list_(pa.field("item", pa.float32(), nullable=False), 4))
_DATA = pa.list_(pa.list_(pa.field("item", pa.uint8(), nullable=False)))
_CELL = pa.list_(pa.float32())


@dataclass(frozen=True, slots=True)
class Place:
    """Place of a drawing: its time [ns], file, offset of the frame [bytes], row."""

    at_ns: int
    path: Path
    offset: int
    row: int


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
        revision: of the path in force then; 0 for none.
        xy: float64 (n, 2), its corners in the map frame [m]; n is 0 if the line was removed.
    """

    at_ns: int
    revision: int
    xy: NDArray[np.float64]


Drawn = TypeVar("Drawn")
Reader = Callable[[pa.RecordBatch, NDArray[np.float64]], Iterator[Drawn]]


def read_drawings(
    places: Iterable[Place], read: Reader[Drawn], anchor: NDArray[np.float64]
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
    places = column(batch, "GridMap:translation", _PLACE)
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


def anchor_in(batch: pa.RecordBatch, before: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the origin of drawings (x, y) [m] in static data of ``world``; else ``before``."""
    place = column(batch, "Transform3D:translation", _PLACE)
    return before if place is None else np.array(place[0].as_py()[0][:2])
