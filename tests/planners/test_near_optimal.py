"""The colony with local search: optimal on small grounds, sound, repeatable, and soon stopped."""

import heapq
import itertools
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fasaco_edge.bench.buildings import building
from fasaco_edge.bench.checking import check_walk
from fasaco_edge.bench.grids import read_grid
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.map_files import builtin_maps
from fasaco_edge.planners import regions, search
from fasaco_edge.planners.bound import lower_bound_steps
from fasaco_edge.planners.colony import ColonyConfig
from fasaco_edge.planners.cost import STEPS_ALONE, CoverageCost
from fasaco_edge.planners.near_optimal import NearOptimal
from fasaco_edge.planners.planner import never
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.stopping import AnyOf, GapReached, Interrupt, WorkLimit
from fasaco_edge.planners.work import SearchWork
from tests import naive
from tests.kernels.test_bound import drawn_task, shortest_walks
from tests.planners.grids import ENDS, ROOMS, end_of, lattice, placed, problems

ROOT = Path(__file__).parents[2]
TURNS = CoverageCost(1.0, 1.5)
FEW_ANTS = ColonyConfig(ants=8, velocities=(2, 1))


def looks(count):
    """Stop when asked for the so manieth time."""
    asked = itertools.count(1)
    return lambda progress: next(asked) >= count


def after(kicks=0, proposals=0, ants=0):
    return WorkLimit(SearchWork(ants=ants, kicks=kicks, proposals=proposals))


def plan(problem, stop=never, config=FEW_ANTS, threads=1):
    """Plan, let an independent judge look at the walk, and recount what comes with it."""
    path = NearOptimal(config, threads).plan(problem, stop)
    ground, window = problem.lattice, problem.lattice.window
    walk = path.cells - (window.row0, window.col0)
    end = None if problem.end is None else ground.local(problem.end)
    verdict = check_walk(ground.steps, problem.to_cover, walk, ground.local(problem.start), end)
    assert verdict.problems == ()
    quarters = verdict.turns_90 + 2 * verdict.turns_180
    cost = problem.cost
    assert path.cost_s == (path.steps * cost.step_us + quarters * cost.quarter_turn_us) / 1e6
    assert path.lower_bound_steps == lower_bound_steps(problem) <= path.steps
    assert path.cells.dtype == np.int32
    return path


def cheapest_turning_walk(steps, cells, end, cost):
    """The least a covering walk costs [us]: Dijkstra over cell, heading and cells visited."""
    around = naive.neighbours(steps)
    bit = {cell: 1 << index for index, cell in enumerate(cells)}
    queue, done = [(0, cells[0], None, bit[cells[0]])], set()
    while queue:
        cost_us, here, heading, seen = heapq.heappop(queue)
        if (here, heading, seen) in done:
            continue
        done.add((here, heading, seen))
        if seen == (1 << len(cells)) - 1 and end in (None, here):
            return cost_us
        for direction, there in around[here].items():
            turn = 0
            if heading not in (None, direction):
                back = direction == (-heading[0], -heading[1])
                turn = (1 + back) * cost.quarter_turn_us
            entry = cost_us + cost.step_us + turn, there, direction, seen | bit.get(there, 0)
            heapq.heappush(queue, entry)
    raise ValueError("the end cannot be reached")


def small_problem(random, cost, most=12):
    """A problem small enough to be solved by trying all orders; its cells, and its least cost."""
    ground, cells, reachable = drawn_task(random, most)
    covered = ~ground.coverable
    for row, col in reachable:
        covered[row, col] = (row, col) not in cells
    kind = random.integers(3)
    end = (None, cells[0], reachable[random.integers(len(reachable))])[kind]
    row0, col0 = (0, 0) if random.random() < 0.5 else (-7, 30)
    moved = placed(ground, row0, col0)
    start = cells[0][0] + row0, cells[0][1] + col0
    goal = None if end is None else (end[0] + row0, end[1] + col0)
    problem = CoverageProblem.of(moved, start, covered=covered, end=goal, cost=cost)
    if not cost.quarter_turn_us:
        walks = shortest_walks(ground.steps, cells)
        return problem, (min(walks.values()) if end is None else walks[end]) * cost.step_us
    return problem, cheapest_turning_walk(ground.steps, cells, end, cost)


