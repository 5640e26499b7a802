"""Windows of a walk against least costs, and the walk's soundness after each of them."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.windows.window import LINES, PLACES
from fasaco_edge.planners.bound import THOROUGH, LowerBound
from fasaco_edge.planners.cost import CoverageCost, Lanes
from fasaco_edge.planners.paper.baselines import first_walks
from fasaco_edge.planners.problem import CoverageProblem, FramedGround, graph_of
from fasaco_edge.planners.search.walk_region import stream_of
from fasaco_edge.planners.search.windows import WindowSearch, thinned
from tests.benchmarks.judge import check_walk
from tests.campaigns.turn_bound import drawn_problem, least_cost_us

PLENTY = 5_000
LANES = get_args(Lanes)


def search_of(problem):
    """Windows on the first walk of a problem."""
    framed, bound = FramedGround.of(problem), LowerBound(problem)
    bound.tighten(THOROUGH)
    search = WindowSearch(problem, framed, bound)
    walk = framed.framed(next(iter(first_walks(problem, graph_of(problem)))))
    return search, framed, walk


def assert_sound(problem, framed, search):
    """The best walk is a walk over all that is to be covered, and costs what is said."""
    walk = framed.unframed(search.walk())
    assert problem.cost_us(walk) == search.best_us
    lattice, end = problem.lattice, problem.end
    cells = problem.cells_of(walk) - (lattice.window.row0, lattice.window.col0)
    at = None if end is None else lattice.local(end)
    wanted = problem.to_cover
    verdict = check_walk(lattice.steps, wanted, cells, lattice.local(problem.start), at)
    assert verdict.problems == ()


def test_a_window_of_the_whole_ground_finds_the_optimum():
    random = np.random.default_rng(11)
    solved = 0
    for trial in range(150):
        problem = drawn_problem(random)
        least_us = least_cost_us(problem)
        if not least_us:
            continue
        search, framed, walk = search_of(problem)
        if not search.load(walk):
            continue
        for _ in search.solve_whole(PLENTY, trial & (LINES | PLACES), stream_of(1)):
            pass
        assert_sound(problem, framed, search)
        # A walk is read as one that takes no step three times: so is a best one, nearly always.
        assert search.best_us >= least_us
        solved += search.best_us == least_us
    assert solved >= 125


def test_a_whole_ground_with_a_narrow_beam_still_gives_one_walk():
    # A beam of 8 over rooms with notches comes apart into rings, which windows join.
    random = np.random.default_rng(2)
    better = 0
    for trial in range(6):
        floor = np.kron(random.random((9, 11)) < 0.8, np.ones((3, 3), bool))
        floor[:3, :3] = True
        end = (0, 0) if trial % 2 else None
        ground = CoverageLattice.from_free(floor)
        problem = CoverageProblem.of(ground, (0, 0), end=end, cost=CoverageCost(1.0, 50.0))
        search, framed, walk = search_of(problem)
        assert search.load(walk)
        begun_us = search.best_us
        for _ in search.solve_whole(8, trial & (LINES | PLACES), stream_of(trial)):
            pass
        assert_sound(problem, framed, search)
        better += search.best_us < 0.9 * begun_us
    assert better == 6


@pytest.mark.parametrize("lanes", LANES)
@pytest.mark.parametrize("price", [0.5, 1.25, 5.0, 50.0])
@pytest.mark.parametrize("kind", ["anywhere", "home", "elsewhere", "half covered"])
def test_windows_leave_a_whole_walk_and_find_better_ones(kind, price, lanes):
    random = np.random.default_rng(5)
    floor = random.random((14, 17)) < 0.9
    floor[0, 0] = floor[0, 1] = True
    ground = CoverageLattice.from_free(floor)
    reachable = CoverageProblem.of(ground, (0, 0)).to_cover
    last = tuple(np.argwhere(reachable)[-1].tolist())
    end = {"home": (0, 0), "elsewhere": last}.get(kind)
    covered = np.zeros(floor.shape, bool)
    covered[:7] = kind == "half covered"
    cost = CoverageCost(1.0, price).along(lanes)
    problem = CoverageProblem.of(ground, (0, 0), covered=covered, end=end, cost=cost)
    assert_improves(problem)


def assert_improves(problem):
    search, framed, walk = search_of(problem)
    assert search.load(walk)
    costs, stream = [search.best_us], stream_of(3)
    for _ in range(40):
        search.solve(500, stream)
        assert_sound(problem, framed, search)
        costs.append(search.best_us)
    assert costs == sorted(costs, reverse=True)
    assert costs[-1] < costs[0]


def test_a_walk_that_takes_a_step_three_times_is_thinned():
    # Between 0 and 1 there and back, and there again.
    walk = np.array([0, 1, 0, 1, 2, 1, 0, 10], np.int32)
    found = thinned(walk)
    assert (found[0], found[-1]) == (0, 10)
    assert set(found.tolist()) == {0, 1, 2, 10}
    moves = [tuple(sorted(pair)) for pair in zip(found.tolist(), found[1:].tolist(), strict=False)]
    assert max(moves.count(move) for move in moves) <= 2
    assert all(abs(one - other) in (1, 10) for one, other in moves)


@pytest.mark.parametrize("end", [None, (0, 0)])
def test_windows_count_steps_into_other_rooms(end):
    random = np.random.default_rng(6)
    floor = random.random((13, 16)) < 0.93
    floor[0, 0] = True
    ground = CoverageLattice.from_free(floor)
    cost = CoverageCost(1.0, 1.25, room_s=4.0)
    problem = CoverageProblem.of(ground, (0, 0), end=end, cost=cost)
    rows, cols = np.indices(floor.shape)
    problem = replace(problem, rooms=(1 + rows // 5 + 3 * (cols // 6)).astype(np.uint16))
    assert_improves(problem)
