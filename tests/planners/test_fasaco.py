"""What any walk of the colony must be, whatever it was asked."""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fasaco_edge.planners.colony import ColonyConfig
from fasaco_edge.planners.fasaco import LARGEST_GROUP, Fasaco
from fasaco_edge.planners.path import walk_figures
from fasaco_edge.planners.planner import never
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.stopping import TimeBudget, WorkLimit
from tests import naive
from tests.planners.grids import ROOMS, lattice, problems, reference

HALL = lattice(*["." * 40] * 30)


def assert_answers(problem, path):
    """The walk begins at the start, makes legal steps only and visits all it is asked to."""
    ground = problem.lattice
    walk = [ground.local(cell) for cell in path.cells.tolist()]
    around = naive.neighbours(ground.steps)
    assert walk[0] == ground.local(problem.start)
    assert all(there in around[here].values() for here, there in itertools.pairwise(walk))
    wanted = {tuple(cell) for cell in np.argwhere(problem.to_cover).tolist()}
    assert wanted <= set(walk)
    if problem.return_home:
        assert walk[-1] == walk[0]
    else:
        assert walk[-1] in wanted or len(walk) == 1
    assert path.cells.dtype == np.int32


@settings(max_examples=150, deadline=None)
@given(
    ground=problems(max_side=20),
    velocities=st.lists(st.integers(1, 64), min_size=1, max_size=5).map(tuple),
    return_home=st.booleans(),
    seed=st.integers(0, 2**63 - 1),
    covered=st.floats(0, 1),
)
def test_every_reachable_cell_is_covered_by_legal_steps(
    ground, velocities, return_home, seed, covered
):
    ground, start = ground
    done = np.random.default_rng(seed).random(ground.states.shape) < covered
    done[ground.local(start)] = False
    problem = CoverageProblem.of(ground, start, covered=done, return_home=return_home)
    path = Fasaco(ColonyConfig(ants=10, velocities=velocities, seed=seed)).plan(problem)
    assert_answers(problem, path)
    reachable = naive.distances(ground.steps, ground.local(start))
    for cell in itertools.product(*map(range, ground.states.shape)):
        wanted = bool(ground.coverable[cell]) and not done[cell]
        assert problem.to_cover[cell] == (wanted and cell in reachable)
        assert problem.unreachable[cell] == (wanted and cell not in reachable)


def plan(problem, stop=never, observe=lambda _: None, **config):
    config = ColonyConfig(**{"ants": 96, **config})
    return Fasaco(config).plan(problem, stop, observe)


def test_the_same_seed_gives_the_same_path_and_another_seed_another():
    problem = CoverageProblem.of(*ROOMS["rooms"])
    paths = {seed: plan(problem, seed=seed).cells.tobytes() for seed in range(8)}
    assert plan(problem, seed=3).cells.tobytes() == paths[3]
    assert len(set(paths.values())) >= 6


def test_a_longer_search_is_never_worse():
    problem = CoverageProblem.of(*ROOMS["rooms"], return_home=True)
    steps = [plan(problem, ants=200, velocities=(1,), stop=WorkLimit(1)).steps]
    steps.append(plan(problem, ants=200, velocities=(1,)).steps)
    assert steps[1] <= steps[0]


@pytest.mark.parametrize("groups", [1, 2, 5, 15])
def test_a_path_stopped_anywhere_is_complete_and_repeats_from_its_work(groups):
    problem = CoverageProblem.of(HALL, (3, 5), return_home=True)
    assert problem.cells == 1200
    looks = itertools.count(1)
    stopped = plan(problem, ants=400, seed=4, stop=lambda ants: next(looks) >= groups)
    # 400 ants are 50 in each cohort: groups end with their cohort.
    group = LARGEST_GROUP
    expected = [min(first + group, 50) + 50 * cohort for cohort in range(8)
                for first in range(0, 50, group)]  # fmt: skip
    assert stopped.ants == expected[groups - 1] < 400
    assert_answers(problem, stopped)
    again = plan(problem, ants=400, seed=4, stop=WorkLimit(stopped.ants))
    assert again.cells.tobytes() == stopped.cells.tobytes()
    assert again.ants == stopped.ants


@pytest.mark.parametrize("threads", [2, 3, 7])
def test_any_number_of_threads_finds_the_same_path(threads):
    problem = CoverageProblem.of(HALL, (3, 5))
    config = ColonyConfig(ants=100, seed=3)
    alone = Fasaco(config).plan(problem)
    together = Fasaco(config, threads).plan(problem)
    assert together.cells.tobytes() == alone.cells.tobytes()


