"""Maps: nav_msgs/OccupancyGrid and map_msgs/OccupancyGridUpdate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.occupancy import OCCUPIED, UNKNOWN, MapPatch, OccupancyGrid
from fasaco_edge.wire.cdr import CdrReader, CdrWriter, refuse
from fasaco_edge.wire.fields import (
    read_cells,
    read_grid_geometry,
    read_header,
    write_cells,
    write_grid_geometry,
    write_header,
)
from fasaco_edge.wire.limits import MAX_GRID_CELLS
from fasaco_edge.wire.schemas import OCCUPANCY_GRID, OCCUPANCY_GRID_UPDATE


def decode_occupancy_grid(payload: bytes, max_cells: int = MAX_GRID_CELLS) -> OccupancyGrid:
    """Return the map in a nav_msgs/OccupancyGrid; its cells are a view of ``payload``.

    Raises:
        MalformedMessage: it is no such message, or has no cells or over ``max_cells``.
    """
    reader = CdrReader(payload, OCCUPANCY_GRID)
    frame, stamp_ns = read_header(reader)
    geometry = read_grid_geometry(reader)
    cells = read_cells(reader, geometry.rows, geometry.cols, max_cells).view(np.int8)
    _check_occupancy(cells, reader.message)
    return OccupancyGrid(geometry, cells, frame, stamp_ns)


def encode_occupancy_grid(grid: OccupancyGrid) -> bytes:
    """Return ``grid`` as a nav_msgs/OccupancyGrid.

    The resolution becomes a float32; ``map_load_time`` is the map's stamp.

    Raises:
        MalformedMessage: the message would be one that ``decode_occupancy_grid`` refuses.
    """
    writer = CdrWriter(OCCUPANCY_GRID)
    write_header(writer, grid.frame, grid.stamp_ns)
    write_grid_geometry(writer, grid.geometry, grid.stamp_ns)
    _check_occupancy(grid.cells, writer.message)
    write_cells(writer, grid.cells)
    return writer.payload()


def decode_map_update(payload: bytes, max_cells: int = MAX_GRID_CELLS) -> MapPatch:
    """Return the patch in a map_msgs/OccupancyGridUpdate; its cells are a view of ``payload``.

    Whether it fits a map is for ``OccupancyGrid.patched`` to say.

    Raises:
        MalformedMessage: it is no such message, or has no cells or over ``max_cells``.
    """
    reader = CdrReader(payload, OCCUPANCY_GRID_UPDATE)
    frame, stamp_ns = read_header(reader)
    col, row = reader.int32("x"), reader.int32("y")
    cols, rows = reader.uint32("width"), reader.uint32("height")
    cells = read_cells(reader, rows, cols, max_cells).view(np.int8)
    _check_occupancy(cells, reader.message)
    return MapPatch(Window(row, col, row + rows, col + cols), cells, frame, stamp_ns)


def encode_map_update(patch: MapPatch) -> bytes:
    """Return ``patch`` as a map_msgs/OccupancyGridUpdate.

    Raises:
        MalformedMessage: the message would be one that ``decode_map_update`` refuses.
    """
    writer = CdrWriter(OCCUPANCY_GRID_UPDATE)
    window = patch.window
    if patch.cells.shape != (window.rows, window.cols) or patch.cells.dtype != np.int8:
        expected = f"int8 {(window.rows, window.cols)}"
        refuse(writer.message, "data", expected, f"{patch.cells.dtype} {patch.cells.shape}")
    _check_occupancy(patch.cells, writer.message)
    write_header(writer, patch.frame, patch.stamp_ns)
    writer.int32(window.col0, "x")
    writer.int32(window.row0, "y")
    writer.uint32(window.cols, "width")
    writer.uint32(window.rows, "height")
    write_cells(writer, patch.cells)
    return writer.payload()


def _check_occupancy(cells: NDArray[np.int8], message: str) -> None:
    least = int(cells.min(initial=UNKNOWN))
    most = int(cells.max(initial=OCCUPIED))
    if least < UNKNOWN or most > OCCUPIED:
        got = least if least < UNKNOWN else most
        row, col = np.argwhere(cells == got)[0]
        refuse(message, f"data at row {row}, column {col}", f"{UNKNOWN}..{OCCUPIED}", got)
