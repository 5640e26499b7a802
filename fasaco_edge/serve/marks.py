"""Grids as marks, a byte of flags for each pixel.

Large grids are reduced: pixels are merged by OR, so that no thin wall is lost. A level has the bits
of all lower levels, so that OR gives the maximum. There is no NumPy here, to save memory on the
robot.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence

from fasaco_edge.serve.messages import framed
from fasaco_edge.wire.documents.settings import MapSettings
from fasaco_edge.wire.messages.grids import GridOctets

# Marks of a map: unmarked pixels are unknown.
FREE, WALL = 1, 2
LEVELS = 7
# Default thresholds of a map [percent]; the configuration in the status may have others.
FREE_AT_MOST, OCCUPIED_AT_LEAST = 25, 65
# Values of a coverage grid, as in ``wire.messages.maps.CoverageValue``, which needs NumPy.
TO_COVER, COVERED, RECOVERED, BLOCKED = 0, 50, 75, 100
# Limit on the pixels of a grid message: a phone draws this many easily.
MOST_PIXELS = 2_000_000
COMPRESSION = 1


def map_marks(settings: MapSettings) -> bytes:
    """Return the mark of each value of a map, by the thresholds in force."""
    free, occupied = settings.free_at_most, settings.occupied_at_least
    free = FREE_AT_MOST if free is None else free
    occupied = OCCUPIED_AT_LEAST if occupied is None else occupied
    marks = (FREE if v <= free else WALL if v >= occupied else 0 for v in range(101))
    return bytes(marks).ljust(256, b"\0")


def _coverage_marks() -> bytes:
    marks = bytearray(256)
    for value in (TO_COVER, COVERED, RECOVERED):
        marks[value] = FREE
    marks[BLOCKED] = WALL
    return bytes(marks)


def level_marks(top: int) -> bytes:
    """Return the mark of each value: ``LEVELS`` levels for 1 to ``top``, 0 for 0."""
    levels = (-(-min(value, top) * LEVELS // top) for value in range(256))
    return bytes((1 << level) - 1 for level in levels)


COVERAGE_MARKS = _coverage_marks()
"""Marks of a coverage grid, used if no map is received."""
FLOOR_MARKS = level_marks(100)
"""Marks of swept floor in percent."""
FIELD_MARKS = level_marks(255)
"""Marks of a pheromone field."""
UNSWEPT_MARKS = bytes(1 << value - 1 if 1 <= value <= 6 else 0 for value in range(256))
"""Marks of unswept floor: a bit for each reason."""


def grid_message(kind: str, grid: GridOctets, marks: bytes) -> bytes:
    """Return a grid as a message for the page: its place and its compressed marks."""
    size, origin = grid.geometry, grid.geometry.origin
    octets = bytes(grid.octets).translate(marks)
    step = 1
    while -(-size.rows // step) * -(-size.cols // step) > MOST_PIXELS:
        step += 1
    rows, cols = -(-size.rows // step), -(-size.cols // step)
    if step > 1:
        octets = merged(octets, size.cols, step)
    place: dict[str, object] = {
        "rows": rows,
        "cols": cols,
        "pixel": size.resolution * step,
        "x": origin.x,
        "y": origin.y,
        "yaw": origin.yaw,
    }
    return framed(kind, place, zlib.compress(octets, COMPRESSION))


def merged(octets: bytes, cols: int, step: int) -> bytes:
    """Return marks, in rows of ``cols``, with each ``step`` x ``step`` of them merged."""
    width = -(-cols // step) * step
    rows = [octets[start : start + cols] for start in range(0, len(octets), cols)]
    parts = []
    for start in range(0, len(rows), step):
        row = _either(rows[start : start + step], cols).ljust(width, b"\0")
        parts.append(_either([row[index::step] for index in range(step)], width // step))
    return b"".join(parts)


def _either(rows: Sequence[bytes], size: int) -> bytes:
    marks = 0
    for row in rows:
        marks |= int.from_bytes(row, "little")
    return marks.to_bytes(size, "little")