def test_a_walk_that_needs_more_room_is_walked_again(monkeypatch):
    problem = CoverageProblem.of(HALL, (3, 5), return_home=True)
    config = ColonyConfig(ants=40, seed=3)
    roomy = Fasaco(config).plan(problem)
    monkeypatch.setattr("fasaco_edge.planners.fasaco.STEPS_PER_CELL", 0)
    assert Fasaco(config).plan(problem).cells.tobytes() == roomy.cells.tobytes()


def test_a_budget_that_is_gone_still_gives_a_whole_walk():
    problem = CoverageProblem.of(HALL, (0, 0))
    path = plan(problem, stop=TimeBudget(0.0))
    assert 0 < path.ants <= LARGEST_GROUP
    assert_answers(problem, path)


def test_the_stopping_criterion_hears_how_many_ants_have_walked():
    heard = []
    path = plan(CoverageProblem.of(HALL, (0, 0)), stop=lambda ants: bool(heard.append(ants)))
    assert heard == sorted(set(heard))
    assert heard[-1] == path.ants == 96


@pytest.mark.parametrize("room", ROOMS)
def test_the_observer_is_offered_one_snapshot_after_each_cohort(room):
    ground, start = ROOMS[room]
    snapshots = []
    path = plan(CoverageProblem.of(ground, start), observe=snapshots.append)
    assert [shot.cohort for shot in snapshots] == list(range(8))
    assert [shot.velocity for shot in snapshots] == [8, 7, 6, 5, 4, 3, 2, 1]
    assert [shot.ants for shot in snapshots] == list(range(12, 97, 12))
    steps = [shot.best_steps for shot in snapshots]
    assert steps == sorted(steps, reverse=True)
    assert steps[-1] == path.steps
    for shot in snapshots:
        assert shot.window == ground.window
        assert shot.trail.dtype == np.float32
        assert np.isfinite(shot.trail).all()
        assert (shot.trail[~ground.coverable] == 0).all()
        # Every move that can be made keeps some pheromone.
        assert (shot.trail[ground.steps != 0] > 0).all()
    assert len({id(shot.trail) for shot in snapshots}) == 8


def test_a_snapshot_shows_the_mean_trail_of_the_moves_into_a_cell():
    """One ant, q0 = 1: out of the corner it walks east along the row and back west."""
    snapshots = []
    config = {"ants": 1, "velocities": (1,), "q0": 1.0, "alpha": 0.5, "tau0": 0.1}
    plan(CoverageProblem.of(lattice("...", "#.#"), (1, 0)), observe=snapshots.append, **config)
    # Walk: (1,0) (1,1) (1,2) (1,1) (0,1): 4 cells, 4 steps, so delta phi is 1; the local
    # update keeps 0.1, the global one makes 0.55 of each move on the walk.
    into_middle = (0.55 + 0.55 + 0.1) / 3
    expected = np.array([[0, 0.55, 0], [0.1, into_middle, 0.55]], np.float32)
    assert snapshots[0].trail == pytest.approx(expected)


@settings(max_examples=100, deadline=None)
@given(ground=problems(), seed=st.integers(0, 100), return_home=st.booleans())
def test_figures_are_what_counting_gives(ground, seed, return_home):
    ground, start = ground
    problem = CoverageProblem.of(ground, start, return_home=return_home)
    path = plan(problem, ants=8, seed=seed)
    local = [ground.local(cell) for cell in path.cells.tolist()]
    counted = naive.figures(ground.steps, local)
    assert dataclasses.asdict(walk_figures(ground, path.cells)) == counted


@pytest.mark.parametrize(("name", "cells", "at_most"), [
    ("paper_simulated", 169, 70), ("paper_basement", 520, 299),
])  # fmt: skip
def test_the_paper_s_table_is_reached(name, cells, at_most):
    """Table I, FaSACO 8 -> 1: n_r 70 on the simulated map, 299 on the basement."""
    if (given_grid := reference(name)) is None:
        pytest.skip("the paper's grids are not at hand")
    ground, start = given_grid
    problem = CoverageProblem.of(ground, start, return_home=True)
    path = plan(problem, ants=1000)
    assert_answers(problem, path)
    figures = walk_figures(ground, path.cells)
    assert figures.cells == problem.cells == cells
    assert figures.n_r_paper == figures.revisits <= at_most
