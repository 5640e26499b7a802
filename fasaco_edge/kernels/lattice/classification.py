"""Classification of lattice cells and steps, tile by tile.

Most of a map is open floor or unknown: one read of a summed-area table replaces reading
each pixel under the robot. A table as large as the map would not fit into the cache, and
would cost more than the changed cells, so each tile has its own table, of the pixels around the
cells to classify. The tables only save work: if they do not suffice, the rows of pixels under the
disc decide, or ``footprint``.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels import COVERABLE, EAST, NORTH, SOUTH, UNKNOWN, WEST
from fasaco_edge.kernels.jit import inlined, kernel, lean_inner_kernel
from fasaco_edge.kernels.lattice.footprint import (
    Box,
    Pixels,
    Placement,
    Thresholds,
    centre,
    lane_is_free,
    reach_of,
)
from fasaco_edge.kernels.lattice.pixels import (
    PixelSums,
    count_around,
    disc_state,
    is_free,
    is_unknown,
    sum_up,
    sums_around,
    weigh,
)

# Approximate number of pixels of a tile, besides the margin within the robot's reach, and limit on
# its cells: smaller tables overlap too much, larger ones do not fit the cache.
TILE_PIXELS = 192
MOST_TILE_CELLS = 128


class Cells(NamedTuple):
    """A window of the lattice; the arrays' first cell is cell (row, col).

    Attributes:
        states: uint8 (rows, cols): UNKNOWN, BLOCKED or COVERABLE.
        steps: uint8 (rows, cols): bit ``1 << direction`` for each legal step.
        stale: bool (rows, cols): cells to be classified.
        row, col: place in the lattice.
    """

    states: NDArray[np.uint8]
    steps: NDArray[np.uint8]
    stale: NDArray[np.bool_]
    row: int
    col: int


class _Map(NamedTuple):
    """Arguments of ``classify_cells``."""

    pixels: Pixels
    placement: Placement
    thresholds: Thresholds
    cells: Cells


@lean_inner_kernel
def _stale_block(stale: NDArray[np.bool_], row0: int, col0: int, side: int) -> Box:
    """Return the block of a tile's stale cells; without rows where there are none."""
    row1, col1 = min(row0 + side, stale.shape[0]), min(col0 + side, stale.shape[1])
    top, left, bottom, right = row1, col1, row0, col0
    for row in range(row0, row1):
        for col in range(col0, col1):
            if stale[row, col]:
                top, bottom = min(top, row), row + 1
                left, right = min(left, col), max(right, col + 1)
    return Box(top, left, bottom, right)


@lean_inner_kernel
def _classify_states(given: _Map, block: Box, table: PixelSums) -> None:
    pixels, placement, cells = given.pixels, given.placement, given.cells
    radius = placement.radius
    height, width = pixels.values.shape
    for row in range(block.row0, block.row1):
        for col in range(block.col0, block.col1):
            if not cells.stale[row, col]:
                continue
            x, y = centre(placement, cells.row + row, cells.col + col)
            count = count_around(table, x, y, radius, radius)
            if is_free(count):
                state = COVERABLE
            elif is_unknown(count) or not (
                -radius - 1.0 < x - pixels.col < width + radius + 1.0
                and -radius - 1.0 < y - pixels.row < height + radius + 1.0
            ):
                state = UNKNOWN
            else:
                state = disc_state(pixels, x, y, radius, table)
            cells.states[row, col] = state


