"""Lines, labels and pheromone fields of a recording, in the order in which they were drawn.

A review keeps some fields, spread over the whole time; everything else is read on demand.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.rotation import rotated_point
from fasaco_edge.recording import entities
from fasaco_edge.recording.arrow import pa
from fasaco_edge.recording.read.frames import Chunk, chunks, column, wall_ns
from fasaco_edge.recording.read.repair import open_part

# Most fields that are kept; beyond that every other one is dropped.
MOST_FIELDS = 64

_POINT = pa.list_(pa.field("item", pa.float32(), nullable=False), 3)
_STRIPS = pa.list_(pa.list_(pa.field("item", _POINT, nullable=False)))
_PLACE = pa.list_(_POINT)
_TURN = pa.list_(pa.list_(pa.field("item", pa.float32(), nullable=False), 4))
_DATA = pa.list_(pa.list_(pa.field("item", pa.uint8(), nullable=False)))
_CELL = pa.list_(pa.float32())


@dataclass(frozen=True, slots=True, eq=False)
class DrawnField:
    """A field as it was drawn.

    Attributes:
        at_ns: time by the recorder's clock [ns].
        window: the cells it spans, relative to the origin of the drawing.
        cell_m: edge of a cell [m].
        yaw_deg: angle of the rows of cells about that origin [deg]; the window is in these cells.
        anchor: origin of the drawing, (x, y) [m] in the map frame, if known.
    """

    at_ns: int
    window: Window
    _packed: bytes
    cell_m: float
    yaw_deg: float = 0.0
    anchor: tuple[float, float] = (0.0, 0.0)

    @property
    def levels(self) -> NDArray[np.uint8]:
        """Pheromone on a log scale, uint8 (rows, cols), row 0 with the smallest y; 0 for none."""
        shape = self.window.rows, self.window.cols
        return np.frombuffer(zlib.decompress(self._packed), np.uint8).reshape(shape)


def fields_in(batch: pa.RecordBatch, times: list[int]) -> Iterator[DrawnField]:
    """Yield the fields of a batch of rows, drawn at ``times`` [ns].

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
    for row, at_ns in enumerate(times):
        levels = np.asarray(data[row].values[0].values, np.uint8)
        shape = int(formats[row][0]["height"]), int(formats[row][0]["width"])
        cell_m, (x, y, _) = cells[row].as_py()[0], places[row].as_py()[0]
        if levels.size != shape[0] * shape[1] or not cell_m > 0:
            raise ValueError(f"a field of {levels.size} cells, stated {shape[0]} x {shape[1]}")
        yaw_deg = 0.0
        if turns is not None:
            _, _, sine, cosine = turns[row].as_py()[0]
            yaw_deg = math.degrees(2.0 * math.atan2(sine, cosine))
        x, y = rotated_point(x, y, -yaw_deg)
        corner = Window(0, 0, *shape).moved(round(y / cell_m), round(x / cell_m))
        # An image's row 0 is its top.
        upright = np.ascontiguousarray(levels.reshape(shape)[::-1])
        yield DrawnField(at_ns, corner, zlib.compress(upright.data, 1), cell_m, yaw_deg)


@dataclass(slots=True)
class FieldSampler:
    """Takes fields in order of time and keeps some.

    Attributes:
        count: number of all fields.
        fields: the kept ones, about evenly spread, and the last one.
    """

    count: int = 0
    fields: list[DrawnField] = field(default_factory=list)
    _every: int = 1
    _last: DrawnField | None = None

    def take(self, batch: pa.RecordBatch, times: list[int]) -> None:
        """Take the fields of a batch of rows.

        Raises:
            ValueError: the batch holds something else.
        """
        for taken in fields_in(batch, times):
            self._keep(taken)

    def _keep(self, taken: DrawnField) -> None:
        if self.count % self._every == 0:
            self.fields.append(taken)
        self.count += 1
        self._last = taken
        if len(self.fields) > MOST_FIELDS:
            self.fields = self.fields[::2]
            self._every *= 2

    def spread(self) -> tuple[DrawnField, ...]:
        """Return the kept fields in order of time, with the last one."""
        last = [] if self._last is None or self._last in self.fields else [self._last]
        return tuple(sorted([*self.fields, *last], key=lambda one: one.at_ns))


@dataclass(frozen=True, slots=True, eq=False)
class DrawnLine:
    """A drawn line, reduced to its corners.

    Attributes:
        at_ns: time by the recorder's clock [ns].
        revision: of the path in force then; 0 for none.
        xy: float64 (n, 2), its corners in the map frame [m]; n is 0 if a line was removed.
    """

    at_ns: int
    revision: int
    xy: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class DrawnLabel:
    """A drawn text and its time [ns]; "" if one was removed."""

    at_ns: int
    text: str


Drawn = DrawnLine | DrawnLabel | DrawnField


def drawings(paths: Sequence[Path], *wanted: str) -> Iterator[tuple[str, Drawn]]:
    """Yield each entity and its drawing, for paths, labels and the pheromone field.

    A part begins with the drawings in force before it; these are yielded again.

    Args:
        paths: the parts of one run, in order.
        wanted: names of the entities.

    Raises:
        UnreadableRecording: a file is missing, is no recording, or is damaged.
    """
    anchor = np.zeros(2)
    for path in paths:
        with open_part(path) as (recording, scan):
            for chunk in chunks(recording, scan):
                if chunk is None or not chunk.batch.num_rows:
                    continue
                if chunk.is_static and chunk.entity == entities.WORLD:
                    place = column(chunk.batch, "Transform3D:translation", _PLACE)
                    anchor = anchor if place is None else np.array(place[0].as_py()[0][:2])
                elif not chunk.is_static and chunk.entity in wanted:
                    yield from ((chunk.entity, one) for one in _drawn(chunk, anchor))


def _drawn(chunk: Chunk, anchor: NDArray[np.float64]) -> Iterator[Drawn]:
    batch, times = chunk.batch, wall_ns(chunk.batch)
    if chunk.entity == entities.PHEROMONE:
        x, y = anchor.tolist()
        yield from (replace(field, anchor=(x, y)) for field in fields_in(batch, times))
    elif (strips := column(batch, "LineStrips3D:strips", _STRIPS)) is not None:
        numbers = [0] * len(times)
        if entities.REPLAN in batch.schema.names:
            numbers = [number or 0 for number in batch.column(entities.REPLAN).to_pylist()]
        for at_ns, number, row in zip(times, numbers, strips, strict=True):
            points = row.values.flatten().flatten() if len(row.values) else ()
            xyz = np.asarray(points, np.float64).reshape(-1, 3)
            yield DrawnLine(at_ns, number, xyz[:, :2] + anchor)
    elif (labels := column(batch, "Points3D:labels", pa.list_(pa.string()))) is not None:
        for at_ns, row in zip(times, labels.to_pylist(), strict=True):
            yield DrawnLabel(at_ns, "\n".join(row))