@pytest.mark.parametrize(
    ("cost", "grids", "most"), [(STEPS_ALONE, 200, 12), (TURNS, 50, 8)], ids=["steps", "turns"]
)
def test_on_small_grounds_it_finds_the_optimum_and_never_less(cost, grids, most):
    random = np.random.default_rng(77)
    met = []
    for _ in range(grids):
        problem, least_us = small_problem(random, cost, most)
        path = plan(problem, after(kicks=2000))
        assert path.cost_s >= least_us / 1e6
        met.append(path.cost_s == least_us / 1e6)
    assert np.mean(met) >= 0.95


@settings(max_examples=100, deadline=None)
@given(
    ground=problems(max_side=12),
    end=ENDS,
    cost=st.sampled_from((STEPS_ALONE, TURNS, CoverageCost(0.001, 3600.0), CoverageCost(3600, 0))),
    covered=st.sampled_from((0.0, 0.3, 0.9)),
    looked=st.integers(1, 40),
    seed=st.integers(0, 2**63 - 1),
)
def test_wherever_it_is_stopped_the_walk_is_sound_and_repeats_from_its_work(
    ground, end, cost, covered, looked, seed
):
    ground, start = ground
    done = np.random.default_rng(seed).random(ground.states.shape) < covered
    done[ground.local(start)] = False
    problem = CoverageProblem.of(
        ground, start, covered=done, end=end_of(end, ground, start), cost=cost
    )
    config = ColonyConfig(ants=4, velocities=(2, 1), seed=seed)
    path = plan(problem, AnyOf(looks(looked), after(kicks=500)), config)
    assert_repeats(problem, path, config)


def assert_repeats(problem, path, config, threads=1):
    again = plan(problem, WorkLimit(path.work), config, threads)
    assert again.cells.tobytes() == path.cells.tobytes()
    assert again.work == path.work
    assert again.cost_s == path.cost_s


# Where a search stands: at the first walk, on its way through the first improvement,
# between kicks, behind the second group of ants, at its end.
STOPS = {
    "first walk": looks(1),
    "improving": after(proposals=20_000),
    "kicks": after(kicks=100),
    "ants": after(ants=20),
    "in between": looks(33),
}


@pytest.mark.parametrize("cost", [STEPS_ALONE, TURNS], ids=["steps", "turns"])
@pytest.mark.parametrize("stop", STOPS)
def test_any_number_of_threads_and_any_repetition_find_the_same_path(stop, cost, monkeypatch):
    monkeypatch.setattr(search, "PROPOSALS_AT_ONCE", 3_000)
    problem = CoverageProblem.of(*ROOMS["rooms"], end=(4, 9), cost=cost)
    config = ColonyConfig(ants=96, velocities=(2, 1), seed=5)
    stop = {**STOPS, "first walk": looks(1), "in between": looks(33)}[stop]
    path = plan(problem, stop, config)
    for threads in (1, 2):
        assert_repeats(problem, path, config, threads)


def test_the_same_seed_gives_the_same_path_and_another_seed_another():
    problem = CoverageProblem.of(*ROOMS["rooms"], cost=TURNS)
    paths = {
        seed: plan(problem, after(proposals=10_000), ColonyConfig(seed=seed)).cells.tobytes()
        for seed in range(6)
    }
    again = plan(problem, after(proposals=10_000), ColonyConfig(seed=4))
    assert again.cells.tobytes() == paths[4]
    assert len(set(paths.values())) >= 5


class Watched:
    """Stop when another criterion says so, and remember what the search said of itself."""

    def __init__(self, stop):
        self.stop, self.seen = stop, []

    def __call__(self, progress):
        self.seen.append(progress)
        return self.stop(progress)

    def assert_steady(self):
        """No cost rises, and at every look more is done than at the last."""
        for one, other in itertools.pairwise(self.seen):
            assert other.cost_s <= one.cost_s
            assert other.steps <= one.steps or other.cost_s < one.cost_s
            assert other.work.reaches(one.work)
            assert other.work != one.work


@pytest.fixture
def small_regions(monkeypatch):
    """Grounds of some hundred cells are taken apart into regions."""
    monkeypatch.setattr(regions, "ONE_REGION", 100)
    monkeypatch.setattr(regions, "EDGE", 12)
    monkeypatch.setattr(search, "EDGE", 12)
    monkeypatch.setattr(search, "PROPOSALS_AT_ONCE", 3_000)


