"""Polisher: anneals the line ahead of the robot, a piece at a time.

The line just ahead of the robot stays as it is published; farther ahead it may still change.
"""

from __future__ import annotations

import numpy as np

from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.kernels.floor import line as kernel
from fasaco_edge.kernels.floor.anneal import anneal
from fasaco_edge.mission.line.line_ahead import LineAhead
from fasaco_edge.mission.line.polyline import POLISHED
from fasaco_edge.planners.line import SEED, LineConfig, linked, memory_for_moves, numbers_along
from fasaco_edge.planners.path import common_beginning

# Length of the line ahead of the robot that is fixed, published or not [m].
HELD_M = 0.5
# New pieces of the line come first, all of them, without a temperature: their length [m], and the
# moves for each, which bound a cycle of the loop.
NEW_M, MOST_MOVES = 6.0, 3000
# Then pieces ahead, from this distance on, or from the end of the held line: length of one [m], and
# number of them, taken in turn.
AHEAD_M, PIECE_M, PIECES = 2.0, 4.0, 2
# Moves for each of them; and, on a complete map, the temperature of the farthest piece, as a share
# of the full one.
MOVES, HOTTEST = 300, 0.3


class Polisher:
    """Anneals at given prices; effort is counted in moves, not in seconds."""

    def __init__(self, config: LineConfig) -> None:
        self._config = config
        self._memory = memory_for_moves()
        self._random = np.array([SEED], np.uint64)
        # Index of the piece to be annealed next.
        self._at = 0

    def polish(self, ahead: LineAhead, floor: FloorMap, held: int, *, is_settled: bool) -> None:
        """Anneal the next piece of the line.

        On a map that still grows (``is_settled`` is False) only moves at no loss are made: the
        floor that a lane was for may be swept by another lane meanwhile.

        Args:
            ahead: the line.
            floor: the floor under it.
            held: how many of its first points stay as they are.
            is_settled: whether the map is complete.
        """
        if self._config.price_s_m2 == 0.0 or len(ahead.line) < 3:
            return
        begin, lengths = ahead.line.first_below(POLISHED), ahead.lengths()
        if begin < len(lengths):
            first = max(int(np.searchsorted(lengths, HELD_M)), begin - 2, held - 1)
            last = max(int(np.searchsorted(lengths, lengths[begin] + NEW_M)), first + 2)
            end = self._anneal(ahead, floor, first, min(last, len(lengths) - 1), 0.0, MOST_MOVES)
            # The last point of the line is fixed.
            end += end >= len(ahead.line) - 1
            ahead.note_polished(min(begin, first), max(end, begin + 1))
            return
        # The beginning is random, too, so that joints do not stay in place.
        drawn = int(self._random[0] >> np.uint64(40)) / (1 << 24)
        held_m = float(lengths[min(max(held, 1), len(lengths)) - 1])
        begins_m = max(AHEAD_M, held_m) + (self._at + drawn) * PIECE_M
        self._at = (self._at + 1) % PIECES
        first = int(np.searchsorted(lengths, begins_m))
        last = max(int(np.searchsorted(lengths, begins_m + PIECE_M)), first + 4)
        heat = HOTTEST * begins_m / (AHEAD_M + (PIECES + 1) * PIECE_M) if is_settled else 0.0
        self._anneal(ahead, floor, first, min(last, len(lengths) - 1), heat, MOVES)

    def _anneal(
        self, ahead: LineAhead, floor: FloorMap, first: int, last: int, heat: float, most: int
    ) -> int:
        """Anneal from one point to another; return the new index of the last one."""
        # The turn at the first point counts.
        first = max(first - 1, 0)
        if last - first < 4:
            return last
        piece = ahead.line.part(first, last + 1)
        line = linked(piece.points, is_end_fixed=True)
        unit, discs, config = ahead.tally.unit_m, floor.discs, self._config
        radius, tool, clear = discs.radius_m / unit, discs.tool_m / 2 / unit, discs.clear_m / unit
        sweeps = ahead.tally.sweeps
        on = kernel.Floor(floor.blocked, floor.places, sweeps, radius, tool, clear)
        prices = config.prices(unit, discs.tool_m)
        anneal(line, on, prices, self._memory, self._random, 1, (heat, heat), most)
        points = line.points[numbers_along(line)]
        if np.array_equal(points, piece.points):
            return last
        begin = max(common_beginning(points, piece.points) - 1, 0)
        if not ahead.put(first + begin, last + 1, points[begin:]):
            return last
        return first + len(points) - 1
