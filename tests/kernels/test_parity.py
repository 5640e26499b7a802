"""Ends that move and loops that are added, against plain search; Euler walks step by step."""

import itertools
import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.kernels.local_search import parity
from fasaco_edge.kernels.local_search.parity import (
    NOWHERE,
    ODDS,
    SHORTEST,
)
from fasaco_edge.kernels.local_search.proposals import improve
from fasaco_edge.kernels.local_search.walk_array import recount
from tests.kernels.grounds import (
    PRICES,
    assert_guards_hold,
    assert_sound,
    cells_of,
    drawn_task,
    steps_taken,
    stream,
    tally_on,
    task_on,
    tasks,
    walk_on,
)
from tests.kernels.test_holes import Space, crossing, links_of, loops_of, squares_of
from tests.support.examples import examples
from tests.support.grids import lattice
from tests.support.inner import entry

change_step = entry(parity.change_step)
common_ancestor = entry(parity.common_ancestor)
count_steps = entry(parity.count_steps)
draw_end = entry(parity.draw_end)
draw_loop = entry(parity.draw_loop)
euler_walk = entry(parity.euler_walk)
find_loops = entry(parity.find_loops)
note_order = entry(parity.note_order)
search_ways = entry(parity.search_ways)

EVERYWHERE = np.empty(0, np.int32)
FREE, FIXED_END = PRICES[0], PRICES[1]


def set_up(task, prices=FREE):
    ground = task.ground()
    walk = walk_on(ground, task.cells(), prices, 4 * len(task.walk) + 200)
    tally = tally_on(ground, walk.cells.size)
    count_steps(ground, walk, tally)
    return ground, walk, tally


def times_of(ground, tally):
    """How often each step is walked, by the cells it links."""
    return Counter(
        {
            ends: int(tally.times[link])
            for link, ends in links_of(ground).items()
            if tally.times[link]
        }
    )


@examples(60)
@given(task=tasks())
def test_steps_are_counted_in_either_direction(task):
    ground, walk, tally = set_up(task)
    assert times_of(ground, tally) == steps_taken(cells_of(walk))
    assert tally.times.sum() == len(task.walk) - 1


@examples(120)
@given(task=tasks(), noted=st.booleans(), seed=st.integers(0, 2**32))
def test_an_euler_walk_takes_each_step_the_given_times(task, noted, seed):
    ground, walk, tally = set_up(task)
    before = cells_of(walk)
    if noted:
        note_order(ground, walk, tally)
    length = euler_walk(ground, walk, tally, before[-1], stream(seed))
    recount(ground, walk, length, FREE)
    after = cells_of(walk)
    assert steps_taken(after) == steps_taken(before)
    assert (after[0], after[-1]) == (before[0], before[-1])
    assert_sound(task, ground, walk, FREE)
    assert not tally.times.any()
    assert (tally.links == -1).all()
    assert_guards_hold(walk, tally)


def test_a_steady_euler_walk_keeps_the_old_order():
    kept = []
    for seed in range(200):
        task = drawn_task(seed)
        ground, walk, tally = set_up(task)
        # How it went on from each step, seen from its end; two ways to go on are no order.
        before = cells_of(walk)
        ways = {}
        for after, here, old in zip(before[2:], before[1:], before, strict=False):
            ways.setdefault((here, after), set()).add(old)
        once = before.count(before[-1]) == 1 and all(len(olds) == 1 for olds in ways.values())
        if len(before) > 5 and once:
            note_order(ground, walk, tally)
            euler_walk(ground, walk, tally, before[-1], stream((seed, 1)))
            assert cells_of(walk) == before
            kept.append(len(set(before)) < len(before))
    assert np.count_nonzero(kept) > 10


def naive_search(ground, tally, root):
    """Steps that are walked less than twice on the way to every cell, by relaxing all of them."""
    least = {root: 0}
    changed = True
    while changed:
        changed = False
        for link, ends in links_of(ground).items():
            for here, there in (ends, ends[::-1]):
                if here not in least:
                    continue
                found = least[here] + (0 if tally.times[link] >= 2 else 1)
                if found < least.get(there, math.inf):
                    least[there], changed = found, True
    return least


def link_between(ground, one, other):
    return min(one, other), 0 if abs(one - other) == 1 else 1


def way_to(tally, cell):
    """The cells from one that was settled back to the root."""
    way = [int(cell)]
    while tally.parent[way[-1]] != NOWHERE:
        way.append(int(tally.parent[way[-1]]))
    return way


def growth_along(ground, tally, way):
    return sum(-1 if tally.times[link_between(ground, *step)] >= 2 else 1
               for step in itertools.pairwise(way))  # fmt: skip


