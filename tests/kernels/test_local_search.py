"""Proposal by proposal: the walk stays one, what is known of it stays true, and it gets better."""

import itertools
from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.kernels import random
from fasaco_edge.kernels.lattice.reach import walk_cost
from fasaco_edge.kernels.local_search import proposals
from fasaco_edge.kernels.local_search.proposals import improve
from fasaco_edge.kernels.local_search.walk_array import COST, LENGTH
from tests.kernels.grounds import (
    PRICES,
    assert_sound,
    cells_of,
    drawn_task,
    steps_taken,
    stream,
    task_on,
    tasks,
    walk_on,
)
from tests.support.examples import examples
from tests.support.grids import ROOMS, lattice
from tests.support.inner import entry

accepts = entry(proposals.accepts)
draw = entry(random.draw)
index_of = entry(random.index_of)

EVERYWHERE = np.empty(0, np.int32)


def twin_draws(word, count):
    """Marsaglia's xorshift64 with the triple 13, 7, 17, in Python's integers."""
    for _ in range(count):
        word ^= word << 13 & 2**64 - 1
        word ^= word >> 7
        word ^= word << 17 & 2**64 - 1
        yield word >> 1


@pytest.mark.parametrize("seed", [1, 2**63, 2**64 - 1])
def test_twin_draws_the_same_numbers(seed):
    random = np.array([seed], np.uint64)
    assert [draw(random) for _ in range(50)] == list(twin_draws(seed, 50))


@pytest.mark.parametrize("size", [1, 2, 3, 1000, 2**22 - 1])
def test_an_index_lies_in_its_range_and_anywhere_in_it(size):
    assert index_of(0, size) == 0
    assert index_of(2**63 - 1, size) == size - 1
    drawn = [index_of(bits, size) for bits in twin_draws(7, 3000)]
    assert 0.45 * (size - 1) <= np.mean(drawn) <= 0.55 * (size - 1)
    assert len(set(drawn)) >= min(size, 900)


@pytest.mark.parametrize("heat", [1_000, 7_000_000, 4 * 10**9])
@pytest.mark.parametrize("worse", [0.1, 1.0, 3.0])
def test_a_change_for_the_worse_is_taken_as_metropolis_says(heat, worse):
    random = stream(3)
    taken = np.mean([accepts(int(worse * heat), heat, random) for _ in range(5000)])
    assert taken == pytest.approx(np.exp(-worse), abs=0.03)
    assert not accepts(int(10 * heat), heat, random)


def kind_of_move(before, after):
    """Tell from two walks what lies between them."""
    if len(after) == len(before):
        changed = [index for index, pair in enumerate(zip(before, after, strict=True))
                   if pair[0] != pair[1]]  # fmt: skip
        if len(changed) == 1:
            return "corner flip"
        first, last = changed[0], changed[-1]
        assert before[first : last + 1] == after[first : last + 1][::-1]
        return "square flip" if last + 1 < len(before) else "end flip"
    if len(before) - len(after) == 1:
        assert before[:-1] == after
        return "end out"
    at = next(
        index for index in range(len(before) - 1) if before[:index] + before[index + 2 :] == after
    )
    # Of x y x either the first two are extra or the last two.
    spike = before[at] in before[at + 2 : at + 3] or before[at + 1] in before[max(at - 1, 0) : at]
    return "spike out" if spike else "square out"


FLIPS = {"corner flip", "square flip"}
SHRINKS = {"spike out", "square out"}
AT_A_FREE_END = {"end flip", "end out"}


@pytest.mark.parametrize("hot", [False, True], ids=["cold", "hot"])
@pytest.mark.parametrize("prices", PRICES, ids=str)
def test_every_single_move_keeps_true_what_is_known_of_the_walk(prices, hot):
    kinds = Counter()
    heat = 2 * hot * (prices.step_us + prices.quarter_turn_us)
    for seed in range(60):
        task, random = drawn_task(seed, 7), stream(seed)
        ground = task.ground()
        walk = walk_on(ground, task.cells(), prices)
        for proposal in range(200):
            before, cost = cells_of(walk), walk.counts[COST]
            improve(ground, walk, prices, EVERYWHERE, heat, 1, random)
            after = cells_of(walk)
            if after != before:
                kinds[kind_of_move(before, after)] += 1
            if after != before or proposal % 16 == 0:
                assert_sound(task, ground, walk, prices)
            assert hot or walk.counts[COST] <= cost
    expected = FLIPS | SHRINKS
    if prices.free_end:
        expected |= AT_A_FREE_END
    assert set(kinds) == expected
    assert min(kinds.values()) >= 5, kinds


