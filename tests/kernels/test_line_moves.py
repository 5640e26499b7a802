"""Moves of the driven line: what they say to gain is what a slow count shows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest

from fasaco_edge.kernels.floor import line as kernel
from fasaco_edge.kernels.floor.anneal import anneal
from fasaco_edge.kernels.floor.bits import packed, unpacked
from fasaco_edge.kernels.floor.capsule import TOUCH
from fasaco_edge.kernels.floor.line import PIECE
from fasaco_edge.kernels.floor.sweeps import NEVER, Sweeps, sweep
from fasaco_edge.kernels.floor.turning import (
    Turning,
    limited_turning,
    proportional_turning,
    turn_seconds,
)
from fasaco_edge.planners.line import linked, memory_for_moves, numbers_along

ROWS, COLS = 72, 96
ROBOT, TOOL = 7.2, 6.0
# By their angle; and by limits, which make each bend a stop.
TURNINGS = proportional_turning(1.5), limited_turning(100.0, 180.0, 0.25, 0.5, 1.0)
# Three lanes, and one that leaves much beside it.
WAY = [(10, 10), (10, 85), (20, 85), (20, 10), (30, 10), (30, 85), (37, 10), (62, 10)]


class Room:
    """A room with a pillar, and lanes through it."""

    def __init__(
        self,
        turning: Turning = TURNINGS[0],
        *,
        is_end_fixed: bool = False,
        clear: float = ROBOT,
        way: Sequence[tuple[float, float]] = WAY,
    ) -> None:
        self.price = kernel.Price(drive_s=0.1, turning=turning, left_s=0.11, near_s=0.3)
        free = np.zeros((ROWS, COLS), np.bool_)
        free[2:-2, 2:-2] = True
        free[50:54, 60:64] = False
        blocked = packed(~free, beyond=True)
        inner = np.zeros_like(free)
        inner[10:62, 10:86] = True
        places = packed(inner, beyond=False)
        counts = np.where(free, 0, NEVER).astype(np.int16)
        left = (counts == 0).reshape(ROWS // 8, 8, COLS // 8, 8).sum(axis=(1, 3)).astype(np.int32)
        self.floor = kernel.Floor(blocked, places, Sweeps(counts, left), ROBOT, TOOL, clear)
        self.memory = memory_for_moves()
        self.line = linked(np.array(way, float), is_end_fixed=is_end_fixed)
        for a, b in pairwise(way):
            sweep(self.floor.sweeps, *map(float, (*a, *b)), TOOL, 1, self.memory.capsules)

    @property
    def points(self) -> np.ndarray:
        return self.line.points[numbers_along(self.line)]

    def cost_s(self) -> float:
        """Return seconds and the price of what is left, counted slowly."""
        way = np.diff(self.points, axis=0)
        headings = np.arctan2(way[:, 0], way[:, 1])
        turns = np.abs((np.diff(headings) + np.pi) % (2 * np.pi) - np.pi)
        left = int(np.count_nonzero(self.floor.sweeps.counts == 0))
        turns_s = sum(turn_seconds(self.price.turning, turn) for turn in turns.tolist())
        driven_s = self.price.drive_s * np.hypot(*way.T).sum() + turns_s
        return float(driven_s + self.price.left_s * left + self.price.near_s * self.near())

    def near(self) -> float:
        """Return the length without clearance, counted slowly [pixels]."""
        length, (robot, clear) = 0.0, (self.floor.robot, self.floor.clear)
        if clear <= robot:
            return length
        pixels = np.argwhere(unpacked(self.floor.blocked, COLS))
        for a, b in pairwise(self.points):
            edge = float(np.hypot(*(b - a)))
            count = max(math.ceil(edge / PIECE), 1)
            for part in range(count):
                share = np.linspace(part / count, (part + 1) / count, 200)[:, None]
                along = (a + share * (b - a))[:, None, :]
                off = np.maximum(np.abs(along - pixels) - 0.5, 0.0)
                apart = float(np.hypot(off[..., 0], off[..., 1]).min())
                nearer = sum(apart < radius - TOUCH for radius in (clear, 0.5 * (robot + clear)))
                length += 0.5 * nearer * edge / count
        return length

    def recounted(self) -> Sweeps:
        """Return what the line sweeps, counted anew."""
        counts = np.where(self.floor.sweeps.counts >= NEVER // 2, NEVER, 0).astype(np.int16)
        sweeps = Sweeps(counts, np.zeros_like(self.floor.sweeps.left))
        for a, b in pairwise(self.points.tolist()):
            sweep(sweeps, *a, *b, TOOL, 1, self.memory.capsules)
        left = (counts == 0).reshape(ROWS // 8, 8, COLS // 8, 8).sum(axis=(1, 3))
        return Sweeps(counts, left)

    def anneal(self, heat: float = 1.0, most: int = 4000) -> float:
        random = np.array([7], np.uint64)
        args = self.line, self.floor, self.price, self.memory, random
        return anneal(*args, 0, (heat, 0.0), most)


@pytest.mark.parametrize("turning", TURNINGS)
@pytest.mark.parametrize("heat", [0.0, 1.0])
@pytest.mark.parametrize("clear", [ROBOT, ROBOT + 1.5])
def test_what_is_gained_is_what_a_slow_count_shows(heat, clear, turning):
    room = Room(turning, clear=clear)
    before = room.cost_s()
    gained = room.anneal(heat)
    assert gained > 1.0
    # A turn is told to 1e-5 rad; some thousand are added up.
    assert gained == pytest.approx(before - room.cost_s(), abs=0.05)
    counted = room.recounted()
    below = counted.counts < NEVER // 2
    assert (room.floor.sweeps.counts[below] == counted.counts[below]).all()
    assert (room.floor.sweeps.left == counted.left).all()


def test_a_line_keeps_its_clearance_where_that_costs_little():
    without, kept = Room(), Room(clear=ROBOT + 1.5)
    for room in (without, kept):
        room.anneal()
    judged = Room(clear=kept.floor.clear)
    judged.line = without.line
    assert kept.near() < 0.5 * judged.near()


def test_numbers_of_points_that_go_are_used_again():
    room = Room()
    few = (array[:60].copy() for array in room.line[:3])
    room.line = kernel.Line(*few, *room.line[3:])
    assert room.anneal() > 1.0
    assert room.line.state[kernel.TRIED] == 4000
    used, most = int(room.line.state[kernel.USED]), len(room.points)
    free, number = 0, int(room.line.state[kernel.FREE])
    while number != kernel.NONE:
        free, number = free + 1, int(room.line.next[number])
    assert used == most + free
    assert used <= 60


def test_an_annealed_line_keeps_its_ends():
    room = Room(is_end_fixed=True)
    first, last = room.points[[0, -1]].tolist()
    assert room.anneal() > 1.0
    assert room.points[[0, -1]].tolist() == [first, last]


def test_what_is_tried_is_bounded():
    room = Room()
    room.anneal(most=300)
    assert room.line.state[kernel.TRIED] == 300
