"""Floor: the places of the robot on a fine raster of a map, and the floor its tool reaches there.

The robot's disc can be at places where all pixels under it are free. The reachable floor is
everything that the tool's disc touches while the robot is at places connected to its start. Where
the tool extends beyond the robot (side brushes, a wide deck, a lamp), a pixel counts only if free
pixels, about inside the tool's disc, connect it with the robot's disc.

A cell of the lattice over the floor is coverable if the robot has a place in it. Its stand is the
place nearest to the cell's centre, and a step may bend around a corner.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import StartBlocked, StartOutsideMap
from fasaco_edge.grid.changes import carried_copy
from fasaco_edge.grid.fine_raster import (
    RobotDiscs,
    blocked_pixels,
    fine_geometry,
    raster_to_map,
    stand_placement,
)
from fasaco_edge.grid.geometry import GridGeometry, Window
from fasaco_edge.grid.lattice import BLOCKED, COVERABLE, UNKNOWN, CoverageLattice, lattice_window
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.kernels.floor.bits import LAST, ONE, Bits, packed, unpacked
from fasaco_edge.kernels.floor.places import (
    choose_stands,
    connected,
    disc_rows,
    link_stands,
    places_of,
    within,
)
from fasaco_edge.kernels.lattice.footprint import Placement

# Limit on the fine pixels, so that int8 and int32 arrays of them fit into memory.
MOST_PIXELS = 100_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Floor:
    """The floor that a robot reaches from a start.

    Attributes:
        geometry: geometry of the fine raster, with a border around the map.
        discs: robot and tool.
        blocked: uint64 (rows, words), see ``kernels.floor.bits``: pixels not known free.
        places: uint64 (rows, words): pixels whose centre the robot can occupy and reach.
        reachable: bool (rows, cols): pixels whose centre the tool reaches from these places.
        start: y, x of the place nearest to the start [pixels].
    """

    geometry: GridGeometry
    discs: RobotDiscs
    blocked: Bits
    places: Bits
    reachable: NDArray[np.bool_]
    start: tuple[int, int]

    @classmethod
    def around(cls, grid: OccupancyGrid, discs: RobotDiscs, start: tuple[float, float]) -> Floor:
        """Return the floor reachable from the place nearest to ``start``, x, y [m].

        Raises:
            StartOutsideMap: the start is not on the map.
            StartBlocked: the robot fits nowhere within its radius of the start.
            MapTooLarge: the fine raster would have more than ``MOST_PIXELS``.
        """
        geometry, parts = fine_geometry(grid.geometry, discs, MOST_PIXELS)
        every_row = 0, geometry.rows
        blocked = blocked_pixels(grid, geometry, parts, discs.free_at_most, every_row)
        radius = discs.radius_m / geometry.resolution
        fits = unpacked(places_of(blocked, disc_rows(radius)), geometry.cols)
        at = _nearest_place(geometry, fits, start, radius)
        places = packed(connected(fits, *at), beyond=False)
        reached = tool_reach(places, blocked, radius, discs.tool_m / 2 / geometry.resolution)
        reachable = unpacked(reached, geometry.cols)
        return cls(geometry, discs, blocked, places, reachable, at)

    @property
    def reachable_m2(self) -> float:
        """Area that the tool reaches [m2]."""
        return int(np.count_nonzero(self.reachable)) * self.geometry.resolution**2

    def to_map(self, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points y, x [pixels], float64 (n, 2), as x, y [m] in the map frame."""
        return raster_to_map(self.geometry, pixels)