def hall(end=None, cost=STEPS_ALONE, covered=0.0):
    grid = building(1_000, 3)
    ground, start = grid.lattice, grid.start
    done = np.random.default_rng(3).random(ground.states.shape) < covered
    done[ground.local(start)] = False
    return CoverageProblem.of(ground, start, end=start if end else None, cost=cost, covered=done)


@pytest.mark.parametrize("end", [None, "home"])
@pytest.mark.parametrize("covered", [0.0, 0.7])
@pytest.mark.parametrize("cost", [STEPS_ALONE, TURNS], ids=["steps", "turns"])
@pytest.mark.parametrize("looked", [1, 7, 100, 2000])
def test_in_regions_it_is_as_sound_and_as_repeatable(small_regions, looked, cost, covered, end):
    problem, config = hall(end, cost, covered), ColonyConfig(ants=8, velocities=(1,), seed=1)
    watched = Watched(looks(looked))
    path = plan(problem, watched, config)
    assert len(watched.seen) == looked
    watched.assert_steady()
    assert path.cost_s <= watched.seen[-1].cost_s
    if not cost.quarter_turn_us:
        # What was gained in the region it was stopped in was known before.
        assert path.cost_s == watched.seen[-1].cost_s
    assert_repeats(problem, path, config)
    if looked == 2000:
        assert path.cost_s < 0.93 * watched.seen[0].cost_s


@pytest.mark.parametrize("cost", [STEPS_ALONE, TURNS], ids=["steps", "turns"])
@pytest.mark.parametrize("room", ROOMS)
def test_a_search_ends_by_itself_and_that_repeats_too(room, cost):
    ground, start = ROOMS[room]
    problem = CoverageProblem.of(ground, start, end=start, cost=cost)
    watched = Watched(never)
    path = plan(problem, watched)
    watched.assert_steady()
    # Proven to be the best, or all of the colony has walked.
    walked = path.work.ants - (4 if cost.quarter_turn_us else 1)
    assert walked == FEW_ANTS.ants or path.steps == path.lower_bound_steps
    assert_repeats(problem, path, FEW_ANTS)


def test_an_interrupt_in_a_region_leaves_the_best_walk_so_far(small_regions):
    problem, interrupt = hall(), Interrupt()
    watched = Watched(interrupt)

    def in_the_fourth_region(progress):
        if progress.work.proposals >= 40_000:
            interrupt.asked.set()
        return watched(progress)

    path = plan(problem, in_the_fourth_region)
    first, last = watched.seen[0], watched.seen[-1]
    assert path.cost_s == last.cost_s < first.cost_s
    assert path.work == last.work
    assert last.work.proposals < 50_000


def test_a_target_gap_ends_the_search_as_soon_as_it_is_reached(monkeypatch):
    monkeypatch.setattr(search, "PROPOSALS_AT_ONCE", 3_000)
    problem = hall()
    watched = Watched(GapReached(0.03))
    path = plan(problem, watched)
    assert path.gap <= 0.03
    assert [progress.gap <= 0.03 for progress in watched.seen] == (
        [False] * (len(watched.seen) - 1) + [True]
    )
    assert len(watched.seen) > 2


@pytest.mark.parametrize("cost", [STEPS_ALONE, TURNS], ids=["steps", "turns"])
def test_it_is_asked_often_whether_to_stop(cost):
    """Counted in proposals, of which a millisecond has some thirty thousand."""
    grid = building(5_000, 1)
    problem = CoverageProblem.of(grid.lattice, grid.start, cost=cost)
    watched = Watched(after(kicks=20))
    plan(problem, watched)
    done = [progress.work.proposals for progress in watched.seen]
    assert max(np.diff(done)) <= 200_000
    assert len(watched.seen) > 30


@pytest.mark.parametrize("cost", [TURNS, CoverageCost(0.001, 3600.0)], ids=str)
def test_one_cell_needs_no_search(cost):
    path = plan(CoverageProblem.of(lattice("#.#"), (0, 1), cost=cost))
    assert (path.steps, path.cost_s, path.work.kicks) == (0, 0.0, 0)


