"""What any walk of the colony must be, whatever it was asked."""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.planners.cost import CoverageCost, SearchWork
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.paper.fasaco import LARGEST_GROUP, Fasaco
from fasaco_edge.planners.path import walk_figures
from fasaco_edge.planners.planner import SearchProgress, WorkLimit, never
from fasaco_edge.planners.problem import CoverageProblem
from tests import naive
from tests.support import grids
from tests.support.examples import examples
from tests.support.grids import ENDS, ROOMS, end_of, lattice, problems, reference

HALL = lattice(*["." * 40] * 30)


def assert_answers(problem, path):
    """A walk as of any planner, which ends as soon as it has visited all it is asked to."""
    grids.assert_answers(problem, path)
    if problem.end is None and len(path.cells) > 1:
        assert problem.to_cover[problem.lattice.local(path.cells[-1].tolist())]


@examples(150)
@given(
    ground=problems(max_side=20),
    velocities=st.lists(st.integers(1, 64), min_size=1, max_size=5).map(tuple),
    end=ENDS,
    seed=st.integers(0, 2**63 - 1),
    covered=st.floats(0, 1),
)
def test_every_reachable_cell_is_covered_by_legal_steps(ground, velocities, end, seed, covered):
    ground, start = ground
    done = np.random.default_rng(seed).random(ground.states.shape) < covered
    done[ground.local(start)] = False
    problem = CoverageProblem.of(ground, start, covered=done, end=end_of(end, ground, start))
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


@pytest.mark.parametrize("groups", [1, 2, 5, 15])
def test_a_path_stopped_anywhere_is_complete_and_reproducible(groups):
    problem = CoverageProblem.of(HALL, (3, 5), end=(3, 5))
    assert problem.cells == 1200
    looks = itertools.count(1)
    stopped = plan(problem, ants=400, seed=4, stop=lambda progress: next(looks) >= groups)
    # 400 ants are 50 in each cohort: groups end with their cohort.
    group = LARGEST_GROUP
    expected = [min(first + group, 50) + 50 * cohort for cohort in range(8)
                for first in range(0, 50, group)]  # fmt: skip
    assert stopped.work.ants == expected[groups - 1] < 400
    assert_answers(problem, stopped)
    again = plan(problem, ants=400, seed=4, stop=WorkLimit(stopped.work))
    assert again.cells.tobytes() == stopped.cells.tobytes()
    assert again.work == stopped.work
    assert again.cost_s == stopped.cost_s


@pytest.mark.parametrize("threads", [2, 3, 7])
def test_any_number_of_threads_finds_the_same_path(threads):
    problem = CoverageProblem.of(HALL, (3, 5))
    config = ColonyConfig(ants=100, seed=3)
    alone = Fasaco(config).plan(problem)
    together = Fasaco(config, threads).plan(problem)
    assert together.cells.tobytes() == alone.cells.tobytes()


def test_the_stopping_criterion_gets_the_progress():
    heard = []
    problem = CoverageProblem.of(*ROOMS["rooms"], cost=CoverageCost(0.5, 2.0))
    listen = {"stop": lambda progress: bool(heard.append(progress))}
    path = plan(problem, **listen, velocities=(1,), seed=3)
    ants = [progress.work.ants for progress in heard]
    assert ants == sorted(set(ants))
    costs = [progress.cost_s for progress in heard]
    assert costs == sorted(costs, reverse=True)
    assert len(set(costs)) == len(costs) == 3
    assert heard[-1] == SearchProgress(SearchWork(ants=96), path.cost_s, path.steps)
    assert path.work.ants == 96


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


@pytest.mark.parametrize(("turn_s", "delta_phi"), [(0.0, 1.0), (1.5, 0.4)])
def test_a_snapshot_has_the_mean_trail_of_the_moves_into_a_cell(turn_s, delta_phi):
    """One ant, q0 = 1: out of the corner it walks east along the row and back west."""
    snapshots = []
    config = {"ants": 1, "velocities": (1,), "q0": 1.0, "alpha": 0.5, "tau0": 0.1}
    cost = CoverageCost(0.75, turn_s)
    problem = CoverageProblem.of(lattice("...", "#.#"), (1, 0), cost=cost)
    plan(problem, observe=snapshots.append, **config)
    # Walk: (1,0) (1,1) (1,2) (1,1) (0,1): 4 cells, 4 steps, and a half turn and a quarter, which
    # are as much as 6 steps or nothing. So delta phi is 4 / 4 or 4 / 10; the local update
    # keeps 0.1, the global one pulls each move on the walk half of the way.
    walked = 0.5 * 0.1 + 0.5 * delta_phi
    into_middle = (walked + walked + 0.1) / 3
    expected = np.array([[0, walked, 0], [0.1, into_middle, walked]], np.float32)
    assert snapshots[0].trail == pytest.approx(expected)


@examples(100)
@given(ground=problems(), seed=st.integers(0, 100), end=ENDS)
def test_figures_are_what_counting_gives(ground, seed, end):
    ground, start = ground
    problem = CoverageProblem.of(ground, start, end=end_of(end, ground, start))
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
    problem = CoverageProblem.of(ground, start, end=start)
    path = plan(problem, ants=1000)
    assert_answers(problem, path)
    figures = walk_figures(ground, path.cells)
    assert figures.cells == problem.cells == cells
    assert figures.n_r_paper == figures.revisits <= at_most