@examples(80)
@given(
    task=tasks(12),
    prices=st.sampled_from(PRICES),
    heats=st.lists(st.sampled_from((0.0, 0.3, 1.5, 8.0)), min_size=1, max_size=3),
    seed=st.integers(0, 2**32),
)
def test_thousands_of_moves_leave_a_sound_walk(task, prices, heats, seed):
    ground = task.ground()
    walk, random = walk_on(ground, task.cells(), prices, len(task.walk)), stream(seed)
    for heat in heats:
        heat_us = int(heat * (prices.step_us + prices.quarter_turn_us))
        cost = walk.counts[COST]
        improve(ground, walk, prices, EVERYWHERE, heat_us, 3000, random)
        assert_sound(task, ground, walk, prices)
        assert heat_us or walk.counts[COST] <= cost
        assert walk.counts[LENGTH] <= len(task.walk)


@examples(60)
@given(task=tasks(9), prices=st.sampled_from(PRICES), seed=st.integers(0, 2**32))
def test_proposals_in_an_area_leave_the_rest_unchanged(task, prices, seed):
    ground, random = task.ground(), np.random.default_rng(seed)
    cells = np.flatnonzero(random.random(ground.bound) < 0.2).astype(np.int32)
    area = cells[ground.steps[cells] > 0]
    if not area.size:
        return
    walk = walk_on(ground, task.cells(), prices)
    before = steps_taken(cells_of(walk))
    improve(ground, walk, prices, area, 2 * prices.step_us, 2000, stream(seed))
    assert_sound(task, ground, walk, prices)
    # A move reaches two steps beside the cell it is made at, and no further.
    near = {(row + up, col + right) for row, col in map(task.unframed, area.tolist())
            for up, right in itertools.product(range(-3, 4), repeat=2)}  # fmt: skip
    after = steps_taken(cells_of(walk))
    for step in (before - after) + (after - before):
        assert near.issuperset(map(task.unframed, step))


@pytest.mark.parametrize("prices", PRICES, ids=str)
def test_the_stream_determines_the_walk_in_any_portions(prices):
    task = task_on(ROOMS["rooms"][0].steps, (0, 0), np.random.default_rng(5))
    ground = task.ground()
    ways = []
    for pieces in ([4000], [1500, 2500], [1] * 4000):
        walk, random = walk_on(ground, task.cells(), prices), stream(9)
        for piece in pieces:
            improve(ground, walk, prices, EVERYWHERE, prices.step_us, piece, random)
        ways.append((cells_of(walk), random.tolist()))
    assert ways[1:] == ways[:-1]


def improved(ground, prices, start, seed, proposals=60_000):
    """The walk that local search makes of a clumsy one at temperature 0."""
    task = task_on(ground.steps, start, np.random.default_rng(seed))
    walk = walk_on(task.ground(), task.cells(), prices)
    improve(task.ground(), walk, prices, EVERYWHERE, 0, proposals, stream(seed))
    assert_sound(task, task.ground(), walk, prices)
    return walk.counts[LENGTH] - 1, len(task.walk) - 1


@pytest.mark.parametrize("seed", range(5))
def test_on_an_open_floor_next_to_no_cell_is_visited_twice(seed):
    steps, before = improved(lattice(*["." * 12] * 9), PRICES[0], (0, 0), seed)
    assert before > 180
    assert steps <= 107 + 2


def cost_of(cells, prices):
    return walk_cost(np.array(cells, np.int32), prices.step_us, prices.quarter_turn_us)


@pytest.mark.parametrize("prices", [PRICES[0], PRICES[2]])
@pytest.mark.parametrize("held", [0, 12])
def test_held_visits_move_only_where_something_is_gained(prices, held):
    """Proposal by proposal; that without a hold they move shows that there is something to hold."""
    moved = 0
    for seed in range(12):
        task = task_on(ROOMS["rooms"][0].steps, (0, 0), np.random.default_rng(seed))
        ground, random = task.ground(), stream(seed)
        walk = walk_on(ground, task.cells(), prices)
        for _ in range(2000):
            before = cells_of(walk)
            improve(
                ground,
                walk,
                prices._replace(held=held),
                EVERYWHERE,
                prices.quarter_turn_us,
                1,
                random,
            )
            after = cells_of(walk)
            gained = cost_of(after, prices) < cost_of(before, prices)
            moved += not gained and after[:12] != before[:12]
    assert (moved == 0) == (held > 0)
