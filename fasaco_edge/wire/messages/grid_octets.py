"""Grids read as octets, a byte a cell, for small programs that only pass them on."""

from __future__ import annotations

from dataclasses import dataclass

from fasaco_edge.grid.geometry import GridGeometry, Window
from fasaco_edge.wire.limits import MAX_GRID_CELLS
from fasaco_edge.wire.messages.cdr import CdrReader, refuse
from fasaco_edge.wire.messages.fields import read_header
from fasaco_edge.wire.messages.grid_info import (
    COLONY,
    COLONY_NAMES,
    PLACE,
    PLACE_NAMES,
    read_grid_geometry,
    read_octets,
)
from fasaco_edge.wire.schemas import OCCUPANCY_GRID, OCCUPANCY_GRID_UPDATE, PHEROMONE_GRID


@dataclass(frozen=True, slots=True, eq=False)
class GridOctets:
    """A grid received from the bus.

    Attributes:
        geometry: its size and place.
        octets: row by row, the southernmost first; an int8 of a map as its byte. The range of
            values is not checked.
        frame: name of the map frame.
    """

    geometry: GridGeometry
    octets: memoryview | bytearray
    frame: str


def read_grid(payload: bytes) -> GridOctets:
    """Return the grid in a nav_msgs/OccupancyGrid.

    Raises:
        MalformedMessage: it is no such message.
    """
    reader = CdrReader(payload, OCCUPANCY_GRID)
    frame, _ = read_header(reader)
    geometry = read_grid_geometry(reader)
    return GridOctets(geometry, read_octets(reader, geometry, MAX_GRID_CELLS), frame)


def read_field(payload: bytes) -> GridOctets:
    """Return the levels in a fasaco_msgs/PheromoneGrid, 0 for none.

    Raises:
        MalformedMessage: it is no such message.
    """
    reader = CdrReader(payload, PHEROMONE_GRID)
    frame, _ = read_header(reader)
    geometry = read_grid_geometry(reader)
    reader.words(COLONY, COLONY_NAMES)
    return GridOctets(geometry, read_octets(reader, geometry, MAX_GRID_CELLS, "levels"), frame)


def with_update(grid: GridOctets, payload: bytes) -> GridOctets:
    """Return a map with a map_msgs/OccupancyGridUpdate applied; the old map is consumed.

    Raises:
        MalformedMessage: it is no such message, or does not fit the map.
    """
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
