"""Searches to look at: stopped at will, judged, watched, on grounds of some hundred cells."""

import itertools

import numpy as np

from fasaco_edge.planners.bound import lower_bound_steps
from fasaco_edge.planners.cost import STEPS_ALONE, CoverageCost, SearchWork
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.planner import WorkLimit, never
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.search import current_walk, regions, search
from fasaco_edge.planners.search.near_optimal import NearOptimal
from tests.benchmarks.buildings import building
from tests.benchmarks.judge import check_walk

TURNS = CoverageCost(1.0, 1.5)
FEW_ANTS = ColonyConfig(ants=8, velocities=(2, 1))


def looks(count):
    """Stop when asked for the so manieth time."""
    asked = itertools.count(1)
    return lambda progress: next(asked) >= count


def after(perturbations=0, proposals=0, ants=0):
    return WorkLimit(SearchWork(ants=ants, perturbations=perturbations, proposals=proposals))


def plan(problem, stop=never, config=FEW_ANTS):
    """Plan, let an independent judge look at the walk, and recount what comes with it."""
    path = NearOptimal(config).plan(problem, stop)
    ground, window = problem.lattice, problem.lattice.window
    walk = path.cells - (window.row0, window.col0)
    end = None if problem.end is None else ground.local(problem.end)
    verdict = check_walk(ground.steps, problem.to_cover, walk, ground.local(problem.start), end)
    assert verdict.problems == ()
    quarters = verdict.turns_90 + 2 * verdict.turns_180
    cost = problem.cost
    assert path.cost_s == (path.steps * cost.step_us + quarters * cost.quarter_turn_us) / 1e6
    assert path.lower_bound_steps == lower_bound_steps(problem) <= path.steps
    assert path.cells.dtype == np.int32
    return path


class Watched:
    """Stop when another criterion says so, and remember what the search said of itself."""

    def __init__(self, stop):
        self.stop, self.seen = stop, []

    def __call__(self, progress):
        self.seen.append(progress)
        return self.stop(progress)

    def assert_steady(self):
        """No cost rises, and at every look more is done than at the last."""
        for one, other in itertools.pairwise(self.seen):
            assert other.cost_s <= one.cost_s
            assert other.steps <= one.steps or other.cost_s < one.cost_s
            assert other.work.reaches(one.work)
            assert other.work != one.work


def take_apart(monkeypatch):
    """Let grounds of some hundred cells be taken apart into regions."""
    monkeypatch.setattr(regions, "ONE_REGION", 100)
    monkeypatch.setattr(regions, "EDGE", 16)
    monkeypatch.setattr(current_walk, "EDGE", 16)
    monkeypatch.setattr(search, "PROPOSALS_AT_ONCE", 3_000)


def hall(home=False, cost=STEPS_ALONE, covered=0.0, cells=1_000):
    """A small building, of which a share of the cells, strewn all over it, is done."""
    grid = building(cells, 3)
    ground, start = grid.lattice, grid.start
    done = np.random.default_rng(3).random(ground.states.shape) < covered
    done[ground.local(start)] = False
    end = start if home else None
    return CoverageProblem.of(ground, start, end=end, cost=cost, covered=done)
