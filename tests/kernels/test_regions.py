"""Regions cut out of a walk and put back: whatever is done inside, the whole stays a walk."""

import itertools
from collections import Counter
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.kernels.lattice.reach import walk_cost
from fasaco_edge.kernels.local_search.holes import rays
from fasaco_edge.kernels.local_search.parity import JUMPS
from fasaco_edge.kernels.local_search.perturbation import DRAWN, LocalSearch, perturb, remember
from fasaco_edge.kernels.local_search.proposals import improve
from fasaco_edge.kernels.local_search.regions import (
    AFTER,
    Jumps,
    RegionBox,
    cut_ground,
    cut_walk,
    put_back,
)
from fasaco_edge.kernels.local_search.walk_array import COST, FIXED, FRAME, LENGTH, Ground, recount
from tests import naive
from tests.kernels.grounds import (
    PRICES,
    Task,
    assert_counts,
    assert_guards_hold,
    assert_sound,
    cells_of,
    colony_on,
    drawn_task,
    guarded,
    memory_on,
    room_of,
    steps_taken,
    stream,
    tally_on,
    walk_on,
)
from tests.kernels.test_perturbation import rules_for
from tests.support.examples import examples
from tests.support.grids import lattice

EVERYWHERE = np.empty(0, np.int32)


class Cut(NamedTuple):
    """A region, its walk and what it takes to put that back."""

    whole: Ground
    cells: np.ndarray
    box: RegionBox
    search: LocalSearch
    jumps: Jumps

    ground = property(lambda self: self.search.ground)
    walk = property(lambda self: self.search.walk)
    tally = property(lambda self: self.search.tally)
    memory = property(lambda self: self.search.memory)
    prices = property(lambda self: self.search.prices)
    sections = property(lambda self: self.jumps.sections)
    limits = property(lambda self: self.jumps.limits)

    def put_back(self):
        inner = np.array(cells_of(self.walk), np.int32)
        out = guarded(self.cells.size + inner.size, np.int32)
        length = put_back(self.whole, self.box, self.cells, inner, self.jumps, out)
        assert_guards_hold(self.walk, self.tally, self.memory)
        return out[:length].copy()


def box_round(labels, label, rows, cols, margin=0):
    """The box of all cells of a lattice with a label, int32 (rows, cols), or a wider one."""
    row, col = np.nonzero(labels == label)
    row0, col0 = max(row.min() - margin, 0), max(col.min() - margin, 0)
    row1, col1 = min(row.max() + 1 + margin, rows), min(col.max() + 1 + margin, cols)
    framed = np.pad(labels, FRAME, constant_values=label).astype(np.int32).ravel()
    return RegionBox(
        framed, int(label), *map(int, (row0 + FRAME, col0 + FRAME, row1 - row0, col1 - col0))
    )


def cut(task, box, cells=None, prices=PRICES[0], jumps=200, room=None):
    """Cut the region out; None where the walk does not come there."""
    whole = task.ground()
    cells = task.cells() if cells is None else cells
    width = box.cols + 2 * FRAME
    bound = (box.rows + 2 * FRAME) * width
    offsets = np.array([1, width, -1, -width], np.int64)
    both = bound + jumps
    ground = Ground(guarded(both, np.uint8), guarded(both, np.int32), offsets, bound)
    inside = cut_ground(whole, box, ground)
    assert inside == np.count_nonzero(ground.needed[:bound] != FIXED)
    room = 4 * cells.size + 300 if room is None else room
    walk = walk_on(ground, [], prices, room, jumps)
    tally, memory = tally_on(ground, room, jumps), memory_on(ground, room)
    limits = guarded(2, np.int64)
    cut_out = Jumps(tally.jump_ends, guarded((jumps, 2), np.int32), limits)
    length, made = cut_walk(whole, box, cells, walk.cells, cut_out)
    assert_guards_hold(ground, walk, tally)
    if not (length and inside):
        return None
    tally.counts[JUMPS] = made
    prices = prices._replace(free_end=prices.free_end and bool(limits[AFTER] == cells.size))
    recount(ground, walk, length, prices)
    rays(ground, tally.rays)
    remember(walk, memory)
    return Cut(
        whole,
        cells,
        box,
        LocalSearch(ground, walk, prices, tally, memory, colony_on(ground, prices)),
        cut_out,
    )


def labels_for(random, shape):
    """Labels of a ground: squares, halves, or a patchwork without any order."""
    rows, cols = np.indices(shape)
    return (
        rows // 3 * 10 + cols // 3,
        (rows + 2 * cols > random.integers(20)).astype(int),
        random.integers(0, 3, shape),
        (random.random(shape) < 0.85).astype(int),
    )[random.integers(4)]


def drawn_cut(seed, prices=PRICES[0], side=9):
    random = np.random.default_rng(seed)
    task = drawn_task(seed, side)
    labels = labels_for(random, task.steps.shape)
    label = random.choice(labels.ravel())
    box = box_round(labels, label, *task.steps.shape, margin=int(random.integers(2)))
    return task, cut(task, box, prices=prices)


SEEDS = st.integers(0, 2**32)


def naive_sections(task, cells, box):
    """The parts of a walk outside the region, as they lie between two visits inside."""
    inside = [box.labels[cell] == box.label for cell in cells.tolist()]
    runs = [list(run) for _, run in itertools.groupby(range(len(cells)), inside.__getitem__)]
    return [(run[0], run[-1]) for run in runs[1:-1] if not inside[run[0]]]


