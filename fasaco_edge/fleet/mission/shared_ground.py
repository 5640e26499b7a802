"""Shared ground: the cells that the robots of a fleet can reach, each on its own map.

The division includes cells that only maps of other robots show, so that all robots divide nearly
the same area. Where this robot's own map is known, it takes precedence; paths are planned on this
map alone. A door that the robot has seen only in part looks shut on its map: ``with_doors`` adds
the cells beyond such doors.
"""

from __future__ import annotations

import operator
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.fleet.mission.shared import MOST_TILES_OF_ONE
from fasaco_edge.fleet.mission.tiles import (
    EMPTY,
    Placed,
    TileQueue,
    bits_of,
    packed,
    unpacked,
    window_of,
)
from fasaco_edge.grid.changes import carried
from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import BLOCKED, COVERABLE, UNKNOWN, Cell, CoverageLattice
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.kernels.lattice.reach import FAR, ways_from
from fasaco_edge.mission.coverage.ledger import TILE

# Largest number of cells that the ground of others may add to the lattice; more are left out.
MOST_ADDED = 1_000_000


class SharedGround:
    """The cells that other robots can reach; the caller drops robots that it no longer keeps.

    Attributes:
        version: counter of changes.
    """

    def __init__(self) -> None:
        self.version = 0
        self._robots: dict[str, dict[Cell, bytes]] = {}
        # The last joint areas, without and with doors, and the inputs of each.
        self._last: dict[bool, tuple[ReachableArea, int, ReachableArea]] = {}

    def receive(self, robot: str, tiles: Iterable[Placed]) -> None:
        """Take in a robot's tiles, each with TILE_BYTES of bits; they replace older tiles."""
        known = self._robots.setdefault(robot, {})
        for place, bits in tiles:
            has_room = place in known or len(known) < MOST_TILES_OF_ONE
            if has_room and known.get(place) != bits:
                known[place] = bits
                self.version += 1

    def drop(self, robot: str) -> None:
        """Forget a robot's ground: it is in another frame, or the robot is no longer kept."""
        if self._robots.pop(robot, None):
            self.version += 1

    def clear(self) -> None:
        """Forget all ground: it lies in another frame."""
        self._robots.clear()
        self.version += 1

    def joint(self, area: ReachableArea) -> ReachableArea:
        """Return an area with the ground of others added where its map is unknown."""
        return self._with(area, doors=False)

    def with_doors(self, area: ReachableArea) -> ReachableArea:
        """Return the area of ``joint`` with the ground beyond doors.

        A door is a cell that is blocked in the area and reachable for another robot. Ways lead
        through it, but it does not count as reachable.
        """
        return self._with(area, doors=True)

    def _with(self, area: ReachableArea, *, doors: bool) -> ReachableArea:
        # Cached, as this is called in each step while the robot drives to a door.
        last = self._last.get(doors)
        if last is None or last[0] is not area or last[1] != self.version:
            joined = _joined(area, self._merged(), doors=doors) if self._robots else area
            last = self._last[doors] = area, self.version, joined
        return last[2]

    def _merged(self) -> dict[Cell, NDArray[np.uint8]]:
        merged: dict[Cell, NDArray[np.uint8]] = {}
        for tiles in self._robots.values():
            for place, sent in tiles.items():
                bits = bits_of(sent)
                merged[place] = merged[place] | bits if place in merged else bits
        return merged


def viewpoint(
    area: ReachableArea, joint: ReachableArea, wanted: NDArray[np.bool_], cell: Cell
) -> Cell | None:
    """Return a viewpoint for the nearest wanted cell beyond a robot's own area, or None.

    The viewpoint is the last cell (row, col) of ``area`` on the shortest way to the wanted cell.

    Args:
        area: cells that the robot can reach on its own map.
        joint: that area with the ground of others.
        wanted: cells of the joint area, bool (rows, cols).
        cell: the robot's cell.
    """
    beyond = wanted & joint.reachable
    beyond[area.lattice.window.slices_in(joint.lattice.window)] &= ~area.reachable
    if not beyond.any() or not area.contains(cell):
        return None
    lattice = joint.lattice
    row, col = lattice.local(cell)
    ways = ways_from(lattice.steps, row * lattice.window.cols + col)
    nearest = int(np.where(beyond.ravel(), ways, FAR).argmin())
    at = divmod(nearest, lattice.window.cols)
    way = joint.shortest_path(cell, (at[0] + lattice.window.row0, at[1] + lattice.window.col0))
    seen = cell
    for step in map(tuple, way.tolist()):
        if not area.contains(step):
            break
        seen = step
    return seen


