"""The bound of a problem against walks that planners found and optima proven elsewhere."""

import json

import numpy as np
import pytest

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.map_files import builtin_maps
from fasaco_edge.planners.bound import (
    FEWEST,
    MOST,
    THOROUGH,
    LowerBound,
    lower_bound_of,
    lower_bound_steps,
)
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.grids import read_grid
from fasaco_edge.planners.paper.baselines import spiral_stc, stc, zigzag
from fasaco_edge.planners.problem import CoverageProblem
from tests.support.grids import REFERENCE, lattice, reference

MAPS = [name for name, _ in builtin_maps()]


def known_grids():
    """What is known of the paper's and other grids, by name."""
    file = REFERENCE / "results.json"
    return json.loads(file.read_text()) if file.exists() else {}


@pytest.mark.parametrize("end", ["anywhere", "home", "elsewhere"])
@pytest.mark.parametrize("covered", [0.0, 0.6])
@pytest.mark.parametrize("name", MAPS)
def test_no_planner_beats_the_bound_on_the_maps_that_come_along(name, covered, end):
    grid = read_grid(name)
    lattice, start = grid.lattice, grid.start
    # From the south on, as far as a robot may have come.
    done = np.zeros(lattice.states.shape, bool)
    done[: int(covered * len(done))] = True
    reachable = CoverageProblem.of(lattice, start).to_cover
    last = np.argwhere(reachable)[-1] + (lattice.window.row0, lattice.window.col0)
    goal = {"anywhere": None, "home": start, "elsewhere": tuple(last.tolist())}[end]
    problem = CoverageProblem.of(lattice, start, covered=done, end=goal)
    least = lower_bound_steps(problem)
    assert problem.cells - 1 <= least
    walks = [planner.plan(problem).steps for planner in (stc(), spiral_stc(), zigzag())]
    assert least <= min(walks)
    if not covered:
        # Close enough to tell a good walk from a poor one.
        assert least > 0.8 * min(walks)


@pytest.mark.parametrize("name", known_grids())
def test_bounds_of_known_grids_hold_and_are_as_tight_as_before(name):
    known = known_grids()[name]
    ground, start = reference(name)
    for goal, kind in ((None, "open"), (start, "closed")):
        least = lower_bound_steps(CoverageProblem.of(ground, start, end=goal))
        assert least >= known["bounds"].get(f"block_{kind}", 0)
        assert least <= known.get("proven_optimum", {}).get(f"{kind}_steps", least)
        walks = [
            walk["steps"]
            for planner, walk in known["results"].items()
            if walk["full"] and (kind == "open" or planner.endswith("closed"))
        ]
        assert least <= min(walks, default=least)


def test_a_step_and_turns_are_bound_in_whole_microseconds():
    # A hall of two rows: along, around the corner and back is the best walk.
    hall = lattice("......", "......")
    cost = CoverageCost(0.5, 2.0)
    bound = lower_bound_of(CoverageProblem.of(hall, (0, 0), cost=cost))
    assert (bound.steps, bound.cost_us) == (11, 9_500_000)
    assert lower_bound_of(CoverageProblem.of(lattice("."), (0, 0), cost=cost)).cost_us == 0


def test_the_bound_rises_with_work_and_is_the_same_each_time():
    grid = read_grid("office")
    problem = CoverageProblem.of(grid.lattice, grid.start, cost=CoverageCost(1.0, 5.0))
    seen = []
    for _ in range(2):
        bound = LowerBound(problem)
        seen.append([bound.cost_us])
        for iterations in (FEWEST, 40, MOST):
            bound.tighten(iterations * problem.cells)
            seen[-1].append(bound.cost_us)
    assert seen[0] == seen[1] == sorted(set(seen[0]))


def instances():
    """Turn-cost grids with what is proven of tours over them, a few of many."""
    file = REFERENCE / "turncost" / "results.json"
    known = json.loads(file.read_text()) if file.exists() else {}
    return {name: known[name] for name in sorted(known)[5::31]}


@pytest.mark.parametrize("name", instances())
def test_the_bound_is_below_the_best_known_tour_and_not_far(name):
    free = np.load(REFERENCE / "turncost" / "grids.npz")[name]
    known = instances()[name]
    ground = CoverageLattice.from_free(free)
    start = tuple(np.argwhere(free)[0].tolist())
    cost = CoverageCost(1.0, 50.0)
    problem = CoverageProblem.of(ground, start, end=start, cost=cost)
    least_s = lower_bound_of(problem, THOROUGH).cost_s
    # A walk home need not turn at its ends, as a tour does.
    assert 0.75 * known["tour_best"] < least_s <= known["tour_best"]
