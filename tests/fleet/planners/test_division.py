"""A division of a ground: complete, legal, balanced, the same on any number of threads."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from fasaco_edge.errors import NothingToCover, StartBlocked
from fasaco_edge.fleet.planning.division import divide
from fasaco_edge.fleet.planning.first_tours import Fleet
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.fleet.split import FAR, WORST, best_split, ways_from
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
@examples(25, suppress_health_check=[HealthCheck.too_slow])
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


def test_walks_in_a_hall_are_about_equally_long():
    free, starts = hall(), [(0, 0), (29, 39), (0, 39), (29, 0)]
    division = divide(CoverageLattice.from_free(free), Fleet(starts, STEPS_ALONE), rounds(60))
    check(free, starts, division, returns=True)
    longest = max(len(walk) - 1 for walk in division.walks)
    assert longest <= 1.05 * division.cells / 4


def test_sharing_a_hall_takes_hardly_a_step_more():
    """An even share is 281.75 cells. Two seeds take 284 steps, one 286; pairs alone took to 288."""
    free, starts = hall(), [(0, 0), (0, 1), (29, 39), (15, 20)]
    longest = []
    for seed in range(3):
        fleet = Fleet(starts, STEPS_ALONE, seed=seed)
        division = divide(CoverageLattice.from_free(free), fleet, rounds(16))
        check(free, starts, division, returns=True)
        steps = [len(walk) - 1 for walk in division.walks]
        longest.append(max(steps) * 4 / division.cells)
        assert sum(steps) <= 1.012 * division.cells
    assert np.median(longest) <= 1.01
    assert max(longest) <= 1.016


def test_the_bound_counts_who_has_to_pass_a_corridor():
    """Two robots at one end of a corridor of 20 cells, a room at the other: both go there."""
    free = np.zeros((12, 34), np.bool_)
    free[5, :22] = True
    free[:, 22:] = True
    starts = [(5, 0), (5, 1)]
    division = divide(CoverageLattice.from_free(free), Fleet(starts, STEPS_ALONE), rounds(8))
    check(free, starts, division, returns=True)
    assert division.lower_bound_steps >= (2 * 2 * 20 + 12 * 12) // 2
    assert division.lower_bound_steps <= 1.05 * max(len(walk) - 1 for walk in division.walks)


def test_robots_that_start_side_by_side_share_alike():
    free, starts = hall(), [(0, 0), (0, 1), (1, 0)]
    division = divide(CoverageLattice.from_free(free), Fleet(starts, STEPS_ALONE), rounds(60))
    check(free, starts, division, returns=True)
    longest = max(len(walk) - 1 for walk in division.walks)
    assert longest <= 1.15 * division.cells / 3


@pytest.mark.parametrize("cost", [STEPS_ALONE, TURNS])
def test_it_is_the_same_on_any_number_of_threads(cost):
    lattice, starts = CoverageLattice.from_free(hall()), [(0, 0), (2, 2), (29, 39), (15, 3)]
    divisions = [
        divide(lattice, Fleet(starts, cost, seed=3, threads=threads), rounds(9))
        for threads in (1, 3)
    ]
    for one, other in zip(*(division.walks for division in divisions), strict=True):
        assert (one == other).all()


def test_it_begins_anew_with_the_largest_seed():
    """Both have to drive through the corridor, which the bound knows of neither."""
    free = np.zeros((9, 9), np.bool_)
    free[4] = free[:, 4] = True
    free[3:6, 6:] = True
    fleet = Fleet([(4, 0), (4, 1)], STEPS_ALONE, seed=2**63 - 1)
    division = divide(CoverageLattice.from_free(free), fleet, rounds(60))
    check(free, fleet.starts, division, returns=True)
    assert division.rounds == 60


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


def naive_split(steps, loop, ways, step_us):
    """Return the best score of all splits into two parts, visits by visits."""
    cols = steps.shape[1]
    offsets = (1, cols, -1, -cols)
    masks, visits = steps.ravel(), len(loop)

    def joined(one, other):
        return one == other or any(
            masks[one] >> direction & 1 and one + offset == other
            for direction, offset in enumerate(offsets)
        )

    best = None
    twice = [*loop, *loop]
    for first, count in product(range(visits), range(1, visits + 1)):
        part = twice[first : first + count]
        # The other part has the rest, and up to one visit more at either end.
        for shared in (0, 1):
            rest = visits - count + 2 * shared
            second = first + count - shared
            if not 0 < rest <= visits:
                continue
            other = [twice[(second + index) % visits] for index in range(rest)]
            if not joined(part[-1], part[0]) or not joined(other[-1], other[0]):
                continue
            if (len(part) > 1 and part[-1] == part[0]) or (
                len(other) > 1 and other[-1] == other[0]
            ):
                continue
            for robots in ((0, 1), (1, 0)):
                shares = [
                    (len(cells) + 2 * int(ways[robot][cells].min())) * step_us
                    for robot, cells in zip(robots, (part, other), strict=True)
                ]
                score = WORST * max(shares) + sum(shares)
                best = score if best is None else min(best, score)
    return best


@given(st.data())
@examples(60)
def test_a_split_is_the_best_there_is(data):
    rows, cols = data.draw(st.tuples(st.integers(2, 4), st.integers(2, 4)))
    free = np.ones((rows, cols), np.bool_)
    steps = CoverageLattice.from_free(free).steps
    # Any closed walk: there, and back to where it began.
    here = data.draw(st.integers(0, rows * cols - 1))
    loop = [here]
    for choice in data.draw(st.lists(st.integers(0, 3), min_size=2, max_size=9)):
        row, col = divmod(loop[-1], cols)
        moves = [(row, col + 1), (row + 1, col), (row, col - 1), (row - 1, col)]
        inside = [(r, c) for r, c in moves if 0 <= r < rows and 0 <= c < cols]
        row, col = inside[choice % len(inside)]
        loop.append(row * cols + col)
    loop += loop[-2:0:-1]
    loop = np.array(loop, np.int32)
    cells = st.integers(0, rows * cols - 1)
    ways = np.array([ways_from(steps, data.draw(cells)) for _ in range(2)])
    assert (ways < FAR).all()
    check_split(steps, loop, ways)


def test_of_two_robots_either_may_take_either_part():
    """The one that gains less by the long part may be so much nearer to it that it ends first."""
    steps = CoverageLattice.from_free(np.ones((4, 3), np.bool_)).steps
    ways = np.array([ways_from(steps, 11), ways_from(steps, 1)])
    check_split(steps, np.array([2, 5, 4, 3, 4, 5], np.int32), ways)


def check_split(steps, loop, ways):
    """Check that a closed walk is split among two robots as well as can be."""
    cols = steps.shape[1]
    found, order = np.zeros(5, np.int64), np.zeros(2, np.int64)
    costs_us = np.arange(2 * len(loop) + 1, dtype=np.int64) * 7
    offsets = np.array([1, cols, -1, -cols])
    assert best_split(steps.ravel(), offsets, loop, costs_us, ways, 7, found, order)
    first, count, second, rest, share = found.tolist()
    assert share == 1
    twice = np.concatenate((loop, loop))
    shares = [
        (length + 2 * int(ways[robot][twice[begin : begin + length]].min())) * 7
        for robot, begin, length in zip(order, (first, second), (count, rest), strict=True)
    ]
    assert WORST * max(shares) + sum(shares) == naive_split(steps, loop, ways, 7)