@pytest.mark.parametrize("cost", [STEPS_ALONE, TURNS], ids=["steps", "turns"])
def test_cells_far_apart_make_a_long_walk(cost):
    """What is left over in three corners: a walk of many times as many steps as cells."""
    covered = np.ones((30, 60), bool)
    covered[0, 59] = covered[29, 59] = covered[29, 0] = False
    open_floor = CoverageLattice.from_free(np.ones((30, 60), bool))
    problem = CoverageProblem.of(open_floor, (0, 0), covered=covered, cost=cost)
    path = plan(problem, after(kicks=200))
    assert path.steps == 29 + 59 + 29
    assert path.cost_s == 117 * cost.step_s + 2 * cost.quarter_turn_s


def ring(cost):
    """Two cells left over on a ring that is a hundred times as long as the way between them."""
    free = np.ones((40, 60), bool)
    free[1:39, 1:59] = False
    covered = np.ones((40, 60), bool)
    covered[0, 10] = covered[0, 12] = False
    ground = CoverageLattice.from_free(free)
    return CoverageProblem.of(ground, (0, 11), covered=covered, end=(0, 11), cost=cost)


def test_a_loop_may_be_longer_than_any_walk():
    path = plan(ring(TURNS), after(kicks=300))
    assert path.steps == 4


@pytest.mark.parametrize(
    "cost",
    [
        CoverageCost(0.001, 3600.0),
        CoverageCost(3600.0, 3600.0),
        CoverageCost(3600.0, 0.000001),
        CoverageCost(0.001, 0.0),
    ],
    ids=str,
)
def test_extreme_costs_are_counted_to_the_microsecond(cost):
    problem = hall("home", cost)
    watched = Watched(after(kicks=150))
    path = plan(problem, watched)
    watched.assert_steady()
    assert path.cost_s < watched.seen[0].cost_s


@pytest.mark.parametrize("home", [False, True], ids=["open", "home"])
@pytest.mark.parametrize("name", [name for name, _ in builtin_maps()])
def test_the_maps_that_come_along_are_covered_almost_without_revisits(name, home):
    grid = read_grid(name)
    end = grid.start if home else None
    problem = CoverageProblem.of(grid.lattice, grid.start, end=end)
    path = plan(problem, after(kicks=50))
    assert path.gap < 0.02


def test_who_observes_sees_the_trail_and_changes_nothing():
    problem, seen = CoverageProblem.of(*ROOMS["rooms"]), []
    config = ColonyConfig(ants=32, seed=2)
    path = NearOptimal(config).plan(problem, after(kicks=10), seen.append)
    assert path.cells.tobytes() == plan(problem, after(kicks=10), config).cells.tobytes()
    (snapshot,) = seen
    assert snapshot.best_steps == path.steps
    assert snapshot.ants == path.work.ants
    walked = tuple(path.cells[1:-1].T)
    assert snapshot.trail[walked].min() > config.tau0


TWIN = """
import hashlib
from fasaco_edge.planners import regions, search
from tests.planners import test_near_optimal as module

regions.ONE_REGION, regions.EDGE, search.EDGE = 60, 6, 6
for path in module.twin_paths():
    print(path.work.ants, path.work.kicks, path.work.proposals, path.cells.tolist())
"""


def twin_paths():
    """Walks of every part of the search, with so little work that plain Python can do it."""
    comb, square = ROOMS["comb"], ROOMS["square"]
    for cost in (STEPS_ALONE, TURNS, CoverageCost(0.001, 3600.0), CoverageCost(3600.0, 3600.0)):
        yield plan(CoverageProblem.of(*comb, end=comb[1], cost=cost), after(kicks=12))
        yield plan(CoverageProblem.of(*square, end=(0, 1), cost=cost), after(kicks=12))
        yield plan(ring(cost), after(kicks=12))
        # In regions.
        yield plan(CoverageProblem.of(*ROOMS["rooms"], cost=cost), after(kicks=30))


def test_twin_without_the_compiler_finds_the_same_paths():
    """What is fine as machine code may overflow or fail in plain Python, and the reverse."""
    if os.environ.get("NUMBA_DISABLE_JIT") == "1":
        pytest.skip("this is the run without the compiler")
    printed = [
        subprocess.run(
            [sys.executable, "-W", "error", "-c", TWIN],
            cwd=ROOT,
            env={**os.environ, "NUMBA_DISABLE_JIT": disabled},
            capture_output=True,
            text=True,
            check=False,
            timeout=100,
        )
        for disabled in "01"
    ]
    assert printed[0].stdout
    assert [done.stderr for done in printed] == ["", ""]
    assert printed[0].stdout == printed[1].stdout
