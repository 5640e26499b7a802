"""The paper's planners beside FaSACO: what each promises, and what its authors measured."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.planners.cost import CoverageCost, SearchWork
from fasaco_edge.planners.paper.baselines import spiral_stc, stc, zigzag
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.paper.fasaco import Fasaco
from fasaco_edge.planners.path import walk_figures
from fasaco_edge.planners.planner import WorkLimit, ignore, never
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.registry import PLANNER_NAMES, planner_of
from tests import naive
from tests.support.examples import examples
from tests.support.grids import ENDS, assert_answers, end_of, problems, reference

# Ends the local search, which else goes on for long; the paper's planners make no proposals.
ENOUGH = WorkLimit(SearchWork(proposals=20_000))


@pytest.mark.parametrize("name", PLANNER_NAMES)
@examples(400)
@given(
    ground=problems(),
    end=ENDS,
    turn_s=st.sampled_from((0.0, 2.0)),
    covered=st.floats(0, 0.6),
    seed=st.integers(0, 1000),
)
def test_every_planner_covers_all_and_ends_where_asked(name, ground, end, turn_s, covered, seed):
    lattice, start = ground
    done = np.random.default_rng(seed).random(lattice.states.shape) < covered
    done[lattice.local(start)] = False
    end = end_of(end, lattice, start)
    cost = CoverageCost(1.2, turn_s)
    problem = CoverageProblem.of(lattice, start, covered=done, end=end, cost=cost)
    planner = planner_of(name, ColonyConfig(ants=8, seed=seed))
    path = planner.plan(problem, ENOUGH, ignore)
    assert path.planner == name
    assert_answers(problem, path)


@pytest.mark.parametrize(("planner", "rule"), [
    (spiral_stc(), naive.SPIRAL), (zigzag(), naive.ZIGZAG),
], ids=["spiral-stc", "zigzag"])  # fmt: skip
@examples(200)
@given(ground=problems(), end=ENDS)
def test_twin_sweeps_the_same_anywhere(planner, rule, ground, end):
    lattice, start = ground
    end = end_of(end, lattice, start)
    problem = CoverageProblem.of(lattice, start, end=end)
    end = None if end is None else lattice.local(end)
    walk = naive.sweep(lattice.steps, problem.to_cover, lattice.local(start), rule, end=end)
    window = lattice.window
    expected = [[row + window.row0, col + window.col0] for row, col in walk]
    assert planner.plan(problem).cells.tolist() == expected


@examples(300)
@given(ground=problems())
def test_twin_goes_around_the_same_tree(ground):
    lattice, start = ground
    problem = CoverageProblem.of(lattice, start, end=start)
    walk = naive.stc(lattice.steps, problem.to_cover, lattice.local(start))
    window = lattice.window
    expected = [[row + window.row0, col + window.col0] for row, col in walk]
    assert stc().plan(problem).cells.tolist() == expected


@examples(300)
@given(
    ground=problems(),
    end=st.integers(0, 80),
    turn_s=st.sampled_from((0.0, 3.0)),
    covered=st.floats(0, 0.9),
    seed=st.integers(0, 1000),
)
def test_twin_leads_the_tree_s_walk_to_the_same_end(ground, end, turn_s, covered, seed):
    lattice, start = ground
    end = end_of(end, lattice, start)
    assume(end != start)
    done = np.random.default_rng(seed).random(lattice.states.shape) < covered
    done[lattice.local(start)] = False
    cost = CoverageCost(1.0, turn_s)
    problem = CoverageProblem.of(lattice, start, covered=done, end=end, cost=cost)
    local, around = lattice.local(start), naive.distances(lattice.steps, lattice.local(start))
    ground = np.zeros(lattice.states.shape, bool)
    ground[tuple(zip(*around, strict=True))] = True
    closed = naive.stc(lattice.steps, ground, local)
    walk = naive.stc_led_to_end(
        lattice.steps, problem.to_cover, closed, lattice.local(end), problem.cost
    )
    window = lattice.window
    expected = [[row + window.row0, col + window.col0] for row, col in walk]
    assert stc().plan(problem).cells.tolist() == expected


@examples(300)
@given(blocks=st.lists(st.lists(st.booleans(), min_size=4, max_size=4), min_size=1, max_size=5))
def test_stc_visits_every_cell_once_where_all_blocks_are_whole(blocks):
    """Gabriely and Rimon's theorem: a Hamiltonian cycle."""
    whole = np.kron(np.array(blocks), np.ones((2, 2), bool)).astype(bool)
    if not whole.any():
        return
    ground = CoverageLattice.from_free(whole)
    start = tuple(np.argwhere(whole)[0].tolist())
    problem = CoverageProblem.of(ground, start, end=start)
    path = stc().plan(problem)
    assert path.steps == problem.cells


@pytest.mark.parametrize(
    ("name", "planner", "most"),
    [
        # What the authors' code drives, start to start; see tests/benchmarks/RESULTS.md.
        ("paper_simulated", "spiral-stc", 80),
        ("paper_basement", "spiral-stc", 249),
        ("paper_simulated", "zigzag", 84),
        ("paper_basement", "zigzag", 271),
    ],
)
def test_baselines_are_as_good_as_the_authors_own(name, planner, most):
    found = reference(name)
    if found is None:
        pytest.skip("the paper's grids are not at hand")
    ground, start = found
    problem = CoverageProblem.of(ground, start, end=start)
    path = planner_of(planner, ColonyConfig()).plan(problem, never, ignore)
    assert walk_figures(ground, path.cells).revisits <= most


def test_ants_that_see_open_neighbours_revisit_less():
    """Why the option exists; the paper's own ants see 1 everywhere."""
    hall = CoverageLattice.from_free(np.kron(np.ones((6, 6)), [[1, 1, 1], [1, 0, 1]]).astype(bool))
    problem = CoverageProblem.of(hall, (0, 0))
    plain, seeing = (
        np.median([
            Fasaco(ColonyConfig(ants=64, seed=seed, visibility=visibility)).plan(problem).steps
            for seed in range(5)
        ])
        for visibility in ("neighbour", "fewest-open")
    )  # fmt: skip
    assert seeing < plain
