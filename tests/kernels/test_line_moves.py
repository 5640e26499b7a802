"""Moves of the driven line: what they say to gain is what a slow count shows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest

from fasaco_edge.kernels.floor import line as kernel
from fasaco_edge.kernels.floor import reorder as reordering_moves
from fasaco_edge.kernels.floor import sweeps
from fasaco_edge.kernels.floor.anneal import anneal
from fasaco_edge.kernels.floor.bits import packed, unpacked
from fasaco_edge.kernels.floor.capsule import PIECE, TOUCH
from fasaco_edge.kernels.floor.detour import find_patches, sweep_patches
from fasaco_edge.kernels.floor.polish import polish
from fasaco_edge.kernels.floor.reorder import Exchange, reorder
from fasaco_edge.kernels.floor.sweeps import NEVER, Sweeps
from fasaco_edge.kernels.floor.turning import (
    Turning,
    limited_turning,
    proportional_turning,
    turn_seconds,
)
from fasaco_edge.planners.line import linked, memory_for_moves, numbers_along
from tests.support.inner import entry

exchange_stretch, sweep = entry(reordering_moves.exchange_stretch), entry(sweeps.sweep)
is_way, replace_points = entry(kernel.is_way), entry(kernel.replace_points)

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
        self.line = linked(np.array(way, float), left.shape, is_end_fixed=is_end_fixed)
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

    def run(self, stage: str, most: int = 4000) -> float:
        args = self.line, self.floor, self.price, self.memory
        if stage == "polish":
            return polish(*args, 40.0, most)
        if stage == "anneal":
            return anneal(*args, np.array([7], np.uint64), 0, (1.0, 0.0), most)
        if stage == "reorder":
            return sum(reorder(*args, np.array([seed], np.uint64)) for seed in range(1, 40))
        before = self.cost_s()
        sweep_patches(*args, 40.0, find_patches(self.floor.sweeps, 10), most)
        return before - self.cost_s()


@pytest.mark.parametrize("turning", TURNINGS)
@pytest.mark.parametrize("stage", ["polish", "anneal", "patches", "reorder"])
@pytest.mark.parametrize("clear", [ROBOT, ROBOT + 1.5])
def test_the_gain_equals_a_slow_count(stage, turning, clear):
    room = Room(turning, clear=clear)
    before = room.cost_s()
    gained = room.run(stage)
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
        room.run("polish")
        room.run("anneal")
    judged = Room(clear=kept.floor.clear)
    judged.line = without.line
    assert kept.near() < 0.5 * judged.near()


def test_numbers_of_points_that_go_are_used_again():
    room = Room()
    few = (array[:60].copy() for array in room.line[:4])
    room.line = kernel.Line(*few, *room.line[4:])
    assert room.run("anneal") > 1.0
    assert room.line.state[kernel.TRIED] == 4000
    used, most = int(room.line.state[kernel.USED]), len(room.points)
    free, number = 0, int(room.line.state[kernel.FREE])
    while number != kernel.NONE:
        free, number = free + 1, int(room.line.next[number])
    assert used == most + free
    assert 40 < used <= 60


def test_an_annealed_line_keeps_its_ends():
    room = Room(is_end_fixed=True)
    first, last = room.points[[0, -1]].tolist()
    assert room.run("anneal") > 1.0
    assert room.points[[0, -1]].tolist() == [first, last]


def reordering(rng: np.random.Generator, count: int) -> tuple[list[int | bool], list[int]]:
    """Draw a move of a line of some points: its arguments, and the order that it leads to."""
    order = list(range(count))
    if rng.integers(2):
        a, c = sorted(rng.choice(count, 2, replace=False).tolist())
        return [a + 1, c, kernel.NONE, True], order[: a + 1] + order[a + 1 : c + 1][::-1] + order[
            c + 1 :
        ]
    while True:
        b, c = sorted(rng.choice(range(1, count), 2, replace=False).tolist())
        if places := [e for e in order if not b - 2 <= e <= c + 1]:
            break
    e, is_turned = int(rng.choice(places)), int(rng.integers(2))
    stretch, rest = order[b : c + 1], order[:b] + order[c + 1 :]
    after = rest.index(e) + 1
    return [b, c, e, bool(is_turned)], rest[:after] + stretch[:: 1 - 2 * is_turned] + rest[after:]


@pytest.mark.parametrize("turning", TURNINGS)
@pytest.mark.parametrize("is_end_fixed", [False, True])
def test_a_reordering_is_that_of_a_list(turning, is_end_fixed):
    rng = np.random.default_rng(5)
    made = {"reversed": 0, "moved": 0}
    for _ in range(400):
        count = int(rng.integers(6, 12))
        way = [(float(y), float(x)) for y, x in rng.uniform((10, 10), (62, 86), (count, 2))]
        room = Room(turning, is_end_fixed=is_end_fixed, way=way)
        args, order = reordering(rng, count)
        other = Room(turning, way=[way[number] for number in order])
        edges = Exchange(np.zeros((3, 4), np.int64), np.zeros((3, 4), np.int64), np.zeros(1, int))
        before = room.cost_s()
        gain = exchange_stretch(room.line, room.floor, room.price, room.memory, edges, *args)
        should = before - other.cost_s()
        numbers = numbers_along(room.line)
        assert [room.line.previous[number] for number in numbers] == [kernel.NONE, *numbers[:-1]]
        below = room.floor.sweeps.counts < NEVER // 2
        assert (room.floor.sweeps.counts[below] == room.recounted().counts[below]).all()
        if gain > 0.0:
            assert numbers == order
            assert gain == pytest.approx(should, abs=1e-3)
            made["reversed" if args[2] == kernel.NONE else "moved"] += 1
            continue
        assert numbers == list(range(count))
        new = {frozenset(edge) for edge in pairwise(order)} - {
            frozenset(edge) for edge in pairwise(numbers)
        }
        ends = (np.array([way[number] for number in edge]) for edge in map(sorted, new))
        is_blocked = not all(is_way(room.floor, edge, 0, 1) for edge in ends)
        assert is_blocked or should < 0.01 or (is_end_fixed and order[-1] != count - 1)
    assert min(made.values()) > 20


def test_a_chain_longer_than_a_move_is_replaced_as_well():
    room = Room()
    numbers = numbers_along(room.line)
    replace_points(room.line, room.floor, room.memory, numbers[0], numbers[-1], 0)
    assert len(room.points) == 2
    below = room.floor.sweeps.counts < NEVER // 2
    assert (room.floor.sweeps.counts[below] == room.recounted().counts[below]).all()


def test_patches_are_pixels_left_that_hang_together():
    room = Room()
    counts = room.floor.sweeps.counts
    counts[counts == 0] = 1
    counts[20, 30:38] = counts[21, 37] = 0  # nine, across two blocks
    counts[40, 50:58] = counts[41, 58] = 0  # eight and one beside a corner
    assert np.argwhere(find_patches(room.floor.sweeps, 9)).tolist() == [[2, 3], [2, 4]]
    assert np.argwhere(find_patches(room.floor.sweeps, 8)).tolist() == [
        [2, 3],
        [2, 4],
        [5, 6],
        [5, 7],
    ]
    assert not find_patches(room.floor.sweeps, 10).any()
