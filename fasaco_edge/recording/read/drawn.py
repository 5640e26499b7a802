"""Readers of the grids, lines, labels and poses drawn in a recording."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.recording import entities
from fasaco_edge.recording.arrow import pa
from fasaco_edge.recording.read.frames import Chunk, chunks, column, wall_ns
from fasaco_edge.recording.read.repair import open_part

_POINT = pa.list_(pa.field("item", pa.float32(), nullable=False), 3)
_STRIPS = pa.list_(pa.list_(pa.field("item", _POINT, nullable=False)))
_PLACE = pa.list_(_POINT)
_TURN = pa.list_(pa.list_(pa.field("item", pa.float32(), nullable=False), 4))
_AXIS_TURN = pa.list_(
    pa.struct(
        [
            pa.field("axis", _POINT, nullable=False),
            pa.field("angle", pa.float32(), nullable=False),
        ]
    )
)
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


@dataclass(frozen=True, slots=True)
class DrawnLabel:
    """A drawn text and its time [ns]; "" if the text was removed."""

    at_ns: int
    text: str


Drawn = DrawnLine | DrawnLabel | DrawnGrid


def drawings(paths: Sequence[Path], *wanted: str) -> Iterator[tuple[str, Drawn]]:
    """Yield the drawings of paths, labels and the pheromone field, each with its entity.

    Each part repeats the drawings in force at its beginning; these are yielded again.

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
                    anchor = anchor_in(chunk.batch, anchor)
                elif not chunk.is_static and chunk.entity in wanted:
                    yield from ((chunk.entity, one) for one in _drawn(chunk, anchor))


def _drawn(chunk: Chunk, anchor: NDArray[np.float64]) -> Iterator[Drawn]:
    batch, times = chunk.batch, wall_ns(chunk.batch)
    if chunk.entity == entities.PHEROMONE:
        yield from grids_in(batch, anchor)
    elif column(batch, "LineStrips3D:strips", _STRIPS) is not None:
        yield from lines_in(batch, anchor)
    elif (labels := column(batch, "Points3D:labels", pa.list_(pa.string()))) is not None:
        for at_ns, row in zip(times, labels.to_pylist(), strict=True):
            yield DrawnLabel(at_ns, "\n".join(row))


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


def poses_in(batch: pa.RecordBatch) -> NDArray[np.float64]:
    """Return the poses in a batch, float64 (n, 3): x, y [m] from the origin of drawings, yaw [rad].

    Raises:
        ValueError: the batch holds something else.
    """
    places, yaw = column(batch, "Transform3D:translation", _PLACE), _yaw_in(batch)
    if places is None or yaw is None:
        raise ValueError("poses without a place or a turn")
    xyz = np.asarray(places.flatten().flatten(), np.float64).reshape(batch.num_rows, -1)
    return np.column_stack((xyz[:, :2], yaw))


def _yaw_in(batch: pa.RecordBatch) -> NDArray[np.float64] | None:
    """Return the yaw of each pose [rad], float64 (n,); None if the batch has no rotations."""
    turns = column(batch, "Transform3D:quaternion", _TURN)
    if turns is not None:
        turned = np.asarray(turns.flatten().flatten(), np.float64).reshape(batch.num_rows, -1)
        return 2.0 * np.arctan2(turned[:, 2], turned[:, 3])
    # The first releases recorded the rotation as an angle about the vertical axis.
    turns = column(batch, "Transform3D:rotation_axis_angle", _AXIS_TURN)
    if turns is None:
        return None
    angles = np.asarray(turns.flatten().field("angle"), np.float64).reshape(batch.num_rows)
    return np.arctan2(np.sin(angles), np.cos(angles))


def anchor_in(batch: pa.RecordBatch, before: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the origin of drawings (x, y) [m] in static data of ``world``; else ``before``."""
    place = column(batch, "Transform3D:translation", _PLACE)
    return before if place is None else np.array(place[0].as_py()[0][:2])
