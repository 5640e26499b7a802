"""Maps: nav_msgs/OccupancyGrid and map_msgs/OccupancyGridUpdate.

The coverage is also an occupancy grid, on the lattice: any map viewer shows it.
"""

from __future__ import annotations

from enum import IntEnum
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fasaco_edge import kernels as cell
from fasaco_edge.grid.geometry import GridGeometry, Window
from fasaco_edge.grid.occupancy import OCCUPIED, UNKNOWN, MapPatch, OccupancyGrid
from fasaco_edge.wire.limits import MAX_GRID_CELLS
from fasaco_edge.wire.messages.cdr import CdrReader, CdrWriter, read_header, refuse, write_header
from fasaco_edge.wire.messages.grids import (
    PLACE,
    PLACE_NAMES,
    read_grid_geometry,
    read_octets,
    write_grid_geometry,
)
from fasaco_edge.wire.schemas import OCCUPANCY_GRID, OCCUPANCY_GRID_UPDATE

PATCH_CELLS = 4096
"""Up to this many cells are checked by calls that start quickly, but copy the cells."""


_Cell = TypeVar("_Cell", np.int8, np.uint8)


class CoverageValue(IntEnum):
    """Values of a coverage grid."""

    UNKNOWN = -1
    TO_COVER = 0
    COVERED = 50
    RECOVERED = 75
    BLOCKED = 100


def decode_occupancy_grid(payload: bytes, max_cells: int = MAX_GRID_CELLS) -> OccupancyGrid:
    """Return the map in a nav_msgs/OccupancyGrid; its cells are a view of ``payload``."""
    reader = CdrReader(payload, OCCUPANCY_GRID)
    frame, stamp_ns = read_header(reader)
    geometry = read_grid_geometry(reader)
    cells = read_cells(reader, geometry, np.int8, max_cells)
    _check_occupancy(cells, reader.message)
    return OccupancyGrid(geometry, cells, frame, stamp_ns)


def encode_occupancy_grid(grid: OccupancyGrid) -> bytes:
    """Return ``grid`` as a nav_msgs/OccupancyGrid.

    The resolution becomes a float32; ``map_load_time`` is the map's stamp.
    """
    writer = CdrWriter(OCCUPANCY_GRID)
    write_header(writer, grid.frame, grid.stamp_ns)
    write_grid_geometry(writer, grid.geometry, grid.stamp_ns)
    _check_occupancy(grid.cells, writer.message)
    write_cells(writer, grid.cells)
    return writer.payload()


def decode_map_update(payload: bytes, max_cells: int = MAX_GRID_CELLS) -> MapPatch:
    """Return the patch in a map_msgs/OccupancyGridUpdate; its cells are a view of ``payload``.

    ``OccupancyGrid.patched`` checks whether it fits a map.
    """
    reader = CdrReader(payload, OCCUPANCY_GRID_UPDATE)
    frame, stamp_ns = read_header(reader)
    col, row, cols, rows = reader.words(PLACE, PLACE_NAMES)
    window = Window(row, col, row + rows, col + cols)
    cells = read_cells(reader, window, np.int8, max_cells)
    _check_occupancy(cells, reader.message)
    return MapPatch(window, cells, frame, stamp_ns)


def encode_map_update(patch: MapPatch) -> bytes:
    """Return ``patch`` as a map_msgs/OccupancyGridUpdate."""
    writer = CdrWriter(OCCUPANCY_GRID_UPDATE)
    window = patch.window
    if patch.cells.shape != (window.rows, window.cols) or patch.cells.dtype != np.int8:
        expected = f"int8 {(window.rows, window.cols)}"
        refuse(writer.message, "data", expected, f"{patch.cells.dtype} {patch.cells.shape}")
    _check_occupancy(patch.cells, writer.message)
    write_header(writer, patch.frame, patch.stamp_ns)
    place = (window.col0, window.row0, window.cols, window.rows)
    writer.words(PLACE, PLACE_NAMES, *place)
    write_cells(writer, patch.cells)
    return writer.payload()


def read_cells(
    reader: CdrReader,
    geometry: GridGeometry | Window,
    dtype: type[_Cell],
    max_cells: int,
    field: str = "data",
) -> NDArray[_Cell]:
    """Read the last field, a byte for each of the cells of ``geometry``.

    Returns a read-only view, (rows, cols), of type ``dtype``.
    """
    octets = read_octets(reader, geometry, max_cells, field)
    cells: NDArray[_Cell] = np.ndarray((geometry.rows, geometry.cols), dtype, octets)
    return cells


def write_cells(writer: CdrWriter, cells: NDArray[np.generic], field: str = "data") -> None:
    """Write cells of one byte each, (rows, cols), as the last field."""
    if not cells.size:
        refuse(writer.message, f"length of {field}", "at least 1", 0)
    writer.uint32(cells.size, f"length of {field}")
    writer.view(np.ascontiguousarray(cells).data)


def _check_occupancy(cells: NDArray[np.int8], message: str) -> None:
    least, most = _least_and_most(cells)
    if least < UNKNOWN or most > OCCUPIED:
        got = least if least < UNKNOWN else most
        row, col = np.argwhere(cells == got)[0]
        refuse(message, f"data at row {row}, column {col}", f"{UNKNOWN}..{OCCUPIED}", got)


def _least_and_most(cells: NDArray[np.int8]) -> tuple[int, int]:
    """Return the least and the greatest value; for no cells, values in range."""
    if cells.size > PATCH_CELLS:
        return int(np.minimum.reduce(cells, axis=None)), int(np.maximum.reduce(cells, axis=None))
    if not cells.size:
        return UNKNOWN, OCCUPIED
    # A reduction of numpy takes a microsecond to start. argmin and argmax start faster, but copy
    # read-only data.
    return cells.item(cells.argmin()), cells.item(cells.argmax())


# Number of values per direction in a grid of directions.
DIRECTION_VALUES = 25


def direction_values(pointed: NDArray[np.int8], share: NDArray[np.float32]) -> NDArray[np.int8]:
    """Return the values, int8 (rows, cols), of a grid of a trail's directions.

    Args:
        pointed: int8 (rows, cols), direction 0..3 of the strongest step, -1 for none.
        share: float32 (rows, cols), its share of the cell's pheromone, 0 to 1.
    """
    steps = np.rint(share * (DIRECTION_VALUES - 1)).astype(np.int8)
    return np.where(pointed < 0, np.int8(UNKNOWN), pointed * np.int8(DIRECTION_VALUES) + steps)


def coverage_values(states: NDArray[np.uint8], visits: NDArray[np.uint16]) -> NDArray[np.int8]:
    """Return the values, int8 (rows, cols), of a coverage grid.

    Args:
        states: uint8 (rows, cols), as in the lattice: UNKNOWN, BLOCKED or COVERABLE.
        visits: uint16 (rows, cols), passes of the tool over each cell.
    """
    values = np.full(states.shape, CoverageValue.UNKNOWN, np.int8)
    values[states == cell.BLOCKED] = CoverageValue.BLOCKED
    coverable = states == cell.COVERABLE
    values[coverable] = CoverageValue.TO_COVER
    values[coverable & (visits == 1)] = CoverageValue.COVERED
    values[coverable & (visits > 1)] = CoverageValue.RECOVERED
    return values
