"""A plan that was stopped at any time is repeated by where that was, cell by cell."""

import time

import numpy as np
import pytest

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.planners.cost import CoverageCost, SearchWork
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.paper.fasaco import Fasaco
from fasaco_edge.planners.planner import (
    SearchProgress,
    StopAt,
    StopRecorder,
    TimeBudget,
    WorkLimit,
    never,
)
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.search.near_optimal import (
    SHORT_SEARCH,
    SHORT_SEARCH_PER_CELL,
    NearOptimal,
    is_poor,
)
from fasaco_edge.planners.search.repair import repaired
from fasaco_edge.planners.search.search import PROPOSALS_AT_ONCE


def poor_problem(seed=0, visits=1000):
    """Return a problem with a walk that wanders about, many times longer than need be."""
    draw = np.random.default_rng(seed)
    free = draw.random((18, 18)) > 0.15
    free[0, 0] = free[0, 1] = True
    lattice = CoverageLattice.from_free(free)
    walk = [(0, 0)]
    while len(walk) < visits:
        row, col = walk[-1]
        around = [(row + 1, col), (row - 1, col), (row, col + 1), (row, col - 1)]
        row, col = around[draw.integers(4)]
        if 0 <= row < 18 and 0 <= col < 18 and free[row, col]:
            walk.append((row, col))
    return CoverageProblem.of(lattice, (0, 0), before=np.array(walk, np.int32))


def stopping_at(*questions):
    asked = iter(range(1, 1_000_000))
    return StopRecorder(lambda progress: next(asked) in questions)


def test_a_stopped_repair_and_the_search_after_it_are_repeatable():
    """The path's work omits the repair: repeated by work alone, another path comes out."""
    problem = poor_problem()
    assert is_poor(problem, repaired(problem, "fasaco", ColonyConfig(), lambda progress: True))
    stop = stopping_at(1, 3)
    path = NearOptimal().plan(problem, stop)
    assert stop.stops == [1, 3]
    assert path.work.ants > 0
    again = StopRecorder(StopAt(stop.stops))
    repeated = NearOptimal().plan(problem, again)
    assert again.stops == stop.stops
    assert np.array_equal(repeated.cells, path.cells)
    assert repeated.work == path.work
    by_work = NearOptimal().plan(problem, WorkLimit(path.work))
    assert not np.array_equal(by_work.cells, path.cells)


@pytest.mark.parametrize("planner", [NearOptimal(), Fasaco()])
@pytest.mark.parametrize("question", [1, 2, 5, 17])
def test_a_search_is_repeated(planner, question):
    lattice = CoverageLattice.from_free(np.random.default_rng(3).random((20, 20)) > 0.2)
    start = tuple(np.argwhere(lattice.coverable)[0].tolist())
    problem = CoverageProblem.of(lattice, start)
    stop = stopping_at(question)
    path = planner.plan(problem, stop)
    repeated = planner.plan(problem, StopAt(stop.stops))
    assert np.array_equal(repeated.cells, path.cells)
    assert repeated.work == path.work


def test_the_search_after_a_poor_repair_is_short():
    """A robot of a fleet that gets another share had to wait as long as for its first plan."""
    free = np.random.default_rng(0).random((24, 24)) > 0.15
    lattice, west = CoverageLattice.from_free(free), np.arange(24) < 12
    cells = np.argwhere(lattice.coverable)
    start, cost = tuple(cells[len(cells) // 2].tolist()), CoverageCost(1.2, 1.5)
    share = CoverageProblem.of(lattice, start, covered=free & ~west, cost=cost)
    before = NearOptimal().plan(share, WorkLimit(SearchWork(proposals=100_000))).cells
    other = CoverageProblem.of(lattice, start, covered=free & west, cost=cost, before=before)
    assert is_poor(other, repaired(other, "fasaco", ColonyConfig(), never))
    path = NearOptimal().plan(other, WorkLimit(SearchWork(proposals=2_000_000)))
    most = SHORT_SEARCH + SHORT_SEARCH_PER_CELL * other.cells
    assert most <= path.work.proposals < most + 2 * PROPOSALS_AT_ONCE
    assert not is_poor(other, path)


# When searches end: by the clock or their work.


def test_a_budget_is_used_up_with_time():
    progress = SearchProgress(SearchWork(), 100.0, 100)
    assert not TimeBudget(60.0)(progress)
    assert TimeBudget(60.0, started=time.monotonic() - 60.0)(progress)


@pytest.mark.parametrize(
    ("done", "reached"),
    [
        ((4, 7, 90), False),
        ((5, 6, 90), False),
        ((5, 7, 89), False),
        ((5, 7, 90), True),
        ((6, 8, 91), True),
    ],
)
def test_a_work_limit_is_reached_once_every_count_is(done, reached):
    limit = WorkLimit(SearchWork(ants=5, perturbations=7, proposals=90))
    assert limit(SearchProgress(SearchWork(*done), 1.0, 1)) is reached
