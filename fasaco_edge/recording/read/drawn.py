"""Lines, labels and pheromone fields in a recording, each as it was drawn, one after the other.

What a review does not need for its figures: it is read when somebody asks for it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.recording import entities
from fasaco_edge.recording.arrow import pa
from fasaco_edge.recording.read.fields import DrawnField, fields_in
from fasaco_edge.recording.read.frames import Chunk, chunks, column, open_part, wall_ns

_STRIPS = pa.list_(
    pa.list_(
        pa.field(
            "item",
            pa.list_(pa.field("item", pa.float32(), nullable=False), 3),
            nullable=False,
        )
    )
)
_PLACE = pa.list_(pa.list_(pa.field("item", pa.float32(), nullable=False), 3))


@dataclass(frozen=True, slots=True, eq=False)
class DrawnLine:
    """A line that was drawn, without the points it runs straight through.

    Attributes:
        at_ns: when, by the recorder's clock [ns].
        revision: of the path in force then; 0 where none was.
        xy: float64 (n, 2), its corners in the map frame [m]; n is 0 where a line was taken away.
    """

    at_ns: int
    revision: int
    xy: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class DrawnLabel:
    """A text that was drawn, and when [ns]; "" where one was taken away."""

    at_ns: int
    text: str


Drawn = DrawnLine | DrawnLabel | DrawnField


def drawings(paths: Sequence[Path], *wanted: str) -> Iterator[tuple[str, Drawn]]:
    """Yield the entity and what was drawn of it, of paths, labels and the pheromone field.

    A part begins with what was in force before it; that comes once more.

    Args:
        paths: the parts of one run, in order.
        wanted: names of the entities.

    Raises:
        UnreadableRecording: a file is missing, is no recording, or is broken.
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
