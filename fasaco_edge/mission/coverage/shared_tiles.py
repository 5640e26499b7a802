"""Tiles of a raster without bounds: copied once they change, and never more than so many."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Place = tuple[int, int]
Scalar = TypeVar("Scalar", bound=np.generic)


class SharedTiles(dict[Place, NDArray[Scalar]]):
    """Tiles by place (row, col), which snapshots share until they change.

    By tile, so that a map that jumps far away costs nothing in between.

    Args:
        most: how many there may be.
        dropped: how many are dropped at once where there is no room for another.
        blank: a tile of nothing.
        tiles: to begin with.
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
        # The tiles that no snapshot shares.
        self._own: set[Place] = set()

    def snapshot(self) -> Mapping[Place, NDArray[Scalar]]:
        """Return what there is now; a tile is copied once it changes."""
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
        """Return the tile at a place, made where there is none; no snapshot shares it."""
        if place not in self._own:
            self.put(place, self.get(place, self._blank).copy())
        return self[place]

    def put(self, place: Place, tile: NDArray[Scalar]) -> None:
        """Take over a tile that nobody else has."""
        self[place] = tile
        self._own.add(place)

    def drop(self, place: Place) -> NDArray[Scalar]:
        """Forget a tile; return it."""
        self._own.discard(place)
        return self.pop(place)
