"""A completed walk: legal, complete, and the same where nothing changed."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.lattice.reach import reachable_from
from fasaco_edge.planners.bound import lower_bound_steps
from fasaco_edge.planners.cost import CoverageCost, SearchWork
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.planner import WorkLimit, never
from fasaco_edge.planners.problem import CoverageProblem, FramedGround
from fasaco_edge.planners.search.effort import repair_for
from fasaco_edge.planners.search.near_optimal import NearOptimal
from fasaco_edge.planners.search.repair import MOST_PERTURBATIONS, PERTURBATIONS_AT_ONCE, repaired
from fasaco_edge.planners.walk_before import HELD_CELLS, completed
from tests.benchmarks.judge import check_walk
from tests.support.examples import examples

SHORT = WorkLimit(SearchWork(perturbations=8))
TURNS = CoverageCost(1.0, 1.5)


def ground(seed, rows=9, cols=13, blocked=0.2):
    """Return free cells at random, bool (rows, cols)."""
    return np.random.default_rng(seed).random((rows, cols)) >= blocked


def driven_halfway(seed, change, end=None, cost=None):
    """Return the problem of a robot amid its walk when some cells change, and that walk's rest."""
    free = ground(seed)
    free[4, 6] = True
    cost = cost or CoverageCost()
    before = CoverageProblem.of(CoverageLattice.from_free(free), (4, 6), cost=cost)
    walk = NearOptimal().plan(before, SHORT).cells
    rng = np.random.default_rng((seed, 1))
    at = int(rng.integers(0, len(walk)))
    here = (int(walk[at, 0]), int(walk[at, 1]))
    covered = np.zeros(free.shape, bool)
    covered[tuple(walk[: at + 1].T)] = True
    free ^= rng.random(free.shape) < change
    free[here] = True
    lattice = CoverageLattice.from_free(free)
    rest = walk[at:].copy()
    # Something must be left to do.
    covered &= reachable_from(lattice.steps, *here).astype(bool)
    if not (reachable_from(lattice.steps, *here).astype(bool) & ~covered).any():
        covered[:] = False
    end = here if end else None
    return CoverageProblem.of(lattice, here, covered=covered, end=end, cost=cost, before=rest)


def completed_cells(problem, before, held=0):
    """Return the cells of a completed walk, int32 (n, 2)."""
    framed = FramedGround.of(problem)
    flat = framed.unframed(completed(problem, framed, before, held))
    return np.column_stack(np.divmod(flat, framed.cols)).astype(np.int32)


def judge(problem, cells):
    """Check a walk by code that shares nothing with the planners."""
    verdict = check_walk(problem.lattice.steps, problem.to_cover, cells, problem.start, problem.end)
    assert verdict.legal, verdict.problems
    assert verdict.complete, verdict.problems
    return verdict


@examples(150)
@given(
    seed=st.integers(0, 10**6),
    change=st.sampled_from((0.0, 0.03, 0.2)),
    home=st.booleans(),
    held=st.sampled_from((0, 5, 1000)),
)
def test_a_completed_walk_is_legal_and_complete(seed, change, home, held):
    problem = driven_halfway(seed, change, end=home)
    judge(problem, completed_cells(problem, problem.before, held))


@examples(50)
@given(seed=st.integers(0, 10**6))
def test_without_a_change_the_walk_stays(seed):
    problem = driven_halfway(seed, change=0.0)
    assume(not problem.to_cover[problem.start])  # else the whole walk was driven
    kept = completed_cells(problem, problem.before)
    assert np.array_equal(kept, problem.before[: len(kept)])


def test_cells_that_can_wait_leave_the_next_steps_alone():
    """A row appears between one that is about to be driven and one that comes later."""
    free = np.ones((3, 12), bool)
    free[1, :11] = False
    there, back = [(0, col) for col in range(12)], [(2, col) for col in range(11, -1, -1)]
    walk = np.array([*there, (1, 11), *back], np.int32)
    problem = CoverageProblem.of(CoverageLattice.from_free(np.ones((3, 12), bool)), (0, 0))
    for later, kept in ((True, 12), (False, 1)):
        before = walk if later else walk[:12]
        cells = completed_cells(problem, before, 12)
        judge(problem, cells)
        same = (cells[: len(before)] == before).all(axis=1)
        assert int(np.argmin(same)) >= kept
        assert later or not same[:12].all()