@examples(150)
@given(seed=SEEDS)
def test_a_region_cut_out_and_put_back_is_the_same_walk(seed):
    task, region = drawn_cut(seed)
    if region is None:
        return
    assert_counts(region.ground, region.walk)
    made = int(region.tally.counts[JUMPS])
    assert region.sections[:made].tolist() == [
        list(section) for section in naive_sections(task, region.cells, region.box)
    ]
    assert region.put_back().tolist() == region.cells.tolist()
    # What stands for the outside is not to be touched; the rest is as in the whole ground.
    bound, width = region.ground.bound, region.box.cols + 2 * FRAME
    assert (region.ground.needed[bound:] == FIXED).all()
    assert not region.ground.steps[bound:].any()
    for cell in np.flatnonzero(region.ground.needed[:bound] != FIXED).tolist():
        row, col = cell // width - FRAME + region.box.row, cell % width - FRAME + region.box.col
        large = row * task.width + col
        assert region.box.labels[large] == region.box.label
        assert region.ground.needed[cell] == region.whole.needed[large]
        for direction, gap in enumerate(region.whole.offsets.tolist()):
            stays = region.box.labels[large + gap] == region.box.label
            there = region.whole.steps[large] >> direction & 1 and stays
            assert region.ground.steps[cell] >> direction & 1 == there


def assert_whole_walk(task, region, cells):
    """The walk with the region put back covers all, and is the old one outside."""
    walk = walk_on(region.whole, cells, region.prices)
    before = task._replace(walk=[task.unframed(cell) for cell in region.cells])
    assert_sound(before, region.whole, walk, region.prices)
    outside = [
        Counter({step: times for step, times in steps_taken(way).items()
                 if all(region.box.labels[cell] != region.box.label for cell in step)})
        for way in (region.cells.tolist(), cells.tolist())
    ]  # fmt: skip
    assert outside[0] == outside[1]


@examples(200)
@given(seed=SEEDS, prices=st.sampled_from(PRICES), hot=st.booleans(), perturbed=st.booleans())
def test_changes_in_a_region_leave_a_whole_walk(seed, prices, hot, perturbed):
    task, region = drawn_cut(seed, prices)
    if region is None:
        return
    random, temperature_us = stream(seed), hot * 2 * (prices.step_us + prices.quarter_turn_us)
    rules = rules_for(prices, 3 if hot else -1, loops_of_256=128, ants_of_256=128)
    before = region.walk.counts[COST]
    for _ in range(4):
        improve(region.ground, region.walk, region.prices, EVERYWHERE, temperature_us, 300, random)
        assert_counts(region.ground, region.walk)
        cells = region.put_back()
        assert_whole_walk(task, region, cells)
        if perturbed:
            perturb(region.search, rules, 3, DRAWN, random)
            assert_counts(region.ground, region.walk)
            assert_whole_walk(task, region, region.put_back())
        if not prices.quarter_turn_us:
            # Turns at the rim are priced otherwise in the region; steps are not.
            gain = price_of(task, region.cells, prices) - price_of(task, region.put_back(), prices)
            assert gain == before - region.walk.counts[COST]


def price_of(task, cells, prices):
    return naive.walk_us([task.unframed(cell) for cell in cells.tolist()], prices, room_of)


def corridor(*cols, cols_inside, prices=PRICES[0], **room):
    """A walk over columns of a corridor of ten cells, and what is cut out of it."""
    ground = lattice("..........")
    task = Task(ground.steps, ground.coverable, [(0, col) for col in cols])
    labels = np.isin(np.arange(10), cols_inside).astype(int)[None]
    region = cut(task, box_round(labels, 1, 1, 10), prices=prices, **room)
    return task, region


def there_and(*stops):
    """The walk along the corridor by way of some stops."""
    walk = [stops[0]]
    for stop in stops[1:]:
        walk += range(walk[-1], stop, 1 if stop > walk[-1] else -1)[1:]
        walk.append(stop)
    return walk


def test_a_region_that_does_not_fit_is_refused():
    walk = there_and(4, 8, 4, 9, 4)
    fits = corridor(*walk, cols_inside=range(8), jumps=2, room=30)[1]
    assert fits is not None
    assert corridor(*walk, cols_inside=range(8), jumps=1)[1] is None
    longest = fits.walk.counts[LENGTH]
    assert corridor(*walk, cols_inside=range(8), room=int(longest) - 1)[1] is None


@pytest.mark.parametrize("prices", PRICES[:4], ids=str)
def test_region_by_region_a_large_ground_improves_and_is_covered(prices):
    """Rooms of a square lattice, placed anew each time, over a poor walk."""
    task = drawn_task(11, 24)
    cells, random = task.cells(), np.random.default_rng(3)
    rows, cols = np.indices(task.steps.shape)
    costs = [walk_cost(cells, *prices[:2])]
    for _ in range(6):
        shift = random.integers(8, size=2)
        labels = (rows + shift[0]) // 8 * 10 + (cols + shift[1]) // 8
        for label in np.unique(labels):
            box = box_round(labels, label, *task.steps.shape)
            region = cut(task, box, cells, prices)
            if region is None:
                continue
            improve(region.ground, region.walk, region.prices, EVERYWHERE, 0, 4000, stream(label))
            now = region.put_back()
            assert_whole_walk(task, region, now)
            if walk_cost(now, *prices[:2]) <= costs[-1]:
                cells = now
                costs.append(walk_cost(cells, *prices[:2]))
    assert costs == sorted(costs, reverse=True)
    assert costs[-1] < 0.5 * costs[0]
