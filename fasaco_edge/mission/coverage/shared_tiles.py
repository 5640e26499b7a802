"""Tiles of an unbounded raster: copied on write, limited in number."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Place = tuple[int, int]
Scalar = TypeVar("Scalar", bound=np.generic)


class SharedTiles(dict[Place, NDArray[Scalar]]):
    """Tiles by place (row, col), shared with snapshots until they change.

    Only tiles with content are stored, so a map that jumps far away costs nothing in between.

    Args:
        most: limit on the number of tiles.
        dropped: number of tiles dropped at once at the limit.
        blank: an empty tile.
        tiles: initial tiles.
    """

    def __init__(
        self,
        most: int,
        dropped: int,
        blank: NDArray[Scalar],
        tiles: Mapping[Place, NDArray[Scalar]] = MappingProxyType({}),
    ) -> None:
        super().__init__(tiles)
        self._most, self._dropped, self._blank = most, dropped, blank
        # Tiles that no snapshot shares.
        self._own: set[Place] = set()

    def snapshot(self) -> Mapping[Place, NDArray[Scalar]]:
        """Return the present tiles; a tile is copied once it changes."""
        for place in self._own:
            self[place].flags.writeable = False
        self._own.clear()
        return MappingProxyType(dict(self))

    def make_room(self, place: Place) -> list[NDArray[Scalar]]:
        """Drop the tiles farthest from ``place`` if there is no room for one there; return them."""
        if place in self or len(self) < self._most:
            return []

        def distance(other: Place) -> tuple[int, Place]:
            return max(abs(other[0] - place[0]), abs(other[1] - place[1])), other

        farthest = sorted(self, key=distance)[-self._dropped :]
        return [self.drop(far) for far in farthest]

    def writable(self, place: Place) -> NDArray[Scalar]:
        """Return the tile at a place, created if missing; no snapshot shares it."""
        if place not in self._own:
            self.put(place, self.get(place, self._blank).copy())
        return self[place]

    def put(self, place: Place, tile: NDArray[Scalar]) -> None:
        """Take ownership of a tile."""
        self[place] = tile
        self._own.add(place)

    def drop(self, place: Place) -> NDArray[Scalar]:
        """Remove a tile and return it."""
        self._own.discard(place)
        return self.pop(place)
