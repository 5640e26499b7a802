"""FaSACO that goes on: ants on the living trail, as many as the change is large."""

from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.planners.living_trail import PAPERS_RULES, LivingTrail
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.paper.fasaco import FEWEST_ANTS, Fasaco, ants_for
from fasaco_edge.planners.problem import CoverageProblem
from tests.benchmarks.judge import check_walk

COLONY = ColonyConfig(ants=400, velocities=(4, 2, 1))


def hall(cols):
    """A hall with pillars, of which so many columns are known."""
    free = np.ones((12, 16), bool)
    free[3:9:3, 3:14:3] = False
    free[:, cols:] = False
    return CoverageLattice.from_free(free)


def trail_of(lattice, *walks):
    """The trail after some paths were published."""
    trail = LivingTrail(PAPERS_RULES)
    trail.follow(lattice.window, lattice.steps, None)
    for walk in walks:
        trail.strengthen(walk, 0.9)
    return trail.snapshot()


def going_on(cols=14, times=8):
    """The problem of a hall of which more has come into sight, and the walk before."""
    known = CoverageProblem.of(hall(12), (0, 0))
    walk = Fasaco(COLONY).plan(known).cells
    problem = CoverageProblem.of(hall(cols), (0, 0), before=walk)
    return replace(problem, trail=trail_of(problem.lattice, *[walk] * times)), walk


def test_the_number_of_ants_follows_the_new_cells():
    problem, walk = going_on()
    on_walk = {tuple(cell) for cell in walk.tolist()}
    to_cover = {tuple(cell) for cell in np.argwhere(problem.to_cover).tolist()}
    share = len(to_cover - on_walk) / len(to_cover)
    assert 0.1 < share < 0.3
    assert ants_for(replace(COLONY, ants=4000), problem) == pytest.approx(4000 * share, abs=1)
    assert ants_for(COLONY, problem) == FEWEST_ANTS < COLONY.ants
    assert ants_for(replace(COLONY, ants=30), problem) == 30
    path = Fasaco(COLONY).plan(problem)
    assert path.work.ants == FEWEST_ANTS


@pytest.mark.parametrize("part", ["trail", "before"])
def test_without_a_trail_or_a_walk_all_ants_walk(part):
    problem, _ = going_on()
    alone = replace(problem, **{part: None})
    assert ants_for(COLONY, alone) == COLONY.ants
    if part == "trail":
        whole = CoverageProblem.of(problem.lattice, (0, 0))
        np.testing.assert_array_equal(
            Fasaco(COLONY).plan(alone).cells, Fasaco(COLONY).plan(whole).cells
        )


@pytest.mark.parametrize("cols", [12, 13, 14, 16])
@pytest.mark.parametrize("threads", [1, 2])
def test_the_walk_is_complete_and_the_same_again(cols, threads):
    problem, _ = going_on(cols=cols)
    path = Fasaco(COLONY, threads).plan(problem)
    verdict = check_walk(problem.lattice.steps, problem.to_cover, path.cells, (0, 0))
    assert verdict.steps == path.steps
    np.testing.assert_array_equal(path.cells, Fasaco(COLONY).plan(problem).cells)


def test_an_unchanged_problem_never_gets_a_worse_walk():
    problem, walk = going_on(cols=12)
    for seed in range(5):
        assert Fasaco(replace(COLONY, seed=seed)).plan(problem).steps <= len(walk) - 1


def test_ants_follow_the_trail_that_paths_have_left():
    """With q0 = 1 an ant takes the strongest way: that of the path, as long as there is one."""
    problem, walk = going_on(cols=12, times=40)
    alone = replace(problem, before=None)
    greedy = ColonyConfig(ants=1, velocities=(1,), q0=1.0)
    path = Fasaco(greedy).plan(alone).cells
    visits = {}
    straight = next(  # up to the first cell that the walk leaves in another way later on
        n for n, cell in enumerate(map(tuple, walk.tolist())) if visits.setdefault(cell, n) != n
    )
    assert straight > 20
    np.testing.assert_array_equal(path[: straight - 1], walk[: straight - 1])
