"""A division of a ground: complete, legal, balanced, the same on any number of threads."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.errors import NothingToCover, StartBlocked
from fasaco_edge.fleet.planning.division import Fleet, divide
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.lattice.reach import reachable_from
from fasaco_edge.planners.cost import STEPS_ALONE, CoverageCost
from tests.support.drawn import free_cells
from tests.support.examples import examples

TURNS = CoverageCost(1.0, 1.5)


def rounds(count):
    return lambda progress: progress.work.perturbations >= count


def check(free, starts, division, *, returns):
    """All that can be reached is covered, by legal steps from the robots' starts."""
    passed = np.zeros(free.shape, np.bool_)
    for start, walk in zip(starts, division.walks, strict=True):
        assert tuple(walk[0].tolist()) == start
        assert not returns or tuple(walk[-1].tolist()) == start
        assert (np.abs(np.diff(walk, axis=0)).sum(axis=1) == 1).all()
        passed[tuple(walk.T)] = True
    steps = CoverageLattice.from_free(free).steps
    reached = np.any([reachable_from(steps, *start) for start in starts], axis=0)
    assert (passed == reached).all()
    assert division.cells == np.count_nonzero(reached)
    assert division.lower_bound_steps <= max(len(walk) - 1 for walk in division.walks)


@given(data=st.data())
@examples(25)
def test_every_cell_is_covered_by_legal_walks(data):
    free = free_cells(data, 1)
    cells = [tuple(cell) for cell in np.argwhere(free).tolist()]
    if not cells:
        return
    starts = data.draw(st.lists(st.sampled_from(cells), min_size=1, max_size=5, unique=True))
    returns, cost = data.draw(st.booleans()), data.draw(st.sampled_from([STEPS_ALONE, TURNS]))
    fleet = Fleet(starts, cost, returns=returns)
    division = divide(CoverageLattice.from_free(free), fleet, rounds(2))
    check(free, starts, division, returns=returns)
    costs_s = [cost.of_walk(walk) for walk in division.walks]
    assert division.costs_s == pytest.approx(costs_s)


def hall():
    free = np.ones((30, 40), np.bool_)
    free[10:14, 8:20] = free[20:25, 25:30] = False
    return free


@pytest.mark.parametrize(
    ("starts", "most"),
    [([(0, 0), (29, 39), (0, 39), (29, 0)], 1.05), ([(0, 0), (0, 1), (1, 0)], 1.15)],
    ids=["corners", "side by side"],
)
def test_walks_in_a_hall_are_about_equally_long(starts, most):
    free = hall()
    division = divide(CoverageLattice.from_free(free), Fleet(starts, STEPS_ALONE), rounds(60))
    check(free, starts, division, returns=True)
    longest = max(len(walk) - 1 for walk in division.walks)
    assert longest <= most * division.cells / len(starts)


def test_walks_that_may_end_anywhere_are_no_longer():
    """They were a quarter longer than those that lead back to the start."""
    starts = [(0, 0), (29, 39), (15, 3)]
    longest_s = []
    for returns in (True, False):
        fleet = Fleet(starts, TURNS, returns=returns)
        division = divide(CoverageLattice.from_free(hall()), fleet, rounds(12))
        check(hall(), starts, division, returns=returns)
        longest_s.append(max(division.costs_s))
    assert longest_s[1] <= longest_s[0]


@pytest.mark.parametrize("cost", [STEPS_ALONE, TURNS])
def test_it_is_the_same_on_any_number_of_threads(cost):
    lattice, starts = CoverageLattice.from_free(hall()), [(0, 0), (2, 2), (29, 39), (15, 3)]
    divisions = [
        divide(lattice, Fleet(starts, cost, seed=3, threads=threads), rounds(9))
        for threads in (1, 3)
    ]
    for one, other in zip(*(division.walks for division in divisions), strict=True):
        assert (one == other).all()


def test_the_largest_seed_is_one():
    free = np.zeros((9, 9), np.bool_)
    free[4] = free[:, 4] = True
    free[3:6, 6:] = True
    fleet = Fleet([(4, 0), (4, 1)], STEPS_ALONE, seed=2**63 - 1)
    division = divide(CoverageLattice.from_free(free), fleet, rounds(60))
    check(free, fleet.starts, division, returns=True)


def test_robots_in_two_parts_of_a_building_share_theirs():
    free = np.ones((8, 17), np.bool_)
    free[:, 8] = False
    starts = [(0, 0), (7, 16), (7, 0)]
    division = divide(CoverageLattice.from_free(free), Fleet(starts, STEPS_ALONE), rounds(20))
    check(free, starts, division, returns=True)
    lengths = [len(walk) - 1 for walk in division.walks]
    assert lengths == [32, 64, 32]
    assert division.lower_bound_steps == 64


def pieces(count):
    """A budget of pieces of work, as a clock is one: it does not ask which area they were of."""
    left = [count]

    def is_over(progress):
        # A single tour has a limit of its own.
        left[0] -= not progress.work.proposals
        return left[0] < 0

    return is_over


def test_two_areas_share_the_budget_whichever_robots_come_first():
    """All of it went to the area of the first robot: the longest walk was 18 % above the bound."""
    free = np.random.default_rng(2).random((41, 40)) > 0.1
    free[20], free[[0, 0, 40, 40], [0, 39, 0, 39]] = False, True
    starts = [(0, 0), (0, 39), (40, 0), (40, 39)]
    longest = []
    for ordered in (starts, starts[2:] + starts[:2]):
        fleet = Fleet(ordered, STEPS_ALONE)
        division = divide(CoverageLattice.from_free(free), fleet, pieces(20))
        check(free, ordered, division, returns=True)
        longest.append(max(len(walk) - 1 for walk in division.walks))
        assert longest[-1] <= 1.05 * division.lower_bound_steps
    assert longest[0] == longest[1]


def test_more_robots_than_cells_leave_some_where_they_are():
    free, starts = np.ones((1, 3), np.bool_), [(0, 0), (0, 1), (0, 2)]
    division = divide(CoverageLattice.from_free(free), Fleet(starts, STEPS_ALONE), rounds(3))
    check(free, starts, division, returns=True)


def test_a_robot_that_cannot_start_is_named():
    free = np.ones((3, 3), np.bool_)
    free[1, 1] = False
    fleet = Fleet([(0, 0), (1, 1)], STEPS_ALONE)
    with pytest.raises(StartBlocked, match="robot 2: start cell"):
        divide(CoverageLattice.from_free(free), fleet, rounds(1))
    with pytest.raises((NothingToCover, StartBlocked)):
        divide(CoverageLattice.from_free(~np.ones((3, 3), np.bool_)), fleet, rounds(1))
