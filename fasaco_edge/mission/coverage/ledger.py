"""Coverage ledger: the visits of the tool to each cell, independent of any path."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Point, Pose2D, Window
from fasaco_edge.mission.coverage.floor_tiles import NO_FLOOR, FloorSnapshot, SharedTiles, assembled
from fasaco_edge.planners.living_trail import NO_TRAIL, TrailSnapshot

if TYPE_CHECKING:
    # For types only: a daemon reads its ledger before the kernels are loaded.
    from fasaco_edge.grid.lattice import Cell

# Two poses farther apart than this are a jump, unless the robot could have driven that far [cells]:
# the track between them is unknown.
JUMP_CELLS = 2.0

TILE = 64
# Lookups go by districts of DISTRICT x DISTRICT tiles.
DISTRICT = 16

# Limit on the tiles of a ledger: 8 million cells, more than any path. A tile takes 8 kB, and 8 kB
# more in the copy last written. ``protocol/limits.yaml`` has the same number.
MOST_TILES = 2048
# Number of tiles dropped at once at the limit, the farthest first.
DROPPED_TILES = MOST_TILES // 16

Tiles = Mapping["Cell", NDArray[np.uint16]]
Cells = NDArray[np.int64]
"""Rows, or columns, of cells."""


@dataclass(frozen=True, slots=True, eq=False)
class LedgerSnapshot:
    """An immutable copy of a ledger.

    It holds all that a mission keeps over a restart, with swept floor, order and trail.

    Attributes:
        cell_m: edge of a cell [m].
        frame: name of the cells' frame; "" while unknown.
        total: number of all visits.
        tiles: the visits, uint16 (TILE, TILE), read-only; tile (i, j) begins at cell
            (TILE * i, TILE * j).
        under_tool: cells under the tool; staying on them adds no visit.
        floor: the swept floor.
        note: order and progress as JSON, see ``work.order_state``; "" for none.
        trail: the pheromone of the living trail.
        fleet: cells swept by other robots, see ``fleet.shared``; b"" for none.
        lattice_deg: angle of the cells' rows to the x axis of the map frame [deg], about its
            origin. Cells, floor and trail are in the rotated frame; the order is in the map frame.
    """

    cell_m: float
    frame: str
    total: int
    tiles: Tiles
    under_tool: frozenset[Cell] = frozenset()
    floor: FloorSnapshot = NO_FLOOR
    note: str = ""
    trail: TrailSnapshot = NO_TRAIL
    fleet: bytes = b""
    lattice_deg: float = 0.0

    @property
    def cells(self) -> int:
        """Number of visited cells."""
        return sum(int(np.count_nonzero(tile)) for tile in self.tiles.values())

    @property
    def is_empty(self) -> bool:
        """Whether nothing was covered or swept."""
        return not self.cells and not self.floor.tiles and not self.fleet

    def visits(self, window: Window) -> NDArray[np.uint16]:
        """Return the number of visits, uint16 (rows, cols), of the cells of ``window``."""
        return assembled(self.tiles, window, TILE, np.uint16)


class CoverageLedger:
    """Visits of the tool to each cell.

    A cell is visited when the tool, a disc as wide as a cell, passes over its centre. Leaving and
    returning counts as another visit; ``total`` counts all visits. ``frame`` names the frame of the
    poses, "" while unknown. ``dropped`` counts the tiles dropped at the limit ``MOST_TILES``, the
    farthest from the robot first.
    """

    def __init__(self, cell_m: float, frame: str = "") -> None:
        self.frame = frame
        self.total = 0
        self.dropped = 0
        self._cell_m = cell_m
        self._tiles = SharedTiles(MOST_TILES, DROPPED_TILES, np.zeros((TILE, TILE), np.uint16))
        self._under_tool: frozenset[Cell] = frozenset()
        self._last: Pose2D | None = None

    @classmethod
    def restored(cls, snapshot: LedgerSnapshot) -> Self:
        """Return a restored ledger, without the last pose, as the track from it is unknown."""
        ledger = cls(snapshot.cell_m, snapshot.frame)
        ledger.total = snapshot.total
        ledger._tiles.update(snapshot.tiles)
        ledger._under_tool = snapshot.under_tool
        return ledger

    def snapshot(self) -> LedgerSnapshot:
        """Return a copy; tiles are copied on write."""
        tiles = self._tiles.snapshot()
        return LedgerSnapshot(self._cell_m, self.frame, self.total, tiles, self._under_tool)

    def move_to(self, frame: str) -> None:
        """Assign the cells to ``frame`` from now on."""
        self.frame = frame

    def record(
        self,
        pose: Pose2D,
        place_of: Callable[[Cell], Point | None] | None = None,
        farthest_m: float = 0.0,
    ) -> frozenset[Cell]:
        """Record driving to ``pose``; return the newly visited cells.

        Args:
            pose: the robot's pose.
            place_of: returns the point of a cell that the tool has to pass over, x, y [m]; None for
                none. By default the cell's centre.
            farthest_m: longest possible drive since the previous pose; 0 if unknown [m].
        """
        last = self._last or pose
        if math.hypot(pose.x - last.x, pose.y - last.y) > max(
            JUMP_CELLS * self._cell_m, farthest_m
        ):
            last = pose
        near = self._near(last, pose, place_of or self._centre)
        entered = self._swept(last, pose, near) - self._under_tool
        for cell in entered:
            self.visit(cell)
        self._under_tool = self._swept(pose, pose, near)
        self._last = pose
        return entered

    def break_track(self) -> None:
        """Note that the robot's track to its next pose is unknown."""
        self._last = None

    def lift_tool(self) -> None:
        """Note that the map moved: track and cells under the tool are unknown."""
        self.break_track()
        self._under_tool = frozenset()

    def forget(self, inside: Callable[[Cells, Cells], NDArray[np.bool_]]) -> None:
        """Forget all visits to some cells; cells under the tool keep one.

        Args:
            inside: returns which cells are chosen, bool (n,), for rows and columns, int64 (n,).
        """
        for places in self._districts():
            visited = [np.argwhere(self._tiles[place]) for place in places]
            cells = np.concatenate(
                [at + np.multiply(place, TILE) for place, at in zip(places, visited, strict=True)]
            )
            chosen = inside(cells[:, 0], cells[:, 1]) if len(cells) else np.zeros(0, np.bool_)
            ends = np.cumsum([len(at) for at in visited])
            for place, at, part in zip(places, visited, np.split(chosen, ends[:-1]), strict=True):
                if part.any():
                    self._tiles.writable(place)[tuple(at[part].T)] = 0
        for cell in self._under_tool:
            if not self.has_visited(cell):
                self.visit(cell)

    def _districts(self) -> list[list[Cell]]:
        found: dict[Cell, list[Cell]] = {}
        for row, col in self._tiles:
            found.setdefault((row // DISTRICT, col // DISTRICT), []).append((row, col))
        return list(found.values())

    def visits(self, window: Window) -> NDArray[np.uint16]:
        """Return the number of visits, uint16 (rows, cols), of the cells of ``window``."""
        return assembled(self._tiles, window, TILE, np.uint16)

    def has_visited(self, cell: Cell) -> bool:
        """Return whether the tool has passed over ``cell``."""
        row, col = cell
        tile = self._tiles.get((row // TILE, col // TILE))
        return tile is not None and bool(tile[row % TILE, col % TILE])

    def open_again(self, cell: Cell) -> None:
        """Forget the visits to a cell in which the tool missed floor."""
        row, col = cell
        if self.has_visited(cell):
            self._tiles.writable((row // TILE, col // TILE))[row % TILE, col % TILE] = 0

    def visit(self, cell: Cell) -> None:
        """Count a visit to a cell."""
        row, col = cell
        self.total += 1
        place = (row // TILE, col // TILE)
        self.dropped += len(self._tiles.make_room(place))
        tile = self._tiles.writable(place)
        tile[row % TILE, col % TILE] = min(int(tile[row % TILE, col % TILE]) + 1, 65535)

    def _centre(self, cell: Cell) -> Point | None:
        return (cell[1] + 0.5) * self._cell_m, (cell[0] + 0.5) * self._cell_m

    def _near(
        self, start: Pose2D, end: Pose2D, place_of: Callable[[Cell], Point | None]
    ) -> dict[Cell, Point]:
        """Return the cells within half a cell of the segment, with their points."""
        cell_m, half = self._cell_m, 0.5 * self._cell_m
        rows = _span(min(start.y, end.y) - half, max(start.y, end.y) + half, cell_m)
        cols = _span(min(start.x, end.x) - half, max(start.x, end.x) + half, cell_m)
        near = {}
        for row in rows:
            for col in cols:
                place = place_of((row, col))
                if place is not None:
                    near[row, col] = place
        return near

    def _swept(self, start: Pose2D, end: Pose2D, near: dict[Cell, Point]) -> frozenset[Cell]:
        """Return the cells of ``near`` whose point is within half a cell of the segment."""
        half = 0.5 * self._cell_m
        dx, dy = end.x - start.x, end.y - start.y
        length2 = dx * dx + dy * dy
        cells = []
        for cell, place in near.items():
            px, py = place[0] - start.x, place[1] - start.y
            along = min(max((px * dx + py * dy) / length2, 0.0), 1.0) if length2 else 0.0
            if math.hypot(px - along * dx, py - along * dy) < half:
                cells.append(cell)
        return frozenset(cells)


def _span(low: float, high: float, cell_m: float) -> range:
    return range(math.floor(low / cell_m), math.floor(high / cell_m) + 1)
