"""Cells received from one robot of a fleet, and their form in the stored ledger."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

import msgspec
from msgspec import Meta

from fasaco_edge.fleet.mission.tiles import TILE_BYTES, Bits, bits_of, cells_in
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.mission.events import SAME_LATTICE

if TYPE_CHECKING:
    # For types only: a daemon announces itself to its fleet before the kernels are loaded.
    from fasaco_edge.grid.lattice import Cell

Tiles = dict["Cell", Bits]


@dataclass(slots=True)
class MemberCells:
    """Cells swept by one robot: tiles of bits, and the bits that are disregarded.

    Attributes:
        epoch: epoch of the tiles.
        lattice: pose of its lattice in this robot's lattice when the tiles arrived [m].
        is_doubtful: whether all cells of this epoch are disregarded: some were disregarded when the
            sender's lattice moved, and their new places are unknown.
    """

    epoch: int
    lattice: Pose2D = SAME_LATTICE
    tiles: Tiles = field(default_factory=dict)
    disregarded: Tiles = field(default_factory=dict)
    is_doubtful: bool = False

    def begin(self, epoch: int) -> None:
        """Drop the tiles of the previous epoch."""
        self.epoch, self.tiles, self.is_doubtful = epoch, {}, False

    def move(self, epoch: int, lattice: Pose2D) -> None:
        """Drop everything, as the sender's lattice has moved."""
        is_doubtful = bool(self.disregarded) or self.is_doubtful
        self.is_doubtful = is_doubtful and epoch == self.epoch
        self.epoch, self.lattice, self.tiles, self.disregarded = epoch, lattice, {}, {}

    def drop_gone(self) -> None:
        """Drop the disregarded bits of tiles that the sender has not repeated in this epoch."""
        known = self.disregarded.items()
        self.disregarded = {place: bits for place, bits in known if place in self.tiles}

    @property
    def count(self) -> int:
        """Number of cells that are not disregarded."""
        return sum(cells_in(self.counted(place)) for place in self.tiles)

    def counted(self, place: Cell) -> Bits:
        """Return the bits of a tile that are not disregarded."""
        tile, without = self.tiles[place], self.disregarded.get(place)
        return tile if without is None else tile & ~without

    def kept(self) -> Kept:
        """Return everything in the stored form."""
        tiles, without, pose = _listed(self.tiles), _listed(self.disregarded), self.lattice
        return Kept(self.epoch, tiles, without, (pose.x, pose.y, pose.yaw), self.is_doubtful)


_Tile = tuple[int, int, Annotated[bytes, Meta(min_length=TILE_BYTES, max_length=TILE_BYTES)]]


class Kept(msgspec.Struct, frozen=True, array_like=True):
    """Stored form of ``MemberCells``."""

    epoch: int
    tiles: list[_Tile]
    disregarded: list[_Tile]
    lattice: tuple[float, float, float] = (0.0, 0.0, 0.0)
    is_doubtful: bool = False

    def restored(self, *, is_in_place: bool) -> MemberCells:
        """Restore the cells; without tiles if this robot's lattice has moved since."""
        tiles = _placed(self.tiles) if is_in_place else {}
        lattice, without = Pose2D(*self.lattice), _placed(self.disregarded)
        return MemberCells(self.epoch, lattice, tiles, without, self.is_doubtful)


def _listed(tiles: Tiles) -> list[_Tile]:
    return [(*place, tiles[place].tobytes()) for place in sorted(tiles)]


def _placed(tiles: list[_Tile]) -> Tiles:
    return {(row, col): bits_of(bits) for row, col, bits in tiles}
