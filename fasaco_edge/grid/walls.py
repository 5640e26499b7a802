"""Wall direction: the angle of a building's walls on its map.

Cells of the coverage lattice are aligned with the map frame. If walls are at an angle to it, each
lane meets them obliquely. If the map is rotated back by that angle, cells are aligned with walls.

Method: a histogram of gradient directions, used by O'Gorman and Clowes (1976) to find straight
edges. Each edge between a free and an occupied pixel contributes a unit vector across it. Smoothed
vectors are normal to the wall. Rotated by quarter-turns into one quadrant, most of them have nearly
the direction of most walls: the peak of the histogram. The sum of the vectors around the peak gives
the angle: along a straight wall of stepped pixels, vectors add up to its normal. All machines find
the same angle, because sums are of integers.

Source: F. O'Gorman, M. B. Clowes, "Finding picture edges through collinearity of feature points",
IEEE Transactions on Computers C-25(4), 1976. Deviation: only directions vote, not lines.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry
from fasaco_edge.grid.occupancy import OccupancyGrid, highest
from fasaco_edge.kernels.lattice.footprint import Thresholds

THRESHOLDS = Thresholds(free=25, occupied=65)

# Approximate edge to which finer pixels are joined [m]: they show a scanner's noise.
UNIT_M = 0.05
# Edge of the tiles that are processed at once [joined pixels].
TILE = 512

# Smoothing: along each axis, sums of pixels at these distances; standard deviation 2.6 pixels.
SHIFTS = (1, 1, 2, 2, 3, 3)
# The sum of all contributions of one pixel edge.
EDGE = 2 * 4 ** len(SHIFTS)
# Radius of the smoothing [joined pixels].
REACH = sum(SHIFTS) + 1
# Threshold on the square of a voting vector; along a straight wall vectors reach 0.15 of EDGE.
LEAST_SQUARE = (EDGE // 128) ** 2

# Bins of the histogram per quarter-turn; half-width of a peak, and of the sum for the angle [bins].
# The sum takes in vectors at the steps of a wall nearly parallel to the pixels, which deviate by up
# to 9 degrees.
BINS, PEAK, AROUND = 180, 14, 20
MOST_ROUNDS = 8

# Least share of all wall in a direction (0.16 if directions are uniform), and least length [m].
LEAST_SHARE, LEAST_WALL_M = 0.3, 2.0
# Another direction replaces the map frame's axes if it has this many times as much wall.
BETTER = 1.25
# Walls within this angle of the pixels' axes are parallel to them [deg]. Likewise walls near 45
# degrees are at 45 degrees, so that nearly equal maps do not rotate by 45 and by -45 degrees.
NEAR_DEG = 0.3
# Least useful rotation [deg]. For walls at 1 degree, rotation saves no time, but leaves only a
# seventh of the unswept patches; for walls at 2 degrees or more it also saves time.
LEAST_ROTATION_DEG = 0.5


@dataclass(frozen=True, slots=True)
class WallDirection:
    """The direction of most walls of a building.

    Attributes:
        angle_deg: angle of the walls to the axes of the map frame, in (-45, 45] [deg].
        share: share of all wall that is within 7 degrees of this angle.
        wall_m: length of the wall in this share [m], of both sides; a wall one pixel thick between
            free pixels counts for 0.3 of its length, as vectors cancel out.
        is_of_rim: whether the map marks few walls, and the border of free space was used instead.
    """

    angle_deg: float
    share: float
    wall_m: float
    is_of_rim: bool = False

    @property
    def rotation_deg(self) -> float:
        """The lattice rotation for these walls: 0 if it would gain nothing [deg]."""
        return self.angle_deg if abs(self.angle_deg) >= LEAST_ROTATION_DEG else 0.0


def wall_direction(grid: OccupancyGrid) -> WallDirection | None:
    """Return the direction of most walls of a map; None if there are few, or none is straight.

    A wall is an edge between free and occupied pixels. On a map with few such edges, such as a map
    of free space only, a wall is any edge of free space.
    """
    votes = _Votes.of(grid)
    if is_of_rim := votes.rim > 4 * votes.edges:
        votes = _Votes.of(grid, is_rim_wall=True)
    yaw_deg = math.degrees(grid.geometry.origin.yaw)
    peak = votes.peak(_folded(-yaw_deg))
    if peak is None:
        return None
    wall_m = peak.length / EDGE * grid.geometry.resolution * _parts(grid.geometry)
    if peak.share < LEAST_SHARE or wall_m < LEAST_WALL_M:
        return None
    # The votes are relative to the axes of the pixels: add the yaw of a rotated map.
    own_deg = 0.0 if abs(peak.angle_deg) < NEAR_DEG else peak.angle_deg
    angle_deg = _folded(own_deg + yaw_deg)
    if abs(angle_deg) > 45.0 - NEAR_DEG:
        angle_deg = 45.0
    return WallDirection(angle_deg, round(peak.share, 3), round(wall_m, 1), is_of_rim)


@dataclass(frozen=True, slots=True)
class _Peak:
    """A direction: its angle to the pixels' axes [deg], its share, and its vectors' length."""

    angle_deg: float
    share: float
    length: int


@dataclass(frozen=True, slots=True, eq=False)
class _Votes:
    """The vectors across the walls of a map, by direction.

    Attributes:
        sums: int64 (3, BINS): for each bin the sums of the vectors' lengths, x and y. Vectors are
            first rotated by quarter-turns into the directions from -45 to 45 degrees.
        edges, rim: number of free pixels' sides beside a wall, and beside an unknown pixel.
    """

    sums: NDArray[np.int64]
    edges: int
    rim: int

    @classmethod
    def of(cls, grid: OccupancyGrid, *, is_rim_wall: bool = False) -> _Votes:
        """Return the votes of a map; ``is_rim_wall``: whether all that is not free is wall."""
        sums, edges, rim = np.zeros((3, 4 * BINS), np.int64), 0, 0
        for values in _tiles(grid):
            if is_rim_wall:
                values[values == _UNKNOWN] = _WALL
            steps = np.diff(values, axis=1), np.diff(values, axis=0)
            east, north = (_across(step) for step in steps)
            here = int(np.count_nonzero(east)) + int(np.count_nonzero(north))
            edges += here
            rim += sum(int(np.count_nonzero(np.abs(step) == _TO_UNKNOWN)) for step in steps)
            if here:
                _vote(east, north, sums)
        lengths, x, y = sums.reshape(3, 4, BINS)
        turned_x, turned_y = x[0] + y[1] - x[2] - y[3], y[0] - x[1] - y[2] + x[3]
        return cls(np.stack([lengths.sum(axis=0), turned_x, turned_y]), edges, rim)

    def peak(self, axes_deg: float) -> _Peak | None:
        """Return the direction of most walls; None without walls.

        ``axes_deg`` [deg] is preferred unless another direction has ``BETTER`` times as much wall.
        """
        lengths, x, y = self.sums
        total = int(lengths.sum())
        if not total:
            return None
        # Bins continue below and above, rotated by a quarter-turn.
        length, sum_x, sum_y = (
            _added_up(np.concatenate(parts), half)[BINS : 2 * BINS]
            for parts, half in (
                ((lengths, lengths, lengths), PEAK),
                ((y, x, -y), AROUND),
                ((-x, y, x), AROUND),
            )
        )
        at, axes = int(np.argmax(length)), _bin_at(axes_deg)
        if BETTER * int(length[axes]) >= int(length[at]):
            at = axes
        for _ in range(MOST_ROUNDS):
            angle_deg = math.degrees(math.atan2(int(sum_y[at]), int(sum_x[at])))
            before, at = at, _bin_at(angle_deg)
            if at == before:
                break
        found = int(length[at])
        return _Peak(round(angle_deg, 1), found / total, found)


# Kinds of pixels, and their differences from a free pixel.
_UNKNOWN, _FREE, _WALL = 0, 1, 3
_TO_UNKNOWN, _TO_WALL = 1, 2


def _tiles(grid: OccupancyGrid) -> Iterator[NDArray[np.int8]]:
    """Yield the kinds of joined pixels, int8, tile by tile; tiles without free pixels are skipped.

    A tile includes a margin of REACH.
    """
    parts = _parts(grid.geometry)
    size, reach = TILE * parts, REACH * parts
    rows, cols = (-(-(pixels + reach) // parts) * parts for pixels in grid.cells.shape)
    for row in range(0, rows, size):
        for col in range(0, cols, size):
            top, left = row - reach, col - reach
            bottom, right = min(row + size, rows), min(col + size, cols)
            cells = grid.cells[max(top, 0) : bottom, max(left, 0) : right]
            free = (cells >= 0) & (cells <= THRESHOLDS.free)
            if not free.any():
                continue
            values = np.full((bottom - top, right - left), _UNKNOWN, np.int8)
            here = values[max(-top, 0) :, max(-left, 0) :][: cells.shape[0], : cells.shape[1]]
            here[free] = _FREE
            here[cells >= THRESHOLDS.occupied] = _WALL
            # A joined pixel is wall if any part is wall; otherwise free if any part is free.
            yield highest(values, parts)


def _across(steps: NDArray[np.int8]) -> NDArray[np.int16]:
    """Return 1 where a step leads from free to wall, -1 from wall to free, else 0."""
    signs: NDArray[np.int16] = (steps == _TO_WALL).astype(np.int16)
    signs -= steps == -_TO_WALL
    return signs


def _vote(east: NDArray[np.int16], north: NDArray[np.int16], sums: NDArray[np.int64]) -> None:
    """Add a tile's vectors to ``sums``, int64 (3, 4 * BINS), by direction in a full circle."""
    # A step lies between two pixels; sums of two steps, east and north, lie at the same corners.
    x = _smoothed(east[1:] + east[:-1])
    y = _smoothed(north[:, 1:] + north[:, :-1])
    squares = x.astype(np.int32) ** 2 + y.astype(np.int32) ** 2
    kept = np.flatnonzero(squares >= LEAST_SQUARE)
    x, y, squares = x.ravel()[kept], y.ravel()[kept], squares.ravel()[kept]
    # Rounding moves no vector to another bin: bins end at odd multiples of a quarter-degree, whose
    # tangents are irrational, and not near any y / x of such small integers.
    degrees = np.degrees(np.arctan2(y, x, dtype=np.float64))
    bins = np.floor((degrees + 45.0) * (BINS / 90) + 0.5).astype(np.intp) % (4 * BINS)
    for kind, values in enumerate((np.rint(np.sqrt(squares)), x, y)):
        sums[kind] += np.bincount(bins, values, 4 * BINS).astype(np.int64)


def _smoothed(values: NDArray[np.int16]) -> NDArray[np.int16]:
    smooth: NDArray[np.int16] = values
    for shift in SHIFTS:
        smooth = smooth[shift:] + smooth[:-shift]
        smooth = smooth[:, shift:] + smooth[:, :-shift]
    return smooth


def _added_up(values: NDArray[np.int64], half: int) -> NDArray[np.int64]:
    """Return the sum of each value and ``half`` values on each side; 0 near the ends."""
    sums = np.zeros_like(values)
    before = np.concatenate([[0], np.cumsum(values)])
    sums[half : len(values) - half] = before[2 * half + 1 :] - before[: -2 * half - 1]
    return sums


def _bin_at(angle_deg: float) -> int:
    return round((angle_deg + 45.0) * (BINS / 90)) % BINS


def _parts(geometry: GridGeometry) -> int:
    """Return the number of pixels joined along each axis."""
    return max(1, round(UNIT_M / geometry.resolution))


def _folded(angle_deg: float) -> float:
    """Return an angle modulo quarter-turns, in (-45, 45]."""
    return angle_deg - 90.0 * math.ceil((angle_deg - 45.0) / 90.0)