class GroundQueue:
    """Selects the tiles of ground for the next message, see ``TileQueue``."""

    def __init__(self) -> None:
        self._queue = TileQueue[bytes](operator.eq)
        self._area: ReachableArea | None = None
        self._tiles: dict[Cell, bytes] = {}

    def next(self, area: ReachableArea | None, most: int) -> tuple[Placed, ...]:
        """Return places and bits of a limited number of tiles."""
        if area is not self._area and area is not None:
            self._area, self._tiles = area, _tiles_of(area)
            # A tile that has lost its reachable cells is sent as empty.
            gone = [place for place in self._queue.sent if place not in self._tiles]
            self._tiles |= dict.fromkeys(gone, EMPTY)
        return tuple((place, self._tiles[place]) for place in self._queue.next(self._tiles, most))


def _joined(
    area: ReachableArea, tiles: dict[Cell, NDArray[np.uint8]], *, doors: bool
) -> ReachableArea:
    """Return an area with the cells of tiles added where its lattice is unknown.

    With ``doors``, ways also lead through blocked cells that others can reach.
    """
    lattice, window = area.lattice, area.lattice.window
    # The nearest tiles first, as tiles far away may come from a faulty robot.
    row, col = (window.row0 + window.row1) / 2, (window.col0 + window.col1) / 2
    places = sorted(tiles, key=lambda at: (abs(at[0] * TILE - row) + abs(at[1] * TILE - col), at))
    around = window
    for place in places:
        larger = Window.around(around, window_of(place))
        assert larger is not None
        if larger.rows * larger.cols - window.rows * window.cols > MOST_ADDED:
            break
        around = larger
    ground = np.zeros((around.rows, around.cols), np.bool_)
    for place in places:
        whole = window_of(place)
        if common := whole.intersection(around):
            cells = unpacked(tiles[place])
            ground[common.slices_in(around)] |= cells[common.slices_in(whole)]
    inside, known = window.slices_in(around), ground.copy()
    ground[inside] &= lattice.states == UNKNOWN
    door = np.zeros_like(ground)
    if doors:
        door[inside] = known[inside] & (lattice.states == BLOCKED)
    if not (ground | door).any():
        return area
    own = np.zeros_like(ground)
    own[inside] = lattice.coverable
    # This robot's own map decides the steps between two of its coverable cells.
    free = ground | own | door
    steps = CoverageLattice.from_free(free).steps.copy()
    between = CoverageLattice.from_free(own).steps
    steps &= ~between
    steps[inside] |= lattice.steps
    states = np.zeros(ground.shape, np.uint8)
    states[inside] = lattice.states
    states[ground] = COVERABLE
    whole_lattice = CoverageLattice(around, lattice.cell_m, states, steps)
    reached = carried(area.reachable, window, around)
    seeds = np.argwhere(reached)
    if not len(seeds):
        return ReachableArea(whole_lattice, reached)
    first = int(seeds[0, 0]) + around.row0, int(seeds[0, 1]) + around.col0
    joined = ReachableArea.around(whole_lattice, first).reachable
    # This robot may reach some of its own cells only over the ground of others. Such a cell counts
    # if another robot reaches it, too: otherwise an unseen wall may separate it.
    return ReachableArea(whole_lattice, joined & (reached | known) & ~door)


def _tiles_of(area: ReachableArea) -> dict[Cell, bytes]:
    """Return the reachable cells as tiles of bits, without empty tiles."""
    window, found = area.lattice.window, {}
    for row in range(window.row0 // TILE, -(-window.row1 // TILE)):
        for col in range(window.col0 // TILE, -(-window.col1 // TILE)):
            whole = window_of((row, col))
            if common := whole.intersection(window):
                part = area.reachable[common.slices_in(window)]
                if part.any():
                    cells = np.zeros((TILE, TILE), np.bool_)
                    cells[common.slices_in(whole)] = part
                    found[row, col] = packed(cells)
    return found
