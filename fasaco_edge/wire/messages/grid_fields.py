"""Cells of grid messages as arrays."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Window
from fasaco_edge.wire.messages.cdr import CdrReader, CdrWriter, refuse
from fasaco_edge.wire.messages.grid_info import read_octets

_Cell = TypeVar("_Cell", np.int8, np.uint8)


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
