"""Driven line: a walk over stands, polished for swept floor.

The objective is driving time plus a price for each reachable square metre that stays unswept.
Distances are timed at the robot's speed, turns by their angle.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.floor import Floor, StandLattice, straightened
from fasaco_edge.kernels.floor import line as kernel
from fasaco_edge.kernels.floor.anneal import anneal
from fasaco_edge.kernels.floor.detour import find_patches, sweep_patches
from fasaco_edge.kernels.floor.polish import polish
from fasaco_edge.kernels.floor.reorder import reorder
from fasaco_edge.kernels.floor.seconds import chain_s
from fasaco_edge.kernels.floor.sweeps import BLOCK, COLUMNS, NEVER, Scratch, Sweeps, sweep_edges
from fasaco_edge.kernels.floor.turning import Turning, proportional_turning
from fasaco_edge.kernels.lattice.polygons import BITS

# Greatest distance of floor from a segment that makes a detour to sweep it [m].
FARTHEST_M = 1.0
# Least connected unswept area that counts as a patch [m2].
PATCH_M2 = 0.04
# Share of the moves for the first descent, by long moves that gain much; additional moves for
# patches, as a share.
DESCENT_SHARE, PATCH_SHARE = 0.08, 0.12
# Limit on the moves per point of the walk, however much floor there is.
MOST_A_POINT = 2000
# Temperatures of the first stage; temperatures of each later stage, low enough for the line to keep
# its overall shape. Stages of doubled length are as good as one stage of their total length.
COOLED, REHEATED = (1.0, 0.0), (0.7, 0.0)
# If a share to sweep is requested, each stage scales the price of floor by the floor that the line
# left over AIMED of the floor that it may leave, to the power of 1.5, by at most MOST_CHANGE or its
# inverse. MOST_RAISED limits the price over its usual value.
AIMED, MOST_CHANGE, MOST_RAISED = 0.9, 4.0, 100.0
# Moves per point of the line after which its parts are reordered once.
MOVES_A_POINT = 48
# Limit on the moves between two pauses: about a quarter of a second.
MOVES_AT_ONCE = 1 << 17
# The line gives up its clearance for a strip of floor wider than this share of the tool's width.
# The strip is as wide as the tool in a niche or a passage, and as the clearance along a wall.
NEAR_SHARE = 0.2
# Default turn durations.
TURNING = proportional_turning(1.5)
# Seed of the random moves.
SEED = 0x9E3779B97F4A7C15
# Pixels that are counted at once.
CACHED = 1 << 17


@dataclass(frozen=True, slots=True)
class LineConfig:
    """Parameters of polishing a line.

    Attributes:
        price_s_m2: value of sweeping a square metre [s/m2]; 0 for no polish.
        speed_m_s: speed of the robot [m/s].
        turning: durations of turns on the spot.
        moves_m2: limit on the moves tried per reachable square metre.
        patch_s: at the end, patches are swept that take no longer than this [s].
        swept: share of the reachable floor to sweep in the least time; None to sweep the floor that
            is worth its time by ``price_s_m2``.
    """

    price_s_m2: float = 200.0
    speed_m_s: float = 0.25
    turning: Turning = TURNING
    moves_m2: int = 5000
    patch_s: float = 20.0
    swept: float | None = None

    def prices(self, unit_m: float, tool_m: float) -> kernel.Price:
        """Return the prices on a raster of pixels ``unit_m`` wide, for a tool ``tool_m`` wide."""
        return kernel.Price(
            drive_s=unit_m / self.speed_m_s,
            turning=self.turning,
            left_s=self.price_s_m2 * unit_m * unit_m,
            near_s=NEAR_SHARE * self.price_s_m2 * tool_m * unit_m,
        )

    def seconds(self, points: NDArray[np.float64], unit_m: float) -> float:
        """Return the time to drive along points, float64 (n, 2), in pixels ``unit_m`` wide [s]."""
        count = len(points)
        drive_s = unit_m / self.speed_m_s
        return float(chain_s(points, 0, count - 1, count, drive_s, self.turning)) if count else 0.0


LINES = {"quick": LineConfig(price_s_m2=45.0, patch_s=0.0), "thorough": LineConfig()}


@dataclass(frozen=True, slots=True, eq=False)
class DrivenLine:
    """A line to drive: straight segments between points.

    Attributes:
        xy: float64 (n, 2), read-only: x, y in the map frame [m].
        swept_m2, reachable_m2: swept and total reachable floor [m2], by pixels of its raster.
        seconds: time to drive it [s].
        tried: number of moves tried.
    """

    xy: NDArray[np.float64]
    swept_m2: float
    reachable_m2: float
    seconds: float
    tried: int

    def __post_init__(self) -> None:
        self.xy.flags.writeable = False

    def cost_s(self, price_s_m2: float) -> float:
        """Return the objective [s]: driving time, and ``price_s_m2`` for unswept floor."""
        return self.seconds + price_s_m2 * (self.reachable_m2 - self.swept_m2)


class LineSearch:
    """A running search for the line along a walk, in stages.

    Each later stage anneals the line again, twice as long as the previous one. The search keeps the
    line of the least cost, so a longer search along the same walk is never worse. If a share of the
    floor is requested, it keeps the fastest line that sweeps this share; without such a line, the
    line that sweeps most. Each stage then adapts the price of floor.

    Attributes:
        best: the line kept; None until the first stage is over, or ``keep`` is called in it.
        stages: number of stages that are over.
    """

    def __init__(
        self,
        walk: NDArray[np.int32],
        stands: StandLattice,
        floor: Floor,
        config: LineConfig,
        *,
        is_end_fixed: bool,
    ) -> None:
        self.best: DrivenLine | None = None
        self.stages = 0
        self._floor, self._config = floor, config
        unit, tool_m = floor.geometry.resolution, floor.discs.tool_m
        points = stands.points(walk)
        self._has_moves = config.price_s_m2 > 0.0 and len(points) > 1
        if len(points) == 1:
            points = points[[0, 0]]
        self._sweeps, self._memory = _sweeps(floor), memory_for_moves()
        edges = np.concatenate([points[:-1], points[1:]], axis=1)
        tool = tool_m / 2 / unit
        sweep_edges(self._sweeps, edges, tool, 1, self._memory.capsules)
        blocks = self._sweeps.left.shape
        self._line = linked(points, blocks, is_end_fixed=is_end_fixed)
        self._price = self._least_price = config.prices(unit, tool_m)
        radius, clear = floor.discs.radius_m / unit, floor.discs.clear_m / unit
        self._on = kernel.Floor(floor.blocked, floor.places, self._sweeps, radius, tool, clear)
        self._moves = min(int(config.moves_m2 * floor.reachable_m2), MOST_A_POINT * len(points))
        self._random = np.array([SEED], np.uint64)

    def run(self) -> Iterator[None]:
        """Search without end; pause after each piece of work. To be called once."""
        if not self._has_moves:
            self.keep()
            yield
            return
        moves = self._moves
        farthest = FARTHEST_M / self._floor.geometry.resolution
        line, on, memory = self._line, self._on, self._memory
        polish(line, on, self._price, memory, farthest, int(DESCENT_SHARE * moves))
        yield from self._stage(COOLED, moves - int(line.state[kernel.TRIED]))
        while True:
            self._adapt_price()
            yield from self._stage(REHEATED, moves)
            moves *= 2

    def _stage(self, heat: tuple[float, float], moves: int) -> Iterator[None]:
        """Anneal the line, sweep the patches that are left, and keep the result if it is better."""
        line, on, memory = self._line, self._on, self._memory
        first, last = heat
        begun = reordered = int(line.state[kernel.TRIED])
        per_pass = MOVES_A_POINT * len(numbers_along(line))
        pieces = max(moves // min(per_pass, MOVES_AT_ONCE), 1)
        for piece in range(pieces):
            if piece:
                yield
            per_piece = (last - first) / pieces
            between = first + per_piece * piece, first + per_piece * (piece + 1)
            until = begun + moves * (piece + 1) // pieces
            anneal(line, on, self._price, memory, self._random, 0, between, until)
            if until - reordered >= per_pass or piece == pieces - 1:
                reorder(line, on, self._price, memory, self._random)
                reordered = until
        unit = self._floor.geometry.resolution
        patch = self._price._replace(left_s=self._config.patch_s / PATCH_M2 * unit * unit)
        if patch.left_s > self._price.left_s:
            most = int(line.state[kernel.TRIED]) + int(PATCH_SHARE * self._moves)
            patches = find_patches(self._sweeps, math.ceil(PATCH_M2 / (unit * unit)))
            sweep_patches(line, on, patch, memory, FARTHEST_M / unit, patches, most)
        self.keep()
        self.stages += 1
        yield

    def _adapt_price(self) -> None:
        """Change the price of floor so that the next line sweeps little more than requested."""
        if self._config.swept is None:
            return
        reachable_m2 = self._floor.reachable_m2
        may_leave_m2 = AIMED * (1.0 - self._config.swept) * reachable_m2
        change = MOST_CHANGE
        if may_leave_m2 > 0.0:
            excess = (reachable_m2 - self._swept_m2()) / may_leave_m2
            change = excess * math.sqrt(excess)  # exact on all machines, unlike a power
        least_s, left_s = self._least_price.left_s, self._price.left_s
        left_s *= min(max(change, 1.0 / MOST_CHANGE), MOST_CHANGE)
        self._price = self._price._replace(left_s=min(max(left_s, least_s), MOST_RAISED * least_s))

    def _swept_m2(self) -> float:
        unit = self._floor.geometry.resolution
        return self._floor.reachable_m2 - int(np.count_nonzero(self._sweeps.counts == 0)) * unit**2

    def _missing_m2(self, swept_m2: float) -> float:
        """Return the floor missing from the requested share [m2]; 0 without a requested share."""
        least = self._config.swept or 0.0
        return max(least * self._floor.reachable_m2 - swept_m2, 0.0)

    def keep(self) -> None:
        """Keep the present line if it is better than the kept line; also within a stage."""
        points = straightened(self._line.points[numbers_along(self._line)])
        seconds = self._config.seconds(points, self._floor.geometry.resolution)
        xy, tried = self._floor.to_map(points), int(self._line.state[kernel.TRIED])
        line = DrivenLine(xy, self._swept_m2(), self._floor.reachable_m2, seconds, tried)
        if self.best is None or self._rank(line) < self._rank(self.best):
            self.best = line

    def _rank(self, line: DrivenLine) -> tuple[float, float]:
        price = 0.0 if self._config.swept is not None else self._config.price_s_m2
        return self._missing_m2(line.swept_m2), line.cost_s(price)


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
    # Number of rows that fit in a cache; a byte holds a row of a block.
    rows = max(CACHED // (side * counts.shape[1]), 1)
    for first in range(0, len(left), rows):
        part = counts[side * first : side * (first + rows)]
        in_rows = BITS.take(np.packbits(part == 0, axis=1))
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


def memory_for_moves() -> kernel.MoveMemory:
    """Return working memory of the kernels."""

    def points(count: int) -> NDArray[np.float64]:
        return np.zeros((count, 2))

    def stretches() -> NDArray[np.int64]:
        return np.zeros((kernel.MOST_CAPSULES, 2), np.int64)

    return kernel.MoveMemory(
        before=points(kernel.MOST_CHAIN),
        after=points(kernel.MOST_CHAIN),
        new=points(kernel.MOST_NEW),
        best=points(kernel.MOST_NEW),
        place=np.zeros(2),
        capsules=Scratch(np.zeros((kernel.MOST_CAPSULES, len(COLUMNS))), stretches(), stretches()),
    )
