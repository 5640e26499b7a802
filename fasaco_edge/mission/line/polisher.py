"""Polisher: local search and annealing of the line ahead of the robot, a piece at a time.

The line just ahead of the robot stays as it is published; farther ahead it may still change.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.kernels.floor import line as kernel
from fasaco_edge.kernels.floor.anneal import anneal
from fasaco_edge.kernels.floor.polish import polish
from fasaco_edge.mission.line.line_ahead import LineAhead
from fasaco_edge.mission.line.polyline import MOVED, POLISHED, Polyline
from fasaco_edge.planners.line import (
    FARTHEST_M,
    SEED,
    LineConfig,
    linked,
    memory_for_moves,
    numbers_along,
)
from fasaco_edge.planners.path import common_beginning

# Length of the line ahead of the robot that is fixed, published or not [m].
HELD_M = 0.5
# First pass: points are moved along the whole line, in pieces of this length [m].
MOVED_M = 6.0
# Second pass: detours to unswept floor, up to AHEAD_M ahead, in pieces of PIECE_M [m]. It begins
# once all points are moved, but within NEAR_M at once. Farther ahead the map of an exploring robot
# may still grow.
NEAR_M, AHEAD_M, PIECE_M = 5.0, 8.0, 4.0
# Third pass: annealing of ANNEALED_PIECES pieces in turn, each ANNEALED_PIECE_M long [m]. They
# begin ANNEALED_M ahead, or at the end of the held line if that is farther.
ANNEALED_M, ANNEALED_PIECE_M, ANNEALED_PIECES = 2.0, 4.0, 2
# ANNEAL_MOVES are made for each piece. HOTTEST is the temperature of the farthest piece on a
# complete map, as a share of the full temperature.
ANNEAL_MOVES, HOTTEST = 300, 0.3
# Length of the line ahead that the second and third pass include [m].
SEEN_M = 20.0
# Limit on the moves per call, which bounds a cycle of the loop.
MOST_MOVES = 3000
# A limit on the length of detours that excludes all of them.
NO_DETOURS = -1e6


class Polisher:
    """Polishes at given prices; effort is counted in moves, not in seconds."""

    def __init__(self, config: LineConfig) -> None:
        self._config = config
        self._factor = 1.0
        self._memory = memory_for_moves()
        self._random = np.array([SEED], np.uint64)
        # Index of the piece to be annealed next.
        self._at = 0

    def polish(
        self, ahead: LineAhead, floor: FloorMap, held: int, factor: float, *, is_settled: bool
    ) -> None:
        """Polish the next piece of the line.

        On a map that still grows (``is_settled`` is False) annealing accepts only moves without a
        loss. Such moves drop detours to floor that another lane sweeps meanwhile.

        Args:
            ahead: the line.
            floor: the floor under it.
            held: how many of its first points stay as they are.
            factor: factor on the price of floor.
            is_settled: whether the map is complete.
        """
        if self._config.price_s_m2 == 0.0 or len(ahead.line) < 3:
            return
        self._factor = factor
        begin = ahead.line.first_below(MOVED)
        if begin < len(ahead.line):
            lengths = ahead.lengths()
            begins_m = lengths[begin]
            first, last = _piece(lengths, begin, MOVED_M, held)
            last = max(min(last, ahead.line.raw_until(begin) + 1, len(lengths) - 1), first)
            end = self._polish(ahead, floor, first, last, lengths, NO_DETOURS)
            # The last point of the line is fixed.
            end += end >= len(ahead.line) - 1
            ahead.mark(min(begin, first), max(end, begin + 1), MOVED)
            is_all = ahead.line.first_below(MOVED) == len(ahead.line)
            if is_all or begins_m > NEAR_M:
                return
        lengths = ahead.lengths(SEEN_M)
        begin = ahead.line.first_below(POLISHED)
        if begin >= len(lengths) - 1 or lengths[begin] > AHEAD_M:
            self._anneal(ahead, floor, lengths, held, HOTTEST if is_settled else 0.0)
            return
        first, last = _piece(lengths, begin, PIECE_M, held)
        farthest = FARTHEST_M / ahead.tally.unit_m
        end = self._polish(ahead, floor, first, last, lengths, farthest)
        ahead.mark(min(begin, first), max(end, begin + 1), POLISHED)

    def _anneal(
        self,
        ahead: LineAhead,
        floor: FloorMap,
        lengths: NDArray[np.float64],
        held: int,
        hottest: float,
    ) -> None:
        """Anneal the next piece; the temperature rises with its distance from the robot."""
        # The beginning is random, too, so that joints do not stay in place.
        drawn = int(self._random[0] >> np.uint64(40)) / (1 << 24)
        held_m = float(lengths[min(max(held, 1), len(lengths)) - 1])
        begins_m = max(ANNEALED_M, held_m) + (self._at + drawn) * ANNEALED_PIECE_M
        self._at = (self._at + 1) % ANNEALED_PIECES
        first = max(int(np.searchsorted(lengths, begins_m)), 2)
        last = int(np.searchsorted(lengths, begins_m + ANNEALED_PIECE_M))
        last = min(max(last, first + 4), len(lengths) - 1)
        if last - first < 4:
            return
        heat = hottest * begins_m / (ANNEALED_M + (ANNEALED_PIECES + 1) * ANNEALED_PIECE_M)
        first -= 1  # the turn at the first point counts
        piece = ahead.line.part(first, last + 1)
        line = linked(piece.points, ahead.tally.sweeps.left.shape, is_end_fixed=True)
        on, prices = self._on(ahead, floor)
        memory, random = self._memory, self._random
        anneal(line, on, prices, memory, random, 1, (heat, heat), ANNEAL_MOVES)
        self._put(ahead, first, last, piece, line)

    def _on(self, ahead: LineAhead, floor: FloorMap) -> tuple[kernel.Floor, kernel.Price]:
        unit = ahead.tally.unit_m
        radius, tool = floor.discs.radius_m / unit, floor.discs.tool_m / 2 / unit
        clear = floor.discs.clear_m / unit
        on = kernel.Floor(floor.blocked, floor.places, ahead.tally.sweeps, radius, tool, clear)
        prices = self._config.prices(unit, floor.discs.tool_m)
        return on, prices._replace(left_s=self._factor * prices.left_s)

    def _put(
        self, ahead: LineAhead, first: int, last: int, piece: Polyline, line: kernel.Line
    ) -> int:
        """Replace a piece by its polished version; return the new index of its last point."""
        points = line.points[numbers_along(line)]
        if np.array_equal(points, piece.points):
            return last
        begin = max(common_beginning(points, piece.points) - 1, 0)
        ahead.put(first + begin, last + 1, points[begin:])
        return first + len(points) - 1

    def _polish(
        self,
        ahead: LineAhead,
        floor: FloorMap,
        first: int,
        last: int,
        lengths: NDArray[np.float64],
        farthest: float,
    ) -> int:
        if last - first < 2:
            return last
        piece = ahead.line.part(first, last + 1)
        line = linked(piece.points, ahead.tally.sweeps.left.shape, is_end_fixed=True)
        on, prices = self._on(ahead, floor)
        area_m2 = float(lengths[last] - lengths[first]) * floor.discs.tool_m
        most = min(int(self._config.moves_m2 * area_m2), MOST_MOVES)
        if polish(line, on, prices, self._memory, farthest, most) <= 0.0:
            return last
        return self._put(ahead, first, last, piece, line)


def _piece(lengths: NDArray[np.float64], begin: int, piece_m: float, held: int) -> tuple[int, int]:
    """Return the range of points of the piece that begins at ``begin``; its first point stays."""
    begin = min(begin, len(lengths) - 1)
    first = max(int(np.searchsorted(lengths, HELD_M)), begin - 2, held - 1)
    last = int(np.searchsorted(lengths, lengths[begin] + piece_m))
    return first, min(max(last, first + 2), len(lengths) - 1)
