"""Certain floor: pixels that are swept for every possible position of a map that has moved.

Tiles are those of ``mission.coverage.floor_tiles``: a bit for each pixel, eight of a row in a byte,
the first in the highest bit. A block is eight by eight pixels. A swept block whose neighbours are
all swept is *deep* (interior), as most are. A block whose centre falls in a deep block is swept as
a whole; none of its pixels is looked up.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined, kernel, lean_inner_kernel

# Edges of a tile and of a block [pixels], and their binary logarithms.
TILE_SHIFT, BLOCK_SHIFT = 7, 3
TILE, BLOCK = 1 << TILE_SHIFT, 1 << BLOCK_SHIFT
# Blocks, and bytes, along a tile.
BLOCKS = TILE // BLOCK
# Rows and columns of tiles that a rotated tile can overlap.
NEAR = 3
# Positions of a tile within this many pixels are counted from one corner.
MOST_TOGETHER = 1 << 20

ONE, SEVEN, ALL = np.uint64(1), np.uint64(7), np.uint8(255)
SHIFT = np.uint64(BLOCK_SHIFT)
NO_TILE = -(2**62)


class FloorTiles(NamedTuple):
    """Tiles of floor.

    Attributes:
        places: int64 (n, 2), sorted: tile (i, j) begins with pixel (TILE * i, TILE * j).
        bits: uint8 (n, TILE, BLOCKS).
    """

    places: NDArray[np.int64]
    bits: NDArray[np.uint8]


class Whereabouts(NamedTuple):
    """Possible positions of a map that has moved.

    Attributes:
        places: float64 (k, k, 4), rows of positions: row n has n + 1, each a ``Similarity`` (see
            ``mission.coverage.floor_tiles``) of translation and rotation only.
        counts: int64 (m,), number of positions checked for each requested tile: row ``counts - 1``.
    """

    places: NDArray[np.float64]
    counts: NDArray[np.int64]


class _Around(NamedTuple):
    """NEAR by NEAR tiles put together, so that no pixel needs a lookup of its tile.

    Attributes:
        first: int64 (2,), row and column of the first tile.
        bits: uint8 (NEAR * TILE, NEAR * BLOCKS).
        deep: uint64 (NEAR * BLOCKS,), a row of blocks each, the first in the lowest bit.
    """

    first: NDArray[np.int64]
    bits: NDArray[np.uint8]
    deep: NDArray[np.uint64]


class _Lookup(NamedTuple):
    """Transform of points [pixels] into ``_Around``.

    The point (row, col) is ``right * row + i0 + up * col`` rows and ``j0 - up * row + right * col``
    columns from a corner, which is pixel (``rows``, ``cols``) of ``_Around``.
    """

    right: float
    up: float
    i0: float
    j0: float
    rows: int
    cols: int


@inlined
def _tile_at(places: NDArray[np.int64], row: int, col: int) -> int:
    """Return the index of a tile; -1 if there is none."""
    low, high = 0, len(places)
    while low < high:
        middle = (low + high) >> 1
        i, j = places[middle, 0], places[middle, 1]
        if i < row or (i == row and j < col):
            low = middle + 1
        else:
            high = middle
    if low < len(places) and places[low, 0] == row and places[low, 1] == col:
        return low
    return -1


@lean_inner_kernel
def _find_deep(
    tiles: FloorTiles,
    whole: NDArray[np.uint64],
    deep: NDArray[np.uint64],
    rows: NDArray[np.uint64],
) -> None:
    """Find the swept blocks and the deep ones.

    ``whole`` and ``deep``, uint64 (n, BLOCKS), receive them, the first block of a row in the lowest
    bit; ``rows``, uint64 (BLOCKS + 2,), is working memory for the blocks of a tile and beside it.
    """
    for tile in range(len(tiles.bits)):
        for i in range(BLOCKS):
            whole[tile, i] = 0
            for j in range(BLOCKS):
                byte = ALL
                for line in range(BLOCK * i, BLOCK * i + BLOCK):
                    byte &= tiles.bits[tile, line, j]
                whole[tile, i] |= np.uint64(byte == ALL) << np.uint64(j)
    for tile in range(len(tiles.bits)):
        rows[:] = 0
        for beside in range(9):
            di, dj = beside // 3 - 1, beside % 3 - 1
            row, col = tiles.places[tile, 0] + di, tiles.places[tile, 1] + dj
            other = _tile_at(tiles.places, row, col)
            if other < 0:
                continue
            first, last = max(-1 - di * BLOCKS, 0), min(BLOCKS - di * BLOCKS, BLOCKS - 1)
            for i in range(first, last + 1):
                blocks = whole[other, i]
                if dj < 0:
                    blocks >>= np.uint64(BLOCKS - 1)
                else:
                    blocks = (blocks << ONE) << np.uint64(dj * BLOCKS)
                rows[i + di * BLOCKS + 1] |= blocks
        for i in range(BLOCKS + 2):
            rows[i] &= (rows[i] << ONE) & (rows[i] >> ONE)
        for i in range(BLOCKS):
            deep[tile, i] = (rows[i] & rows[i + 1] & rows[i + 2]) >> ONE
            deep[tile, i] &= np.uint64((1 << BLOCKS) - 1)


@lean_inner_kernel
def _find_bounds(place: NDArray[np.float64], row: int, col: int, bounds: NDArray[np.int64]) -> None:
    """Find the window, int64 (4,), with the pixels of a tile that begins with (row, col)."""
    least_i, least_j, most_i, most_j = np.inf, np.inf, -np.inf, -np.inf
    row0, col0, right, up = place
    for corner in range(4):
        r, c = float(row + TILE * (corner >> 1)), float(col + TILE * (corner & 1))
        i, j = row0 + up * c + right * r, col0 + right * c - up * r
        least_i, most_i = min(least_i, i), max(most_i, i)
        least_j, most_j = min(least_j, j), max(most_j, j)
    # One pixel of margin: a centre's position is rounded.
    bounds[0], bounds[1] = int(np.floor(least_i)) - 1, int(np.floor(least_j)) - 1
    bounds[2], bounds[3] = int(np.floor(most_i)) + 2, int(np.floor(most_j)) + 2


@lean_inner_kernel
def _put_together(
    tiles: FloorTiles, deep: NDArray[np.uint64], row: int, col: int, around: _Around
) -> None:
    """Let ``around`` begin with tile (row, col)."""
    if around.first[0] == row and around.first[1] == col:
        return
    around.first[0], around.first[1] = row, col
    around.deep[:] = 0
    for i in range(NEAR):
        for j in range(NEAR):
            tile = _tile_at(tiles.places, row + i, col + j)
            for line in range(TILE):
                for byte in range(BLOCKS):
                    value = tiles.bits[tile, line, byte] if tile >= 0 else np.uint8(0)
                    around.bits[i * TILE + line, j * BLOCKS + byte] = value
            for line in range(BLOCKS if tile >= 0 else 0):
                around.deep[i * BLOCKS + line] |= deep[tile, line] << np.uint64(j * BLOCKS)


@inlined
def _pixel(lookup: _Lookup, row: float, col: float) -> tuple[np.uint64, np.uint64]:
    """Return the row and column in ``_Around`` of a point."""
    # Summed in this order, as it determines the rounding.
    i = (lookup.right * row + lookup.i0) + lookup.up * col
    j = (lookup.j0 - lookup.up * row) + lookup.right * col
    return np.uint64(int(i) + lookup.rows), np.uint64(int(j) + lookup.cols)


@lean_inner_kernel
def _leave_at(
    lookup: _Lookup, around: _Around, row: int, col: int, left: NDArray[np.uint8]
) -> bool:
    """Unmark unswept pixels of the tile that begins with (row, col); return whether any is left."""
    is_any = False
    for top in range(0, TILE, BLOCK):
        for byte in range(BLOCKS):
            marked = np.uint8(0)
            for line in range(top, top + BLOCK):
                marked |= left[line, byte]
            if marked == 0:
                continue
            x = float(col + BLOCK * byte)
            i, j = _pixel(lookup, float(row + top) + BLOCK / 2, x + BLOCK / 2)
            if (around.deep[i >> SHIFT] >> (j >> SHIFT)) & ONE:
                is_any = True
                continue
            for line in range(top, top + BLOCK):
                if left[line, byte] == 0:
                    continue
                swept = np.uint64(0)
                for bit in range(8):
                    i, j = _pixel(lookup, row + line + 0.5, x + (bit + 0.5))
                    eight = np.uint64(around.bits[i, j >> SHIFT])
                    swept = (swept << ONE) | ((eight >> (SEVEN - (j & SEVEN))) & ONE)
                left[line, byte] &= np.uint8(swept)
                is_any |= left[line, byte] != 0
    return is_any


@kernel
def certain_floor(
    before: FloorTiles, after: FloorTiles, whereabouts: Whereabouts
) -> NDArray[np.uint8]:
    """Return the pixels of some tiles that are swept for every position, uint8 like their bits.

    Args:
        before: all tiles before the map moved.
        after: the requested tiles.
        whereabouts: possible positions of the map, for each requested tile.
    """
    whole, deep = np.empty((2, len(before.bits), BLOCKS), np.uint64)
    _find_deep(before, whole, deep, np.empty(BLOCKS + 2, np.uint64))
    around = _Around(
        np.full(2, NO_TILE, np.int64),
        np.empty((NEAR * TILE, NEAR * BLOCKS), np.uint8),
        np.empty(NEAR * BLOCKS, np.uint64),
    )
    left = after.bits.copy()
    bounds = np.empty((whereabouts.places.shape[1], 4), np.int64)
    for tile in range(len(left)):
        row, col = after.places[tile, 0] * TILE, after.places[tile, 1] * TILE
        count = whereabouts.counts[tile]
        places = whereabouts.places[count - 1]
        for number in range(count):
            _find_bounds(places[number], row, col, bounds[number])
        row0, col0 = bounds[:count, 0].min(), bounds[:count, 1].min()
        row1, col1 = bounds[:count, 2].max(), bounds[:count, 3].max()
        # Positions far apart, as after a jump of the map, are counted from a corner each: larger
        # numbers are rounded more, which decides for a centre on the border of two pixels.
        is_near = (row1 - row0) * (col1 - col0) <= MOST_TOGETHER
        # The last position first, as it leaves the fewest pixels.
        for number in range(count - 1, -1, -1):
            alone, place = bounds[number], places[number]
            if not is_near:
                row0, col0 = alone[0], alone[1]
            tile_row, tile_col = alone[0] >> TILE_SHIFT, alone[1] >> TILE_SHIFT
            _put_together(before, deep, tile_row, tile_col, around)
            lookup = _Lookup(
                place[2],
                place[3],
                place[0] - row0,
                place[1] - col0,
                row0 - (tile_row << TILE_SHIFT),
                col0 - (tile_col << TILE_SHIFT),
            )
            if not _leave_at(lookup, around, row, col, left[tile]):
                break
    return left
