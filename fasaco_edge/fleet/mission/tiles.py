"""Tiles of bits: square parts of the lattice, as the robots of a fleet send them.

A tile has TILE x TILE cells; the tile at place (row, col) begins at cell (TILE * row, TILE * col).
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.mission.coverage.ledger import TILE

if TYPE_CHECKING:
    # For types only: a daemon announces itself to its fleet before the kernels are loaded.
    from fasaco_edge.grid.lattice import Cell

# Size of a tile [bytes]: a bit per cell, row by row, most significant bit first.
TILE_BYTES = TILE * TILE // 8
EMPTY = bytes(TILE_BYTES)

Bits = NDArray[np.uint8]
# Place of a tile, and its TILE_BYTES of bits.
Placed = tuple["Cell", bytes]


def window_of(place: Cell) -> Window:
    """Return the window of a tile's cells."""
    row, col = place[0] * TILE, place[1] * TILE
    return Window(row, col, row + TILE, col + TILE)


def bits_of(packed: bytes) -> Bits:
    """Return a tile's bytes as uint8 (TILE_BYTES,), read-only."""
    return np.frombuffer(packed, np.uint8)


def cells_in(bits: Bits | bytes) -> int:
    """Return the number of cells in a tile's bits."""
    return int.from_bytes(bytes(bits)).bit_count()


def unpacked(bits: Bits) -> NDArray[np.bool_]:
    """Return the cells of a tile's bits, bool (TILE, TILE)."""
    return np.unpackbits(bits).reshape(TILE, TILE).view(np.bool_)


def packed(cells: NDArray[np.bool_]) -> bytes:
    """Return cells, bool (TILE, TILE), as TILE_BYTES of bits."""
    return np.packbits(cells.reshape(-1)).tobytes()


Tile = TypeVar("Tile")


class TileQueue(Generic[Tile]):
    """Selects tiles to send: new and changed tiles first, then the others in turn.

    Attributes:
        sent: tiles as last sent, in the order of sending.
    """

    def __init__(self, is_same: Callable[[Tile, Tile], bool]) -> None:
        self.sent: dict[Cell, Tile] = {}
        self._is_same = is_same

    def next(self, tiles: Mapping[Cell, Tile], most: int) -> list[Cell]:
        """Return the places of up to ``most`` tiles; places without a tile are forgotten."""
        self.sent = {place: tile for place, tile in self.sent.items() if place in tiles}
        new = {
            place
            for place, tile in tiles.items()
            if place not in self.sent or not self._is_same(self.sent[place], tile)
        }
        chosen = [*sorted(new), *(place for place in self.sent if place not in new)][:most]
        for place in chosen:
            self.sent.pop(place, None)
            self.sent[place] = tiles[place]
        return chosen


class SweptQueue:
    """Selects the tiles of swept cells for the next message, see ``TileQueue``.

    Args:
        kept: the ledger's tiles when the epoch began; None if not known.
    """

    def __init__(self, kept: Mapping[Cell, NDArray[np.uint16]] | None = None) -> None:
        self._kept = None
        if kept is not None:
            self._kept = {place: tile_bits(tile) for place, tile in kept.items()}
        self._queue = TileQueue[NDArray[np.uint16]](operator.is_)

    def next(self, tiles: Mapping[Cell, NDArray[np.uint16]], most: int) -> tuple[Placed, ...]:
        """Return places and bits of a limited number of tiles of a ledger's snapshot."""
        chosen = self._queue.next(tiles, most)
        return tuple((place, tile_bits(tiles[place])) for place in chosen)

    def kept(self, sent: Iterable[Placed]) -> tuple[Placed, ...] | None:
        """Return which cells of sent tiles were swept before this epoch; None if not known."""
        kept = self._kept
        return None if kept is None else tuple((at, kept[at]) for at, _ in sent if at in kept)


def tile_bits(tile: NDArray[np.uint16]) -> bytes:
    """Return the visited cells of a ledger's tile as TILE_BYTES of bits."""
    return packed(tile > 0)
