"""The bound by bands against least costs, and against itself however its work is parted."""

import numpy as np
import pytest

from fasaco_edge.planners.bands import WIDEST, bands_of, transposed
from fasaco_edge.planners.bound import MOST, LowerBound
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.grids import read_grid
from fasaco_edge.planners.problem import CoverageProblem
from tests.campaigns.turn_bound import drawn_problem, least_cost_us
from tests.support.grids import REFERENCE, lattice, reference

ITERATIONS = 8


def bounds_of(problem, cells=1 << 30):
    """The bound cell by cell, and after each call for so many cells in bands, until all is done."""
    bound = LowerBound(problem)
    bound.tighten(MOST * problem.lattice.states.size)
    seen = [bound.cost_us]
    for _ in range(ITERATIONS * problem.cells):
        bound.tighten_in_bands(cells)
        seen.append(bound.cost_us)
        if len(seen) > ITERATIONS and cells >= problem.cells:
            break
    return seen


def test_the_bound_holds_and_is_tight_more_often_with_bands():
    random = np.random.default_rng(7)
    met = np.zeros(2, int)
    for _ in range(400):
        problem = drawn_problem(random)
        least_us, seen = least_cost_us(problem), bounds_of(problem)
        assert seen == sorted(seen)
        assert seen[-1] <= least_us
        met += seen[0] == least_us, seen[-1] == least_us
    assert met[1] >= met[0] + 20


def test_a_tour_from_between_two_dead_ends_turns_in_both():
    # East and back, north and back: the first and the last visit of the start, and one between.
    ground = lattice(".#", ".#", "..")
    cost = CoverageCost(1.0, 5.0)
    problem = CoverageProblem.of(ground, (0, 0), end=(0, 0), cost=cost)
    assert bounds_of(problem)[-1] <= least_cost_us(problem) == 31_000_000


@pytest.mark.parametrize("end", [None, "home"])
def test_the_bound_is_the_same_however_its_work_is_parted(end):
    grid = read_grid("office")
    home = grid.start if end else None
    problem = CoverageProblem.of(grid.lattice, grid.start, end=home, cost=CoverageCost(1.0, 5.0))
    at_once = bounds_of(problem)
    parted = bounds_of(problem, 100)
    assert at_once[0] < at_once[-1]
    assert [cost for cost in dict.fromkeys(parted) if cost <= at_once[-1]] == [
        *dict.fromkeys(at_once)
    ]


def test_bands_are_cut_at_bottlenecks_and_hold_each_cell_once():
    rows = ("......", "......", "##.###", "......", "......", "......", "......")
    ground = lattice(*rows)
    bound = LowerBound(CoverageProblem.of(ground, (0, 0), cost=CoverageCost(1.0, 1.0)))
    lines = bound._lines
    row, col = np.divmod(bound._flat, ground.states.shape[1])
    bands = bands_of(lines, row, col)
    assert sorted(bands.order.tolist()) == list(range(lines.sides.size))
    assert bands.width <= WIDEST
    # One step leads from the upper room to the passage, or from that to the lower one.
    cut = [int(mask).bit_count() for mask in lines.sides & ~bands.inner]
    assert sum(cut) == 2
    again = transposed(transposed(lines))
    for one, other in zip(lines, again, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.skipif(not REFERENCE.exists(), reason="the reference grids are not at hand")
def test_rooms_of_few_rows_are_bound_closer():
    ground, start = reference("paper_simulated")
    cost = CoverageCost(1.0, 1.25)
    seen = bounds_of(CoverageProblem.of(ground, start, cost=cost))
    # The fractional optimum is 225.8, the whole-numbered one 249.75.
    assert seen[0] < 225_800_000
    assert 235_000_000 < seen[-1] <= 249_750_000
