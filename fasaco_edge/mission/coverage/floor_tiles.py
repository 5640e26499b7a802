"""Tiles: unbounded rasters, copied on write; tiles of floor, and lookup from other rasters.

Tiles of floor have one bit per pixel. The pixels are fixed in the map frame, independent of a map's
origin, yaw and resolution: pixel (row, col) begins at y = row * PIXEL_M, x = col * PIXEL_M.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.occupancy import OccupancyGrid

# Edge of a pixel [m]: the strip that a tool leaves along a wall is a few pixels wide.
PIXEL_M = 0.025
# Edge of a tile [pixels]: 3.2 m; a multiple of 8.
FLOOR_TILE = 128
# Bytes in a row of a tile.
ROW_BYTES = FLOOR_TILE // 8

# A centre of another raster this near to the border of two pixels belongs to the pixel with the
# higher index, so that the result does not depend on the queried window [pixels].
TIE = 1e-6

# Edges of the squares in which swept floor is published [pixels]: whole bytes that divide a tile.
SQUARES = (1, 8, 16, 32, 64, FLOOR_TILE)

_BITS = np.array([bin(byte).count("1") for byte in range(256)], np.uint8)

TileKey = tuple[int, int]
"""Index of a tile: (i, j) begins at pixel (FLOOR_TILE * i, FLOOR_TILE * j)."""
Bits = NDArray[np.uint8]
"""Eight pixels of a row per byte, most significant bit first; (FLOOR_TILE, ROW_BYTES)."""
Tiles = Mapping[TileKey, Bits]
Mask = NDArray[np.bool_]
Scalar = TypeVar("Scalar", bound=np.generic)


class SharedTiles(dict[TileKey, NDArray[Scalar]]):
    """Tiles by place (row, col), shared with snapshots until they change.

    Only tiles with content are stored, so distant parts of a map cost nothing in between.

    Args:
        most: limit on the number of tiles.
        dropped: number of tiles dropped at once at the limit.
        blank: an empty tile.
    """

    def __init__(self, most: int, dropped: int, blank: NDArray[Scalar]) -> None:
        super().__init__()
        self._most, self._dropped, self._blank = most, dropped, blank
        # Tiles that no snapshot shares.
        self._own: set[TileKey] = set()

    def snapshot(self) -> Mapping[TileKey, NDArray[Scalar]]:
        """Return the present tiles; a tile is copied once it changes."""
        for place in self._own:
            self[place].flags.writeable = False
        self._own.clear()
        return MappingProxyType(dict(self))

    def make_room(self, place: TileKey) -> list[NDArray[Scalar]]:
        """Drop the tiles farthest from ``place`` if the limit allows no tile there; return them."""
        if place in self or len(self) < self._most:
            return []

        def distance(other: TileKey) -> tuple[int, TileKey]:
            return max(abs(other[0] - place[0]), abs(other[1] - place[1])), other

        farthest = sorted(self, key=distance)[-self._dropped :]
        return [self.drop(far) for far in farthest]

    def writable(self, place: TileKey) -> NDArray[Scalar]:
        """Return the tile at a place, created if missing; no snapshot shares it."""
        if place not in self._own:
            self.put(place, self.get(place, self._blank).copy())
        return self[place]

    def put(self, place: TileKey, tile: NDArray[Scalar]) -> None:
        """Take ownership of a tile."""
        self[place] = tile
        self._own.add(place)

    def drop(self, place: TileKey) -> NDArray[Scalar]:
        """Remove a tile and return it."""
        self._own.discard(place)
        return self.pop(place)


class Similarity(NamedTuple):
    """Placement of another raster's pixels on this one [pixels].

    The centre of pixel (row, col) lies at column ``col0 + right * (col + 0.5) - up * (row + 0.5)``
    and at row ``row0 + up * (col + 0.5) + right * (row + 0.5)``.
    """

    row0: float
    col0: float
    right: float
    up: float

    @classmethod
    def of(cls, geometry: GridGeometry) -> Similarity:
        """Return the placement of a grid's pixels."""
        origin, scale = geometry.origin, geometry.resolution / PIXEL_M
        right, up = scale * math.cos(origin.yaw), scale * math.sin(origin.yaw)
        return cls(origin.y / PIXEL_M, origin.x / PIXEL_M, right, up)

    def bounds(self, window: Window) -> Window:
        """Return the window of this raster that contains ``window`` of the other raster."""
        corners = [(r, c) for r in (window.row0, window.row1) for c in (window.col0, window.col1)]
        rows = [self.row0 + self.up * col + self.right * row for row, col in corners]
        cols = [self.col0 + self.right * col - self.up * row for row, col in corners]
        # One pixel of margin: a centre's position is rounded.
        low, high = (min(rows), min(cols)), (max(rows), max(cols))
        return Window(
            *(math.floor(least) - 1 for least in low), *(math.floor(most) + 2 for most in high)
        )


def pixels_under(window: Window, geometry: GridGeometry) -> Window:
    """Return a window of the grid with all pixels whose centre lies in the window of floor."""
    rows, cols = (window.row0, window.row1), (window.col0, window.col1)
    corners = [geometry.to_pixels(col * PIXEL_M, row * PIXEL_M) for row in rows for col in cols]
    x, y = zip(*corners, strict=True)
    return Window(
        math.floor(min(y)) - 1, math.floor(min(x)) - 1, math.ceil(max(y)) + 1, math.ceil(max(x)) + 1
    )