@examples(100)
@given(task=tasks(), limit=st.sampled_from((1, 5, 1 << 30)), seed=st.integers(0, 2**32))
def test_twin_finds_the_same_ways(task, limit, seed):
    ground, walk, tally = set_up(task)
    for root in set(cells_of(walk)[:: max(len(task.walk) // 3, 1)]):
        settled = search_ways(ground, tally, root, limit, stream(seed))
        least = naive_search(ground, tally, root)
        assert settled == min(limit, len(least))
        order = tally.order[:settled].tolist()
        assert order[0] == root
        assert len(set(order)) == settled
        assert [tally.distance[cell] for cell in order] == [least[cell] for cell in order]
        if settled == len(least):
            assert sorted(least.values()) == [least[cell] for cell in order]
        for cell in order:
            way = way_to(tally, cell)
            assert way[-1] == root
            assert tally.growth[cell] == growth_along(ground, tally, way)
            passed = {link_between(ground, *step) for step in itertools.pairwise(way)}
            assert tally.crossed[cell] == crossing(tally.rays, passed)
        for one, other in zip(order, order[::-1], strict=True):
            shared = [cell for cell in way_to(tally, one) if cell in set(way_to(tally, other))]
            assert common_ancestor(tally, one, other) == shared[0]
    assert_guards_hold(tally)


def change_way(ground, tally, way):
    for one, other in itertools.pairwise(way):
        change_step(tally.times, one, other)


@examples(100)
@given(task=tasks(), seed=st.integers(0, 2**32))
def test_a_moved_end_lengthens_the_walk_as_predicted(task, seed):
    ground, walk, tally = set_up(task)
    random = stream(seed)
    for _ in range(5):
        count_steps(ground, walk, tally)
        before = cells_of(walk)
        settled = search_ways(ground, tally, before[-1], 1 << 30, random)
        if settled < 2:
            return
        end = draw_end(tally, settled, random)
        assert end in tally.order[1:settled]
        grown = int(tally.growth[end])
        change_way(ground, tally, way_to(tally, end))
        length = euler_walk(ground, walk, tally, end, random)
        assert length == len(before) + grown
        recount(ground, walk, length, FREE)
        assert cells_of(walk)[-1] == end
        assert set(cells_of(walk)) >= set(before)
        assert_sound(task, ground, walk, FREE)


def chain_of(ground, cells):
    """The steps that are walked an odd number of times."""
    times = steps_taken(cells)
    return frozenset(link_between(ground, *ends) for ends in times if times[ends] % 2)


@examples(150)
@given(task=tasks(), seed=st.integers(0, 2**32))
def test_an_added_loop_rounds_a_hole_and_grows_as_predicted(task, seed):
    ground, walk, tally = set_up(task, FIXED_END)
    links, random = links_of(ground), stream(seed)
    squares = Space(links)
    for square in squares_of(links, task.width):
        squares.add(square)
    root = cells_of(walk)[len(task.walk) // 2]
    settled = search_ways(ground, tally, root, 1 << 30, random)
    found = find_loops(ground, tally, settled)
    # Wherever there is a hole there is a loop to be found from anywhere.
    near = set(tally.order[:settled].tolist())
    loops = loops_of({link: ends for link, ends in links.items() if near.issuperset(ends)})
    assert (found > 0) == any(crossing(tally.rays, loop) for loop in loops)
    before = cells_of(walk)
    for index in range(min(found, 8)):
        count_steps(ground, walk, tally)
        step, odds = tally.loops[index].tolist()
        one, other = links[step >> 1, step & 1]
        shared = common_ancestor(tally, one, other)
        ways = [way[: way.index(shared) + 1] for way in (way_to(tally, one), way_to(tally, other))]
        loop = [*ways[0][::-1], *ways[1]]
        grown = growth_along(ground, tally, loop)
        assert odds == ODDS[max(grown - SHORTEST, 0)]
        change_way(ground, tally, loop)
        length = euler_walk(ground, walk, tally, before[-1], random)
        recount(ground, walk, length, FIXED_END)
        assert_sound(task, ground, walk, FIXED_END)
        if not set(loop) & set(before):
            # Over ground that needs no visit, and where the walk never comes.
            assert steps_taken(cells_of(walk)) == steps_taken(before)
            continue
        assert length == len(before) + grown
        assert squares.left_of(chain_of(ground, before) ^ chain_of(ground, cells_of(walk)))
        walk.cells[: len(before)] = before
        recount(ground, walk, len(before), FIXED_END)
    assert_guards_hold(walk, tally)


@examples(80)
@given(task=tasks(), prices=st.sampled_from((PRICES[1], PRICES[3])), seed=st.integers(0, 2**32))
def test_local_search_never_changes_the_side_a_hole_is_passed_on(task, prices, seed):
    ground = task.ground()
    walk, links = walk_on(ground, task.cells(), prices), links_of(ground)
    squares = Space(links)
    for square in squares_of(links, task.width):
        squares.add(square)
    before = chain_of(ground, cells_of(walk))
    for heat in (0, 3 * prices.step_us):
        improve(ground, walk, prices, EVERYWHERE, heat, 2000, stream(seed))
        assert not squares.left_of(before ^ chain_of(ground, cells_of(walk)))


def test_ends_and_loops_are_drawn_by_their_odds():
    task = task_on(lattice(".....", ".#.#.", ".....").steps, (0, 0), np.random.default_rng(4))
    ground, walk, tally = set_up(task)
    random = stream(8)
    settled = search_ways(ground, tally, cells_of(walk)[-1], 1 << 30, random)
    found = find_loops(ground, tally, settled)
    ends = tally.order[1:settled].tolist()
    assert found >= 2
    assert settled == 13
    odds = {cell: math.exp(-max(int(tally.growth[cell]), SHORTEST) / 3) for cell in ends}
    assert_drawn_by(odds, lambda: draw_end(tally, settled, random))
    odds = dict(tally.loops[:found].tolist())
    assert_drawn_by(odds, lambda: draw_loop(tally, found, random))


def assert_drawn_by(odds, draw):
    times = Counter(draw() for _ in range(4000))
    total = sum(odds.values())
    assert times.keys() <= odds.keys()
    for one, weight in odds.items():
        assert times[one] / 4000 == pytest.approx(weight / total, abs=0.03)