@inlined
def _classify_step(given: _Map, row: int, col: int, towards: int, table: PixelSums) -> None:
    """Settle the steps between a stale cell and its neighbour in the east or north.

    Steps to a neighbour that is not stale have not changed.
    """
    pixels, placement, cells = given.pixels, given.placement, given.cells
    back = WEST if towards == EAST else SOUTH
    far_row, far_col = (row, col + 1) if towards == EAST else (row + 1, col)
    rows, cols = cells.stale.shape
    legal = 0
    if far_row < rows and far_col < cols:
        if not cells.stale[far_row, far_col]:
            return
        states = cells.states
        if states[row, col] == COVERABLE and states[far_row, far_col] == COVERABLE:
            x, y = centre(placement, cells.row + row, cells.col + col)
            ux, uy, radius = placement.ux, placement.uy, placement.radius
            if towards == NORTH:
                ux, uy = -uy, ux
            reach_x, reach_y = 0.5 * abs(ux) + radius, 0.5 * abs(uy) + radius
            count = count_around(table, x + 0.5 * ux, y + 0.5 * uy, reach_x, reach_y)
            if is_free(count) or lane_is_free(pixels, x, y, ux, uy, radius, given.thresholds):
                legal = 1
        others = cells.steps[far_row, far_col] & 15 - (1 << back)
        cells.steps[far_row, far_col] = others | legal << back
    others = cells.steps[row, col] & 15 - (1 << towards)
    cells.steps[row, col] = others | legal << towards


@lean_inner_kernel
def _classify_tile(
    given: _Map, tile: Box, weights: NDArray[np.int64], sums: NDArray[np.int64]
) -> None:
    pixels, placement, cells = given.pixels, given.placement, given.cells
    rows, cols = cells.stale.shape
    # Includes the neighbours in the north and east, because the steps depend on their states.
    block = Box(tile.row0, tile.col0, min(tile.row1 + 1, rows), min(tile.col1 + 1, cols))
    high, wide = block.row1 - block.row0 - 1, block.col1 - block.col0 - 1
    x, y = centre(
        placement, cells.row + block.row0 + 0.5 * high, cells.col + block.col0 + 0.5 * wide
    )
    ux, uy, reach = 0.5 * abs(placement.ux), 0.5 * abs(placement.uy), reach_of(placement) + 1.0
    reach_x, reach_y = wide * ux + high * uy + reach, wide * uy + high * ux + reach
    table = sums_around(pixels, x, y, reach_x, reach_y, sums)
    sum_up(pixels, weights, table)
    _classify_states(given, block, table)
    for row in range(tile.row0, tile.row1):
        for col in range(tile.col0, tile.col1):
            if cells.stale[row, col]:
                for towards in (EAST, NORTH):
                    _classify_step(given, row, col, towards, table)


@kernel
def classify_cells(
    pixels: Pixels, placement: Placement, thresholds: Thresholds, cells: Cells
) -> None:
    """Fill in state and steps of the stale cells of a lattice.

    Cells that are not stale must already have their right states and steps.

    Args:
        pixels: the map.
        placement: where the lattice cells lie; the radius is above 0.
        thresholds: what counts as free and as occupied.
        cells: in and out.
    """
    given = _Map(pixels, placement, thresholds, cells)
    rows, cols = cells.stale.shape
    reach, scale = reach_of(placement), abs(placement.ux) + abs(placement.uy)
    side = min(max(int((TILE_PIXELS + 2.0 * reach) / scale), 2), MOST_TILE_CELLS)
    most = int((side + 1) * scale + 2.0 * reach) + 4
    weights = np.empty(256, np.int64)
    weigh(thresholds, weights)
    height, width = pixels.values.shape
    sums = np.empty((min(most, height) + 1) * (min(most, width) + 1), np.int64)
    for row in range(0, rows, side):
        for col in range(0, cols, side):
            tile = _stale_block(cells.stale, row, col, side)
            if tile.row0 < tile.row1:
                _classify_tile(given, tile, weights, sums)
    # No step leads out of the arrays.
    for row in range(rows if cols else 0):
        if cells.stale[row, 0]:
            cells.steps[row, 0] &= 15 - (1 << WEST)
    for col in range(cols if rows else 0):
        if cells.stale[0, col]:
            cells.steps[0, col] &= 15 - (1 << SOUTH)
