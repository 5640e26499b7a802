"""Grids of one byte per cell: their placement, and their cells as octets.

The module works without numpy, for small programs that only forward grids.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import lru_cache

from fasaco_edge.grid.geometry import GridGeometry, Window
from fasaco_edge.wire.limits import (
    MAX_GRID_CELLS,
    MAX_GRID_TILT,
    MAX_RESOLUTION_M,
    MIN_RESOLUTION_M,
)
from fasaco_edge.wire.messages.cdr import (
    POSE,
    SECOND_NS,
    CdrReader,
    CdrWriter,
    check_pose,
    planar,
    read_header,
    refuse,
    refuse_nanosec,
    write_pose,
)
from fasaco_edge.wire.schemas import OCCUPANCY_GRID, OCCUPANCY_GRID_UPDATE, PHEROMONE_GRID

# Fields of a map update: its corner and its size.
PLACE = struct.Struct("<iiII")
PLACE_NAMES = ("x", "y", "width", "height")
# Fields of a pheromone grid: its scale, and the progress of the colony.
COLONY = struct.Struct("<ffIIII")
COLONY_NAMES = ("trail_min", "trail_max", "cohort", "velocity", "ants", "best_steps")
_INFO = struct.Struct("<iIfII")
_INFO_NAMES = (
    "info.map_load_time.sec",
    "info.map_load_time.nanosec",
    "info.resolution",
    "info.width",
    "info.height",
)


def read_grid_geometry(reader: CdrReader) -> GridGeometry:
    """Read a nav_msgs/MapMetaData; its time of loading is dropped."""
    _, nanosec, edge, cols, rows = reader.words(_INFO, _INFO_NAMES)
    if nanosec >= SECOND_NS:
        refuse_nanosec(reader, "info.map_load_time", nanosec)
    resolution = _shortest_decimal(edge)
    _check_resolution(resolution, reader.message)
    origin = reader.doubles(POSE, "info.origin")
    check_pose(origin, reader.message, "info.origin")
    if max(abs(origin[3]), abs(origin[4])) > MAX_GRID_TILT:
        refuse(
            reader.message,
            "info.origin.orientation",
            f"a turn about z (x and y within {MAX_GRID_TILT})",
            list(origin[3:]),
        )
    return GridGeometry(rows, cols, resolution, planar(origin))


def write_grid_geometry(writer: CdrWriter, geometry: GridGeometry, stamp_ns: int) -> None:
    """Write a nav_msgs/MapMetaData, loaded at ``stamp_ns``."""
    _check_resolution(geometry.resolution, writer.message)
    writer.words(
        _INFO,
        _INFO_NAMES,
        *divmod(stamp_ns, SECOND_NS),
        geometry.resolution,
        geometry.cols,
        geometry.rows,
    )
    write_pose(writer, geometry.origin, "info.origin")


def read_octets(
    reader: CdrReader, size: GridGeometry | Window, max_cells: int, field: str = "data"
) -> memoryview:
    """Read the last field, a byte for each of the cells of ``size``; return a view of them."""
    rows, cols = size.rows, size.cols
    count = reader.length(field, 1)
    if not 0 < count <= max_cells:
        refuse(reader.message, f"length of {field}", f"1..{max_cells}", count)
    if count != rows * cols:
        expected = f"width x height = {cols} x {rows} = {rows * cols}"
        refuse(reader.message, f"length of {field}", expected, count)
    octets = reader.octets(count, field)
    reader.end()
    return octets


_FLOAT32 = struct.Struct("<f")
# Far beyond any resolution; the decimals of larger values may overflow float32.
_FAR = 1e30


# Cached, as a robot's maps have one resolution.
@lru_cache(maxsize=16)
def _shortest_decimal(value: float) -> float:
    """Return the shortest decimal that is this float32: 0.05 m stays 0.05 m."""
    if not abs(value) < _FAR:
        return value
    for digits in range(1, 9):
        decimal = float(f"{value:.{digits}g}")
        if _FLOAT32.unpack(_FLOAT32.pack(decimal))[0] == value:
            return decimal
    return float(f"{value:.9g}")


def _check_resolution(resolution: float, message: str) -> None:
    if not MIN_RESOLUTION_M <= resolution <= MAX_RESOLUTION_M:
        expected = f"{MIN_RESOLUTION_M}..{MAX_RESOLUTION_M:g} m"
        hint = "publish the edge of a pixel in metres, as 0.05"
        refuse(message, "info.resolution", expected, resolution, hint)


@dataclass(frozen=True, slots=True, eq=False)
class GridOctets:
    """A grid received from the bus.

    Attributes:
        geometry: its size and place.
        octets: a byte for each cell, row by row, from the south; those of a map are int8, and not
            checked for their range.
        frame: name of the map frame.
    """

    geometry: GridGeometry
    octets: memoryview | bytearray
    frame: str


def read_grid(payload: bytes) -> GridOctets:
    """Return the grid in a nav_msgs/OccupancyGrid."""
    reader = CdrReader(payload, OCCUPANCY_GRID)
    frame, _ = read_header(reader)
    geometry = read_grid_geometry(reader)
    return GridOctets(geometry, read_octets(reader, geometry, MAX_GRID_CELLS), frame)


def read_field(payload: bytes) -> GridOctets:
    """Return the levels in a fasaco_msgs/PheromoneGrid, 0 for none."""
    reader = CdrReader(payload, PHEROMONE_GRID)
    frame, _ = read_header(reader)
    geometry = read_grid_geometry(reader)
    reader.words(COLONY, COLONY_NAMES)
    return GridOctets(geometry, read_octets(reader, geometry, MAX_GRID_CELLS, "levels"), frame)


def with_update(grid: GridOctets, payload: bytes) -> GridOctets:
    """Return a map with a map_msgs/OccupancyGridUpdate applied; the old map is consumed."""
    reader = CdrReader(payload, OCCUPANCY_GRID_UPDATE)
    frame, _ = read_header(reader)
    col, row, cols, rows = reader.words(PLACE, PLACE_NAMES)
    window = Window(row, col, row + rows, col + cols)
    part = read_octets(reader, window, MAX_GRID_CELLS)
    size = grid.geometry
    if window.intersection(Window(0, 0, size.rows, size.cols)) != window or frame != grid.frame:
        refuse(reader.message, "x, y, width, height", "a part of the map", (col, row, cols, rows))
    cells = grid.octets if isinstance(grid.octets, bytearray) else bytearray(grid.octets)
    for index in range(rows):
        start = (row + index) * size.cols + col
        cells[start : start + cols] = part[index * cols : (index + 1) * cols]
    return GridOctets(size, cells, frame)