@dataclass(frozen=True, slots=True, eq=False)
class FloorSnapshot:
    """An immutable copy of the swept floor.

    Attributes:
        tiles: the tiles with a swept pixel, read-only.
        changes: counter, incremented with each change.
    """

    tiles: Tiles = field(default_factory=lambda: MappingProxyType({}))
    changes: int = 0

    @property
    def pixels(self) -> int:
        """Number of swept pixels."""
        return sum(count_bits(tile) for tile in self.tiles.values())

    @property
    def swept_m2(self) -> float:
        """Area of the swept floor [m2]."""
        return self.pixels * PIXEL_M * PIXEL_M

    def swept_in(self, window: Window) -> Mask:
        """Return which pixels of ``window`` were swept, bool (rows, cols)."""
        return swept_in(self.tiles, window)

    def as_grid(self, most: int, frame: str, stamp_ns: int) -> OccupancyGrid | None:
        """Return the swept share of each square as a grid, in percent, rounded down.

        The squares are as small as possible with at most ``most`` squares. None if even the largest
        squares are too many.
        """
        rows, cols = zip(*(self.tiles or ((0, 0),)), strict=True)
        low, high = (min(rows), min(cols)), (max(rows) + 1, max(cols) + 1)
        for side in SQUARES:
            edge = FLOOR_TILE // side
            shape = edge * (high[0] - low[0]), edge * (high[1] - low[1])
            if shape[0] * shape[1] > most:
                continue
            percent = np.zeros(shape, np.int8)
            for (row, col), part in _percent(self.tiles, side):
                i, j = edge * (row - low[0]), edge * (col - low[1])
                percent[i : i + edge, j : j + edge] = part
            corner = Pose2D(low[1] * FLOOR_TILE * PIXEL_M, low[0] * FLOOR_TILE * PIXEL_M)
            geometry = GridGeometry(*shape, side * PIXEL_M, corner)
            return OccupancyGrid(geometry, percent, frame, stamp_ns)
        return None


NO_FLOOR = FloorSnapshot()


def _percent(tiles: Tiles, side: int) -> Iterator[tuple[TileKey, NDArray[np.int8]]]:
    """Yield the marked share of each square of each tile [%], int8 (n, n)."""
    edge = FLOOR_TILE // side
    for place, tile in tiles.items():
        if side == 1:
            yield place, np.unpackbits(tile, axis=1).view(np.int8) * np.int8(100)
        else:
            counts = (
                _BITS[tile].reshape(edge, side, edge, side // 8).sum(axis=(1, 3), dtype=np.int32)
            )
            yield place, (counts * 100 // (side * side)).astype(np.int8)


def count_bits(bits: Bits) -> int:
    """Return the number of marked pixels."""
    return int.from_bytes(bits.tobytes()).bit_count()


def window_of(place: TileKey, side: int = FLOOR_TILE) -> Window:
    """Return the window of a tile, ``side`` squares wide."""
    row, col = side * place[0], side * place[1]
    return Window(row, col, row + side, col + side)


def places_of(window: Window, side: int = FLOOR_TILE) -> Iterator[TileKey]:
    """Yield the places of the tiles, ``side`` squares wide, that have squares in ``window``."""
    for row in range(window.row0 // side, -(-window.row1 // side)):
        for col in range(window.col0 // side, -(-window.col1 // side)):
            yield row, col


def assembled(
    tiles: Mapping[TileKey, NDArray[Any]],
    window: Window,
    side: int,
    kind: type[Scalar],
    unpacked: Callable[[NDArray[Any]], NDArray[Any]] = np.asarray,
) -> NDArray[Scalar]:
    """Return the values in ``window`` of tiles, 0 elsewhere, (rows, cols).

    Args:
        tiles: the tiles.
        window: window of the raster.
        side: edge of a tile, in squares.
        kind: dtype of the result.
        unpacked: returns the squares, (side, side), of a tile.
    """
    found = np.zeros((window.rows, window.cols), kind)
    # If the window has more places than there are tiles, go through the tiles instead.
    many = window.rows * window.cols > side * side * len(tiles)
    for place in tiles if many else places_of(window, side):
        tile, part = tiles.get(place), window_of(place, side)
        common = window.intersection(part)
        if tile is not None and common is not None:
            found[common.slices_in(window)] = unpacked(tile)[common.slices_in(part)]
    return found


def swept_in(tiles: Tiles, window: Window) -> Mask:
    """Return which pixels of ``window`` are marked, bool (rows, cols)."""
    return assembled(tiles, window, FLOOR_TILE, np.bool_, _pixels_of)


def _pixels_of(tile: Bits) -> Mask:
    return np.unpackbits(tile, axis=1).view(np.bool_)


def swept_on(swept_in: Callable[[Window], Mask], place: Similarity, window: Window) -> Mask:
    """Return which pixels of another raster have their centre on a marked pixel, bool (rows, cols).

    Args:
        swept_in: returns which pixels of a window are marked.
        place: placement of the other raster.
        window: window of its pixels.
    """
    under = place.bounds(window)
    swept = swept_in(under)
    if not swept.any():
        return np.zeros((window.rows, window.cols), np.bool_)
    rows = (np.arange(window.row0, window.row1) + 0.5)[:, np.newaxis]
    cols = np.arange(window.col0, window.col1) + 0.5
    # Positions relative to the corner of ``under`` are positive, so truncation rounds down.
    row0, col0, right, up = place
    i = ((right * rows + (row0 - under.row0 + TIE)) + up * cols).astype(np.int32)
    j = (((col0 - under.col0 + TIE) - up * rows) + right * cols).astype(np.int32)
    i *= under.cols
    i += j
    found: Mask = swept.ravel().take(i)
    return found


def centres(window: Window, square_m: float) -> NDArray[np.float64]:
    """Return the centres x, y [m] of a window's squares, float64 (n, 2), row by row."""
    rows, cols = np.mgrid[window.row0 : window.row1, window.col0 : window.col1]
    return (np.stack((cols.ravel(), rows.ravel()), axis=1) + 0.5) * square_m
