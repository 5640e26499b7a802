"""The compiled colony against its plain twin: the same walk, bit for bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.planners.cost import CoverageCost, SearchWork
from fasaco_edge.planners.paper.colony import VISIBILITIES, ColonyConfig
from fasaco_edge.planners.paper.fasaco import Fasaco
from fasaco_edge.planners.problem import CoverageProblem
from tests import naive
from tests.support.examples import examples
from tests.support.grids import ENDS, ROOMS, end_of, problems

VELOCITIES = {
    "1": (1,),
    "4": (4,),
    "8:1": (8, 7, 6, 5, 4, 3, 2, 1),
    "1:8": (1, 2, 3, 4, 5, 6, 7, 8),
}


def assert_same_walk(problem, config):
    lattice = problem.lattice
    walk = naive.fasaco(
        lattice.steps,
        problem.to_cover,
        lattice.local(problem.start),
        config,
        None if problem.end is None else lattice.local(problem.end),
        problem.cost,
    )
    path = Fasaco(config).plan(problem)
    window = lattice.window
    assert path.cells.tolist() == [[row + window.row0, col + window.col0] for row, col in walk]
    assert path.work == SearchWork(ants=config.ants)
    assert path.cost_s == naive.walk_us(walk, problem.cost) / 1e6


@pytest.mark.parametrize("home", [False, True], ids=["open", "home"])
@pytest.mark.parametrize("velocities", VELOCITIES.values(), ids=VELOCITIES)
@pytest.mark.parametrize("room", ROOMS)
def test_twin_walks_the_same_in_rooms(room, velocities, home):
    lattice, start = ROOMS[room]
    problem = CoverageProblem.of(lattice, start, end=start if home else None)
    assert_same_walk(problem, ColonyConfig(ants=17, velocities=velocities, seed=7))


@pytest.mark.parametrize("visibility", VISIBILITIES)
@pytest.mark.parametrize("room", ROOMS)
def test_twin_walks_the_same_in_several_groups(room, visibility):
    lattice, start = ROOMS[room]
    config = ColonyConfig(ants=150, velocities=(3, 1), seed=5, visibility=visibility, beta=1.7)
    assert_same_walk(CoverageProblem.of(lattice, start), config)


@examples(200)
@given(
    ground=problems(),
    end=ENDS,
    turn_s=st.sampled_from((0.0, 0.0, 0.3, 1.5)),
    visibility=st.sampled_from(VISIBILITIES),
    velocities=st.sampled_from(list(VELOCITIES.values())),
    q0=st.sampled_from((0.0, 0.3, 0.7, 1.0)),
    alpha=st.floats(0.01, 1.0),
    tau0=st.floats(1e-6, 1e3),
    seed=st.integers(0, 2**63 - 1),
    covered=st.floats(0, 0.6),
)
def test_twin_walks_the_same_anywhere(
    ground, end, turn_s, visibility, velocities, q0, alpha, tau0, seed, covered
):
    lattice, start = ground
    done = np.random.default_rng(seed).random(lattice.states.shape) < covered
    done[lattice.local(start)] = False
    cost = CoverageCost(0.7, turn_s)
    end = end_of(end, lattice, start)
    problem = CoverageProblem.of(lattice, start, covered=done, end=end, cost=cost)
    config = ColonyConfig(24, velocities, q0, alpha, tau0, seed, visibility)
    assert_same_walk(problem, config)


def test_twin_walks_the_same_when_the_walk_outgrows_its_array():
    """Left-over cells right and left, each just nearer than the next: two and a half widths."""
    left_over = [(0, 45 + offset) for offset in (1, -2, 5, -10, 22, -45)]
    covered = np.ones((1, 68), bool)
    covered[tuple(zip(*left_over, strict=True))] = False
    corridor = CoverageLattice.from_free(np.ones((1, 68), bool))
    problem = CoverageProblem.of(corridor, (0, 45), covered=covered, end=(0, 45))
    config = ColonyConfig(ants=2, velocities=(1,))
    assert_same_walk(problem, config)
    assert Fasaco(config).plan(problem).steps == 1 + 3 + 7 + 15 + 32 + 67 + 45


def test_twin_draws_as_the_generator_published():
    """The first words from the state 1, 2, 3, 4, as other implementations give them."""
    random = naive.Xoshiro128PlusPlus([1, 2, 3, 4])
    published = (
        "641 1573767 3222811527 3517856514 836907274 4247214768 3867114732 1355841295 495546011"
    )
    assert " ".join(str(random.word()) for _ in range(9)) == published
