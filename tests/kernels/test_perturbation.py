"""Perturbations leave a walk behind, and the best one is remembered."""

from collections import Counter

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.kernels.ants.fold import NOTHING
from fasaco_edge.kernels.local_search.perturbation import (
    DRAWN,
    PERTURBATIONS,
    LocalSearch,
    PerturbationRules,
    perturb,
    recall,
    remember,
)
from fasaco_edge.kernels.local_search.walk_array import COST, LENGTH
from tests.kernels.grounds import (
    PRICES,
    assert_guards_hold,
    assert_sound,
    cells_of,
    colony_on,
    drawn_task,
    memory_on,
    stream,
    tally_on,
    task_on,
    tasks,
    walk_on,
)
from tests.kernels.test_holes import Space, chain_of, links_of, squares_of
from tests.support.examples import examples
from tests.support.grids import lattice

EVERY_CELL = 1 << 30


def rules_for(
    prices, radius, proposals=10, loops_of_256=256, limit=EVERY_CELL, patience=0.4, strict=False,
    ants_of_256=0,
):  # fmt: skip
    unit = (prices.step_us + prices.quarter_turn_us) * 2 // 5
    patience_us = int(unit * patience)
    return PerturbationRules(
        limit, proposals, radius, unit, patience_us, loops_of_256, ants_of_256, strict
    )


def set_up(task, prices, room=None):
    ground = task.ground()
    walk = walk_on(ground, task.cells(), prices, room or 4 * len(task.walk) + 300)
    tally, memory = tally_on(ground, walk.cells.size), memory_on(ground, walk.cells.size)
    remember(walk, memory)
    return LocalSearch(ground, walk, prices, tally, memory, colony_on(ground, prices))


def best_of(memory):
    return memory.best[: memory.best_counts[LENGTH]].tolist()


def assert_best_is_sound(task, ground, memory, prices):
    walk = walk_on(ground, best_of(memory), prices)
    assert_sound(task, ground, walk, prices)
    assert walk.counts.tolist() == memory.best_counts.tolist()


@examples(100)
@given(
    task=tasks(),
    prices=st.sampled_from(PRICES),
    radius=st.sampled_from((-1, 0, 2, 8)),
    loops_of_256=st.sampled_from((0, 64, 256)),
    ants_of_256=st.sampled_from((0, 192)),
    limit=st.sampled_from((1, 6, EVERY_CELL)),
    room=st.sampled_from((0, 3, 300)),
    strict=st.booleans(),
    seed=st.integers(0, 2**32),
)
def test_perturbations_leave_a_sound_walk_and_remember_the_best(
    task, prices, radius, loops_of_256, ants_of_256, limit, room, strict, seed
):
    search = set_up(task, prices, len(task.walk) + room)
    ground, walk, _, tally, memory, colony = search
    rules = rules_for(
        prices, radius, 5, loops_of_256, limit, strict=strict, ants_of_256=ants_of_256
    )
    random = stream(seed)
    seen = [walk.counts[COST]]
    for number in range(1, 25):
        perturb(search, rules, 1, DRAWN, random)
        assert_sound(task, ground, walk, prices)
        seen.append(walk.counts[COST])
        assert memory.best_counts[COST] == min(seen)
        assert memory.work[PERTURBATIONS] == number
        assert not strict or cells_of(walk) == best_of(memory)
        # At the end of the search the lists of jumps and steps are as at its beginning.
        assert (tally.links == -1).all()
        assert not colony.is_open.any()
        assert (colony.first_end == NOTHING).all()
        assert (colony.trail > 0.0).all()
    assert_best_is_sound(task, ground, memory, prices)
    recall(search.ground, search.walk, search.prices, search.memory)
    assert cells_of(walk) == best_of(memory)
    assert_sound(task, ground, walk, prices)
    assert_guards_hold(walk, tally, memory, colony)


def bare_perturbations(task, prices, times, seed):
    """The walks that single perturbations of one walk lead to, without any improvement."""
    rules = rules_for(prices, 0, proposals=0, patience=1e4)
    for number in range(times):
        search = set_up(task, prices)
        perturb(search, rules, 1, DRAWN, stream((seed, number)))
        yield search.ground, cells_of(search.walk)


def test_perturbations_move_the_end_or_lead_round_a_hole():
    changes = Counter()
    for seed in range(40):
        task = drawn_task(seed, 6)
        ground = task.ground()
        links = links_of(ground)
        squares = Space(links)
        for square in squares_of(links, task.width):
            squares.add(square)
        before = task.cells().tolist()
        for prices in PRICES[:2]:
            for ground, after in bare_perturbations(task, prices, 10, seed):
                chain = chain_of(ground, before) ^ chain_of(ground, after)
                if after[-1] != before[-1]:
                    changes["end"] += 1
                    assert prices.free_end
                elif chain:
                    changes["loop", prices.free_end] += 1
                    assert squares.left_of(chain)
    assert changes["end"] > 100
    assert changes["loop", True] > 30
    assert changes["loop", False] > 60


def test_a_perturbation_finds_the_other_way_round_a_pillar():
    """Round a pillar of one cell eight steps are the least; local search alone leaves ten."""
    ring = lattice("...", ".#.", "...")
    task = task_on(ring.steps, (0, 0), np.random.default_rng(0))
    there_and_back = [(0, 0), (0, 1), (0, 2), (1, 2), (2, 2), (2, 1), (2, 0), (1, 0)]
    task = task._replace(walk=there_and_back + there_and_back[-2::-1])
    prices = PRICES[1]
    search = set_up(task, prices)
    memory = search.memory
    perturb(search, rules_for(prices, -1, loops_of_256=0), 20, DRAWN, stream(1))
    assert memory.best_counts[LENGTH] - 1 == 14
    perturb(search, rules_for(prices, -1), 20, DRAWN, stream(1))
    assert memory.best_counts[LENGTH] - 1 == 8


@examples(60)
@given(task=tasks(), prices=st.sampled_from(PRICES), seed=st.integers(0, 2**32))
def test_improving_given_cells_never_worsens_the_walk(task, prices, seed):
    search = set_up(task, prices)
    ground, walk, _, _, memory, _ = search
    random = stream(seed)
    for number in range(1, 15):
        before, cost = cells_of(walk), walk.counts[COST]
        spots = sorted(set(before[number::7])) or before[:1]
        memory.touched[: len(spots)] = spots
        perturb(search, rules_for(prices, 2, strict=True), 1, len(spots), random)
        assert_sound(task, ground, walk, prices)
        assert cells_of(walk) == before or walk.counts[COST] < cost
        assert cells_of(walk) == best_of(memory)
        assert memory.work[PERTURBATIONS] == number
    assert_best_is_sound(task, ground, memory, prices)
    assert_guards_hold(walk, memory)
