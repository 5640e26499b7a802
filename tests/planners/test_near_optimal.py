"""The colony with local search finds the best walks there are, where these are known."""

import heapq
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.map_files import builtin_maps
from fasaco_edge.planners.cost import STEPS_ALONE, CoverageCost
from fasaco_edge.planners.grids import read_grid
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.search import current_walk, regions
from tests import naive
from tests.kernels.test_bound import drawn_task, shortest_walks
from tests.planners.searches import TURNS, Watched, after, hall, plan
from tests.support.grids import ROOMS, lattice, placed

ROOT = Path(__file__).parents[2]


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
        path = plan(problem, after(perturbations=2000))
        assert path.cost_s >= least_us / 1e6
        met.append(path.cost_s == least_us / 1e6)
    assert np.mean(met) >= 0.95


@pytest.mark.parametrize("home", [False, True], ids=["open", "home"])
@pytest.mark.parametrize("name", [name for name, _ in builtin_maps()])
def test_the_bundled_maps_are_covered_almost_without_revisits(name, home):
    grid = read_grid(name)
    end = grid.start if home else None
    problem = CoverageProblem.of(grid.lattice, grid.start, end=end)
    path = plan(problem, after(perturbations=50))
    assert path.gap < 0.02


@pytest.mark.parametrize("cost", [TURNS, CoverageCost(0.001, 3600.0)], ids=str)
def test_one_cell_needs_no_search(cost):
    path = plan(CoverageProblem.of(lattice("#.#"), (0, 1), cost=cost))
    assert (path.steps, path.cost_s, path.work.perturbations) == (0, 0.0, 0)


@pytest.mark.parametrize("cost", [STEPS_ALONE, TURNS], ids=["steps", "turns"])
@pytest.mark.parametrize("shape", [(30, 60), (260, 260)], ids=["one region", "many"])
def test_cells_far_apart_make_a_long_walk(shape, cost):
    """What is left over in three corners: a walk of many times as many steps as cells."""
    rows, cols = shape
    covered = np.ones(shape, bool)
    covered[0, -1] = covered[-1, -1] = covered[-1, 0] = False
    open_floor = CoverageLattice.from_free(np.ones(shape, bool))
    problem = CoverageProblem.of(open_floor, (0, 0), covered=covered, cost=cost)
    path = plan(problem, after(perturbations=200))
    assert path.steps == 2 * (rows - 1) + cols - 1
    assert path.cost_s == path.steps * cost.step_s + 2 * cost.quarter_turn_s


def ring(cost):
    """Two cells left over on a ring that is a hundred times as long as the way between them."""
    free = np.ones((40, 60), bool)
    free[1:39, 1:59] = False
    covered = np.ones((40, 60), bool)
    covered[0, 10] = covered[0, 12] = False
    ground = CoverageLattice.from_free(free)
    return CoverageProblem.of(ground, (0, 11), covered=covered, end=(0, 11), cost=cost)


def test_a_loop_may_be_longer_than_any_walk():
    path = plan(ring(TURNS), after(perturbations=300))
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
    problem = hall(True, cost)
    watched = Watched(after(perturbations=150))
    path = plan(problem, watched)
    watched.assert_steady()
    assert path.cost_s < watched.seen[0].cost_s


TWIN = """
from tests.planners import test_near_optimal as module
module.print_twin_paths()
"""


def twin_paths():
    """Walks of every part of the search, with so little work that plain Python can do it."""
    comb, square = ROOMS["comb"], ROOMS["square"]
    for cost in (STEPS_ALONE, TURNS, CoverageCost(3600.0, 3600.0)):
        yield plan(CoverageProblem.of(*comb, end=comb[1], cost=cost), after(perturbations=12))
        yield plan(CoverageProblem.of(*square, end=(0, 1), cost=cost), after(perturbations=12))
        yield plan(ring(cost), after(perturbations=12))
        # In regions.
        yield plan(CoverageProblem.of(*ROOMS["rooms"], cost=cost), after(perturbations=30))


def print_twin_paths():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(regions, "ONE_REGION", 60)
        patch.setattr(regions, "EDGE", 6)
        patch.setattr(current_walk, "EDGE", 6)
        for path in twin_paths():
            print(path.work, path.cells.tolist())


def test_twin_without_the_compiler_finds_the_same_paths(capsys):
    """What is fine as machine code may overflow or fail in plain Python, and the reverse."""
    if os.environ.get("NUMBA_DISABLE_JIT") == "1":
        pytest.skip("this is the run without the compiler")
    twin = subprocess.run(
        [sys.executable, "-W", "error", "-c", TWIN],
        cwd=ROOT,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
        timeout=400,
    )
    assert twin.stderr == ""
    print_twin_paths()
    printed = capsys.readouterr().out
    assert printed.count("SearchWork") == 12
    assert twin.stdout == printed
