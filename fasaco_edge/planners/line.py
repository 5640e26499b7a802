"""Driven line: a walk over stands, polished for swept floor.

The objective is driving time plus a price for each reachable square metre that stays unswept.
Distances are timed at the robot's speed, turns by their angle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.floor import Floor, StandLattice, straightened
from fasaco_edge.kernels.floor import line as kernel
from fasaco_edge.kernels.floor.anneal import anneal
from fasaco_edge.kernels.floor.detour import find_patches, sweep_patches
from fasaco_edge.kernels.floor.polish import polish
from fasaco_edge.kernels.floor.sweeps import (
    BLOCK,
    COLUMNS,
    NEVER,
    Scratch,
    Sweeps,
    sweep_edges,
)
from fasaco_edge.kernels.floor.turning import Turning, proportional_turning

# Floor farther from an edge than this causes no detour of that edge [m].
FARTHEST_M = 1.0
# Least connected unswept area that counts as a patch [m2].
PATCH_M2 = 0.04
# Shares of all moves: descent comes first, with long moves that gain much; patches have moves of
# their own.
DESCENT_SHARE, PATCH_SHARE = 0.08, 0.12
# Limit on the moves per point of the walk, however much floor there is.
MOST_A_POINT = 2000
# From the highest temperature to zero.
COOLED = (1.0, 0.0)
# Clearance is given up along a strip of floor that is wider than this share of the tool's width. A
# niche or a passage gains the whole width; a wall gains the clearance alone.
NEAR_SHARE = 0.2
# Default turn durations.
TURNING = proportional_turning(1.5)
# Seed of the random moves.
SEED = 0x9E3779B97F4A7C15
# Pixels that are counted at once.
CACHED = 1 << 17
# Number of ones in a byte.
_ONES = np.unpackbits(np.arange(256, dtype=np.uint8)[:, None], axis=1).sum(axis=1, dtype=np.uint8)


@dataclass(frozen=True, slots=True)
class LineConfig:
    """Parameters of polishing a line.

    Attributes:
        price_s_m2: value of sweeping a square metre [s/m2]; 0 for no polish.
        speed_m_s: speed of the robot [m/s].
        turning: durations of turns on the spot.
        moves_m2: limit on the moves tried per reachable square metre.
        patch_s: at the end, patches are swept that take no longer than this [s].
    """

    price_s_m2: float = 200.0
    speed_m_s: float = 0.25
    turning: Turning = TURNING
    moves_m2: int = 5000
    patch_s: float = 20.0

    def prices(self, unit_m: float, tool_m: float) -> kernel.Price:
        """Return the prices on a raster of pixels ``unit_m`` wide, for a tool ``tool_m`` wide."""
        return kernel.Price(
            drive_s=unit_m / self.speed_m_s,
            turning=self.turning,
            left_s=self.price_s_m2 * unit_m * unit_m,
            near_s=NEAR_SHARE * self.price_s_m2 * tool_m * unit_m,
        )


LINES = {"quick": LineConfig(price_s_m2=45.0, patch_s=0.0), "thorough": LineConfig()}


@dataclass(frozen=True, slots=True, eq=False)
class DrivenLine:
    """A line to drive: straight segments between points.

    Attributes:
        xy: float64 (n, 2), read-only: x, y in the map frame [m].
        swept_m2, reachable_m2: swept and total reachable floor [m2], by pixels of its raster.
        tried: number of moves tried.
    """

    xy: NDArray[np.float64]
    swept_m2: float
    reachable_m2: float
    tried: int

    def __post_init__(self) -> None:
        self.xy.flags.writeable = False


def line_over(
    walk: NDArray[np.int32],
    stands: StandLattice,
    floor: Floor,
    config: LineConfig,
    *,
    is_end_fixed: bool,
) -> DrivenLine:
    """Return the polished line along a walk.

    Args:
        walk: int32 (n, 2), cells (row, col), each a step from the previous one.
        stands: the lattice of the walk.
        floor: the floor to sweep.
        config: prices.
        is_end_fixed: whether the line must end where the walk does.
    """
    points = stands.points(walk)
    sweeps = _sweeps(floor)
    unit = floor.geometry.resolution
    tool = floor.discs.tool_m / 2 / unit
    memory = memory_for_moves()
    along = points if len(points) > 1 else points[[0, 0]]
    edges = np.concatenate([along[:-1], along[1:]], axis=1)
    sweep_edges(sweeps, edges, tool, 1, memory.capsules)
    tried = 0
    if config.price_s_m2 > 0.0 and len(points) > 1:
        line = linked(points, sweeps.left.shape, is_end_fixed=is_end_fixed)
        price = config.prices(unit, floor.discs.tool_m)
        radius, clear = floor.discs.radius_m / unit, floor.discs.clear_m / unit
        on = kernel.Floor(floor.blocked, floor.places, sweeps, radius, tool, clear)
        most = min(int(config.moves_m2 * floor.reachable_m2), MOST_A_POINT * len(points))
        farthest = FARTHEST_M / unit
        polish(line, on, price, memory, farthest, int(DESCENT_SHARE * most))
        anneal(line, on, price, memory, np.array([SEED], np.uint64), 0, COOLED, most)
        patch = price._replace(left_s=config.patch_s / PATCH_M2 * unit * unit)
        if patch.left_s > price.left_s:
            most += int(PATCH_SHARE * most)
            patches = find_patches(sweeps, math.ceil(PATCH_M2 / (unit * unit)))
            sweep_patches(line, on, patch, memory, farthest, patches, most)
        points = straightened(line.points[numbers_along(line)])
        tried = int(line.state[kernel.TRIED])
    left = int(np.count_nonzero(sweeps.counts == 0)) * unit * unit
    return DrivenLine(floor.to_map(points), floor.reachable_m2 - left, floor.reachable_m2, tried)


def _sweeps(floor: Floor) -> Sweeps:
    counts = np.where(floor.reachable, 0, NEVER).astype(np.int16)
    return Sweeps(counts, left_in_blocks(counts))


def blocks_of(shape: tuple[int, ...]) -> tuple[int, int]:
    """Return the number of blocks (rows, cols) of a raster of a shape."""
    rows, cols = shape
    return (rows - 1 >> BLOCK) + 1, (cols - 1 >> BLOCK) + 1


def left_in_blocks(counts: NDArray[np.int16]) -> NDArray[np.int32]:
    """Return the number of unswept pixels in each block, of sweep counts (rows, cols)."""
    left = np.empty(blocks_of(counts.shape), np.int32)
    side = 1 << BLOCK
    # As many rows at once as fit in a cache; a byte has the pixels of a row of a block.
    rows = max(CACHED // (side * counts.shape[1]), 1)
    for first in range(0, len(left), rows):
        part = counts[side * first : side * (first + rows)]
        in_rows = _ONES.take(np.packbits(part == 0, axis=1))
        begins = np.arange(0, len(part), side)
        left[first : first + rows] = np.add.reduceat(in_rows, begins, axis=0, dtype=np.uint8)
    return left


def linked(
    points: NDArray[np.float64], blocks: tuple[int, ...], *, is_end_fixed: bool
) -> kernel.Line:
    """Return points, float64 (n, 2), as a kernel line, with blocks (rows, cols)."""
    count = len(points)
    capacity = 3 * count + 4096
    room = np.zeros((capacity, 2))
    room[:count] = points
    following, previous = (np.full(capacity, kernel.NONE, np.int32) for _ in range(2))
    following[: count - 1] = np.arange(1, count)
    previous[1:count] = np.arange(count - 1)
    seen = np.zeros(capacity, np.int64)
    state = np.array([count, 0, 0, kernel.NONE], np.int64)
    changed = np.zeros(blocks, np.int64)
    return kernel.Line(room, following, previous, seen, changed, state, is_end_fixed)


def numbers_along(line: kernel.Line) -> list[int]:
    """Return the indices of a line's points in order."""
    numbers = [0]
    while (number := int(line.next[numbers[-1]])) != kernel.NONE:
        numbers.append(number)
    return numbers


def memory_for_moves() -> kernel.Memory:
    """Return working memory of the kernels."""

    def points(count: int) -> NDArray[np.float64]:
        return np.zeros((count, 2))

    def stretches() -> NDArray[np.int64]:
        return np.zeros((kernel.MOST_CAPSULES, 2), np.int64)

    return kernel.Memory(
        before=points(kernel.MOST_CHAIN),
        after=points(kernel.MOST_CHAIN),
        new=points(kernel.MOST_NEW),
        best=points(kernel.MOST_NEW),
        place=np.zeros(2),
        capsules=Scratch(np.zeros((kernel.MOST_CAPSULES, len(COLUMNS))), stretches(), stretches()),
    )
