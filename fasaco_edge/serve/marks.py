"""Grids as marks, a byte of flags for each pixel.

Pixels are merged by OR, so no thin wall is lost; a level has the bits of all lower levels, so OR
gives the maximum. Without numpy: the whole process should take no more memory than a browser tab on
the robot.
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
# Limits of a map by default; a daemon's status may state others [percent].
FREE_AT_MOST, OCCUPIED_AT_LEAST = 25, 65
# Values of a coverage grid, as ``wire.messages.maps.CoverageValue`` has them for arrays.
TO_COVER, COVERED, RECOVERED, BLOCKED = 0, 50, 75, 100
# A phone draws this many pixels easily.
MOST_PIXELS = 2_000_000
COMPRESSION = 1


def map_marks(settings: MapSettings) -> bytes:
    """Return the mark of each byte of a map, by the limits in force."""
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
    """Return the mark of each byte: ``LEVELS`` levels from 1 to ``top`` and above, 0 for 0."""
    levels = (-(-min(value, top) * LEVELS // top) for value in range(256))
    return bytes((1 << level) - 1 for level in levels)


COVERAGE_MARKS = _coverage_marks()
"""For a coverage grid, if no map is received."""
FLOOR_MARKS = level_marks(100)
"""For a floor in percent."""
FIELD_MARKS = level_marks(255)
"""For a pheromone field."""
UNSWEPT_MARKS = bytes(1 << value - 1 if 1 <= value <= 6 else 0 for value in range(256))
"""For the reasons of unswept floor: a bit for each."""


def grid_message(kind: str, grid: GridOctets, marks: bytes) -> bytes:
    """Return a grid message for the page: placement and compressed marks."""
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
    """Return marks, rows of ``cols``, with each ``step`` x ``step`` of them made one."""
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