@examples(100)
@given(
    seed=st.integers(0, 10**6),
    change=st.sampled_from((0.03, 0.2)),
    home=st.booleans(),
    cost=st.sampled_from((CoverageCost(), TURNS)),
)
def test_a_repaired_walk_costs_no_more_than_the_completed_one(seed, change, home, cost):
    problem = driven_halfway(seed, change, end=home, cost=cost)
    only_completed = completed_cells(problem, problem.before, HELD_CELLS)
    path = repaired(problem, "fasaco", ColonyConfig(), never)
    verdict = judge(problem, path.cells)
    assert path.cost_s == cost.of_walk(path.cells)
    assert path.cost_s <= cost.of_walk(only_completed)
    assert path.lower_bound_steps <= verdict.steps == path.steps
    # Two that change no parity come before, around what changed; and all of it once more for a
    # path that keeps the way ahead.
    assert path.work.perturbations <= 2 * (MOST_PERTURBATIONS + PERTURBATIONS_AT_ONCE) + 4


def test_a_repair_is_worth_its_while():
    gains = []
    for seed in range(30):
        problem = driven_halfway(seed, change=0.05)
        gains.append(len(completed_cells(problem, problem.before)) - 1)
        gains[-1] -= repaired(problem, "fasaco", ColonyConfig(), never).steps
    assert np.mean(gains) > 5


def test_a_repair_without_ants_works_as_much():
    problem = driven_halfway(0, change=0.1, cost=TURNS)
    paths = [NearOptimal(has_ants=has_ants).plan(problem, never) for has_ants in (True, False)]
    assert paths[0].work.ants > 0
    assert paths[1].work.ants == 0
    assert paths[1].work.proposals > 0.5 * paths[0].work.proposals


@examples(30)
@given(seed=st.integers(0, 10**6), pieces=st.integers(0, 5))
def test_the_same_work_repairs_the_same_way(seed, pieces):
    problem = driven_halfway(seed, change=0.1, cost=TURNS)
    asked = iter(range(pieces))
    first = repaired(
        problem, "fasaco", ColonyConfig(seed=3), lambda progress: next(asked, None) is None
    )
    again = repaired(problem, "fasaco", ColonyConfig(seed=3), WorkLimit(first.work))
    assert again.work == first.work
    assert np.array_equal(again.cells, first.cells)


def test_the_planner_keeps_what_holds_of_the_walk_before():
    free = np.ones((20, 30), bool)
    lattice = CoverageLattice.from_free(free)
    walk = NearOptimal().plan(CoverageProblem.of(lattice, (0, 0)), SHORT).cells
    changed = free.copy()
    row, col = walk[-40]
    changed[row, col] = False
    problem = CoverageProblem.of(CoverageLattice.from_free(changed), (0, 0), before=walk)
    assert problem.can_repair
    path = NearOptimal().plan(problem, never)
    judge(problem, path.cells)
    old, new = (
        set(pairwise(map(tuple, walk.tolist()))),
        set(pairwise(map(tuple, path.cells.tolist()))),
    )
    assert len(new - old) < 40


def test_a_full_search_begins_with_the_walk_before():
    free = np.random.default_rng(8).random((24, 24)) > 0.12
    lattice = CoverageLattice.from_free(free)
    row, col = np.argwhere(lattice.coverable)[0].tolist()
    first = CoverageProblem.of(lattice, (row, col))
    before = NearOptimal().plan(first, WorkLimit(SearchWork(proposals=1_000_000))).cells
    little = WorkLimit(SearchWork(proposals=100_000))
    other = NearOptimal(ColonyConfig(seed=1))
    path = other.plan(replace(first, before=before, is_full=True), little)
    judge(first, path.cells)
    assert path.work.ants > 0, "it was searched, not repaired"
    assert path.steps <= len(before) - 1
    assert path.saved.local_search == len(before) - 1 - path.steps
    assert np.array_equal(path.cells[:HELD_CELLS], before[:HELD_CELLS])
    assert other.plan(first, little).steps > path.steps