@dataclass(frozen=True, slots=True, eq=False)
class StandLattice:
    """A lattice of stands, each as near to the centre of its cell as the robot can be.

    Attributes:
        lattice: the lattice; cells with a stand are coverable.
        stands: float64 (rows, cols, 2): y, x of the stand [pixels]; NaN for none.
        bends: float32 (rows, cols, 2, 2): y, x of the bend on the step to the east, and to the
            north, a pixel's centre [pixels]; NaN for a straight step.
    """

    lattice: CoverageLattice
    stands: NDArray[np.float64]
    bends: NDArray[np.float32]

    @classmethod
    def over(cls, floor: Floor, cell_m: float, max_cells: int = 4_000_000) -> StandLattice:
        """Return the lattice of cells ``cell_m`` wide [m] over a floor.

        Raises:
            MapTooLarge: it would have more than ``max_cells``.
            MapTooFar: it would reach too far from the origin.
        """
        window = lattice_window(floor.geometry, cell_m, max_cells)
        placement = stand_placement(floor.geometry, cell_m, floor.discs.radius_m)
        clear = floor.discs.clear_m / floor.geometry.resolution
        return cls.where(floor.blocked, floor.places, placement, window, cell_m, clear)

    @classmethod
    def where(
        cls,
        blocked: Bits,
        places: Bits,
        placement: Placement,
        window: Window,
        cell_m: float,
        clear: float,
        unknown: NDArray[np.bool_] | None = None,
        before: tuple[StandLattice, tuple[int, int], NDArray[np.bool_]] | None = None,
    ) -> StandLattice:
        """Return the lattice of stands among places.

        Args:
            blocked, places: see ``Floor``.
            placement: position of the cells on the raster.
            window: window of the cells.
            cell_m: their width [m].
            clear: radius of the robot with its clearance [pixels].
            unknown: bool (rows, cols): cells that count as unknown if they have no stand; other
                cells without a stand are blocked.
            before: the previous lattice, the shift of pixels since then in rows and columns, and
                the cells to recompute, bool (rows, cols); None to compute all.
        """
        shape = window.rows, window.cols
        if before is None:
            stands = np.full((*shape, 2), np.nan)
            bends = np.full((*shape, 2, 2), np.nan, np.float32)
            steps, stale = np.zeros(shape, np.uint8), np.ones(shape, np.bool_)
        else:
            old, shift, stale = before
            there = old.lattice.window
            stands = carried_copy(old.stands, there, window, np.nan)
            bends = carried_copy(old.bends, there, window, np.nan)
            steps = carried_copy(old.lattice.steps, there, window)
            for axis, by in enumerate(shift):
                if by:
                    stands[..., axis] += by
                    bends[..., axis] += np.float32(by)
        choose_stands(blocked, places, placement, stale, window.row0, window.col0, clear, stands)
        blockers = np.zeros((2, 2), np.int64)
        link_stands(blocked, places, placement, stale, stands, steps, bends, blockers)
        states = states_of(stands, unknown)
        return cls(CoverageLattice(window, cell_m, states, steps), stands, bends)

    def start_cell(self, floor: Floor) -> tuple[int, int]:
        """Return the cell whose stand is nearest to the robot."""
        squares = ((self.stands - np.array(floor.start)) ** 2).sum(axis=2)
        row, col = divmod(int(np.nanargmin(squares)), squares.shape[1])
        return row + self.lattice.window.row0, col + self.lattice.window.col0

    def stand(self, cell: NDArray[np.int32]) -> NDArray[np.float64]:
        """Return the stand of a cell (row, col), int32 (2,): y, x [pixels]."""
        row, col = self.lattice.local((int(cell[0]), int(cell[1])))
        at: NDArray[np.float64] = self.stands[row, col]
        return at

    def stands_of(self, cells: NDArray[np.int32]) -> NDArray[np.float64]:
        """Return the stands of cells (row, col), int32 (n, 2): float64 (n, 2); NaN if outside."""
        window: Window = self.lattice.window
        rows, cols = cells[:, 0] - window.row0, cells[:, 1] - window.col0
        is_outside = (rows < 0) | (rows >= window.rows) | (cols < 0) | (cols >= window.cols)
        at: NDArray[np.float64] = self.stands[
            rows.clip(0, window.rows - 1), cols.clip(0, window.cols - 1)
        ]
        at[is_outside] = np.nan
        return at

    def points(self, walk: NDArray[np.int32]) -> NDArray[np.float64]:
        """Return the line along a walk, cells (row, col), int32 (n, 2): float64 (m, 2), y, x.

        Straight runs have no points in between.
        """
        return self.line(walk)[0]

    def line(self, walk: NDArray[np.int32]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the line along a walk, and the index in the walk of each point's cell, int64 (m,).

        A bend belongs to the cell that the step leaves.
        """
        window: Window = self.lattice.window
        cells = walk - np.array((window.row0, window.col0), np.int32)
        at = self.stands[cells[:, 0], cells[:, 1]]
        moves = np.diff(cells, axis=0)
        # A step's bend is stored at its western or southern cell.
        lower = np.minimum(cells[:-1], cells[1:])
        bends = self.bends[lower[:, 0], lower[:, 1], (moves[:, 0] != 0).astype(np.intp)]
        line = np.concatenate([np.stack([at[:-1], bends], axis=1).reshape(-1, 2), at[-1:]])
        numbers = np.arange(len(line)) // 2
        there = ~np.isnan(line[:, 0])
        line, numbers = line[there], numbers[there]
        kept = corners(line)
        return line[kept], numbers[kept]


def tool_steps(radius: float, tool: float) -> int:
    """Return the number of steps over pixels' edges from the robot's disc to the tool's rim.

    The number is for diagonal directions, which take most steps; 0 for a tool within the robot.

    Args:
        radius, tool: radii of robot and tool [pixels].
    """
    return math.ceil(math.sqrt(2.0) * (tool - radius)) if tool > radius else 0


def tool_reach(places: Bits, blocked: Bits, radius: float, tool: float) -> Bits:
    """Return the pixels that the tool reaches from places.

    Args:
        places, blocked: uint64 (rows, words), see ``kernels.floor.bits``.
        radius, tool: radii of robot and tool [pixels].
    """
    reached, free = within(places, tool), ~blocked
    steps = tool_steps(radius, tool)
    if not steps:
        return reached
    found = within(places, radius)
    for _ in range(steps):
        more = found | found << ONE | found >> ONE
        more[:, 1:] |= found[:, :-1] >> LAST
        more[:, :-1] |= found[:, 1:] << LAST
        more[1:] |= found[:-1]
        more[:-1] |= found[1:]
        found = more & free
    return found & reached


def states_of(stands: NDArray[np.float64], unknown: NDArray[np.bool_] | None) -> NDArray[np.uint8]:
    """Return the states of cells, uint8 (rows, cols): coverable where there is a stand.

    Args:
        stands: see ``StandLattice``.
        unknown: see ``StandLattice.where``; None for none.
    """
    states = np.full(stands.shape[:2], BLOCKED, np.uint8)
    if unknown is not None:
        np.copyto(states, np.uint8(UNKNOWN), where=unknown)
    np.copyto(states, np.uint8(COVERABLE), where=~np.isnan(stands[..., 0]))
    return states


def corners(line: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the indices of points that are neither repeated nor on a straight segment.

    Args:
        line: float64 (n, 2), n >= 1.

    Returns:
        int (m,), with the first and the last point.
    """
    new = np.concatenate([[True], (np.abs(np.diff(line, axis=0)) > 1e-9).any(axis=1)])
    numbers = np.flatnonzero(new)
    if len(numbers) < 3:
        return numbers
    there = line[numbers]
    before, behind = np.diff(there[:-1], axis=0), np.diff(there[1:], axis=0)
    across = before[:, 0] * behind[:, 1] - before[:, 1] * behind[:, 0]
    turns = (np.abs(across) > 1e-9) | ((before * behind).sum(axis=1) < 0.0)
    kept: NDArray[np.intp] = numbers[np.concatenate([[True], turns, [True]])]
    return kept


def straightened(line: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a line, float64 (n, 2), reduced to its ``corners``."""
    straight: NDArray[np.float64] = line[corners(line)]
    return straight


def _nearest_place(
    geometry: GridGeometry, places: NDArray[np.bool_], start: tuple[float, float], reach: float
) -> tuple[int, int]:
    col, row = geometry.to_pixels(*start)
    if not (0 <= row < geometry.rows and 0 <= col < geometry.cols):
        raise StartOutsideMap(
            f"the start ({start[0]:g}, {start[1]:g}) m is outside the map, {geometry.extent}"
        )
    found = np.argwhere(places)
    squares = ((found + 0.5 - np.array((row, col))) ** 2).sum(axis=1)
    if not len(found) or squares.min() > max(reach, 1.0) ** 2 + 1:
        raise StartBlocked(
            f"the robot does not fit at ({start[0]:g}, {start[1]:g}) m, nor within its radius of it"
        )
    i, j = found[np.argmin(squares)].tolist()
    return i, j