def test_many_changes_on_a_large_ground_are_all_repaired():
    """More than one neighbourhood holds, on more cells than are searched as a whole."""
    rng = np.random.default_rng(5)
    free = np.ones((130, 130), bool)
    lattice = CoverageLattice.from_free(free)
    walk = NearOptimal().plan(CoverageProblem.of(lattice, (0, 0)), SHORT).cells
    changed = free & (rng.random(free.shape) >= 0.02)
    changed[0, 0] = True
    problem = CoverageProblem.of(CoverageLattice.from_free(changed), (0, 0), before=walk)
    only_completed = len(completed_cells(problem, walk)) - 1
    path = repaired(problem, "fasaco", ColonyConfig(), never)
    judge(problem, path.cells)
    assert path.work.proposals > 2 * repair_for(problem.cost).proposals
    assert path.lower_bound_steps == 0  # to find one would take longer than the repair
    least = lower_bound_steps(problem)
    assert path.steps / least - 1 < 0.5 * (only_completed / least - 1)


def test_a_walk_far_above_its_bound_is_searched_again():
    free = np.ones((12, 12), bool)
    lattice = CoverageLattice.from_free(free)
    there_and_back = [(0, col) for col in range(12)] + [(0, col) for col in range(10, -1, -1)]
    walk = np.array(there_and_back * 12, np.int32)
    problem = CoverageProblem.of(lattice, (0, 0), before=walk)
    path = NearOptimal().plan(problem, SHORT)
    judge(problem, path.cells)
    assert path.steps < 180


def test_attempts_never_worsen_a_walk_and_each_looks_elsewhere():
    rng = np.random.default_rng(8)
    lattice = CoverageLattice.from_free(rng.random((60, 60)) >= 0.1)
    start = tuple(np.argwhere(lattice.coverable)[0].tolist())
    problem = CoverageProblem.of(lattice, start)
    walk = NearOptimal().plan(problem, WorkLimit(SearchWork(proposals=1))).cells
    costs, found = [problem.cost.of_walk(walk)], set()
    for attempt in range(1, 9):
        # The walk is the same each time: where one looks follows from the attempt alone.
        again = CoverageProblem.of(lattice, start, before=walk, attempt=attempt)
        path = NearOptimal().plan(again, WorkLimit(SearchWork(perturbations=60)))
        judge(again, path.cells)
        costs.append(path.cost_s)
        found.add(path.cells.tobytes())
    assert max(costs[1:]) <= costs[0]
    assert min(costs[1:]) < costs[0]
    assert len(found) == 8


def test_a_search_of_the_rest_keeps_its_start_and_beats_repair():
    """A walk over a whole floor is cut to half of it, as for a robot's part in a fleet."""
    lattice = CoverageLattice.from_free(ground(4, rows=24, cols=40, blocked=0.05))
    start = tuple(np.argwhere(lattice.coverable)[0].tolist())
    enough = WorkLimit(SearchWork(proposals=1_000_000))
    walk = NearOptimal().plan(CoverageProblem.of(lattice, start, cost=TURNS), enough).cells
    covered = np.zeros(lattice.states.shape, np.bool_)
    covered[:, 20:] = True
    half = CoverageProblem.of(lattice, start, cost=TURNS, covered=covered, before=walk)
    cut = NearOptimal().plan(half, enough)
    rest = CoverageProblem.of(
        lattice, start, cost=TURNS, covered=covered, before=cut.cells, attempt=1
    ).after(HELD_CELLS)
    full = replace(rest, is_full=True)
    for limit in (enough, lambda _: True):
        found = NearOptimal().plan(full, limit)
        verdict = check_walk(lattice.steps, half.to_cover, found.cells, start)
        assert verdict.legal
        assert verdict.complete
        assert np.array_equal(found.cells[:HELD_CELLS], cut.cells[:HELD_CELLS])
        assert found.cost_s == TURNS.of_walk(found.cells)
    better = NearOptimal().plan(full, WorkLimit(SearchWork(proposals=2_000_000)))
    assert better.cost_s < 0.99 * NearOptimal().plan(rest, enough).cost_s
