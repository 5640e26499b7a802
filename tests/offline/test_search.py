"""Search of a plan: more of it is never worse."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import fasaco_edge as fe
from fasaco_edge.grid.fine_raster import map_to_raster
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.kernels.floor.seconds import chain_s
from fasaco_edge.kernels.floor.sweeps import sweep_edges
from fasaco_edge.offline.ground import PlanGround
from fasaco_edge.offline.plan import _problem
from fasaco_edge.offline.search import Planning, SearchEnd
from fasaco_edge.offline.settings import ANYWHERE, WALLS
from fasaco_edge.planners.bound import lower_bound_of
from fasaco_edge.planners.line import LINES, _sweeps, anneal, memory_for_moves
from fasaco_edge.planners.planner import Interrupt, ignore

ROBOT = fe.Robot()
# Pauses after which a search is stopped.
BUDGETS = 1, 40, 95, 150, 400


def room(seed: int) -> OccupancyGrid:
    """Return a room of 3 x 2.1 m with pillars, and in some seeds a wall with a door."""
    rng = np.random.default_rng(seed)
    cells = np.zeros((44, 62), np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    cells[rng.integers(18, 42, 8), rng.integers(18, 60, 8)] = 100
    if seed % 2:
        cells[:, 30] = 100
        cells[(begin := int(rng.integers(4, 28))) : begin + 12, 30] = 0
    return OccupancyGrid(GridGeometry(44, 62, 0.05, Pose2D(0.0, 0.0)), cells)


class Pauses:
    """A budget of pauses, so that no clock decides."""

    def __init__(self, most: int) -> None:
        self.count, self.most = 0, most

    def __call__(self, progress: object) -> bool:
        self.count += 1
        return self.count >= self.most


def planned(grid: OccupancyGrid, seed: int, pauses: Pauses, observe=ignore, line="thorough"):
    search = fe.Search(seed=seed, budget_s=1e6)
    ground = PlanGround.of_floor(grid, ROBOT, (0.5, 0.5), WALLS)
    ending = SearchEnd(None, pauses, lambda _: None, None)
    problem = _problem(ground, ROBOT, ANYWHERE)
    planning = Planning(problem, ground, search, None, ending, observe)
    return ground, *planning.run(line, ROBOT)


def cost_s(ground: PlanGround, xy: np.ndarray) -> float:
    floor, config = ground.floor, LINES["thorough"]
    assert floor is not None
    unit_m, sweeps = floor.geometry.resolution, _sweeps(floor)
    points = np.stack(map_to_raster(floor.geometry, *xy.T), axis=1)
    edges = np.concatenate([points[:-1], points[1:]], axis=1)
    sweep_edges(sweeps, edges, ROBOT.tool_width_m / 2 / unit_m, 1, memory_for_moves().capsules)
    drive_s, count = unit_m / ROBOT.speed_m_s, len(points)
    seconds = chain_s(points, 0, count - 1, count, drive_s, ROBOT.turning())
    return seconds + config.price_s_m2 * np.count_nonzero(sweeps.counts == 0) * unit_m**2


@pytest.mark.parametrize("seed", range(3))
def test_more_of_a_search_is_never_worse(seed):
    costs = [cost_s(*planned(room(seed), seed, Pauses(most))[::2]) for most in BUDGETS]
    assert all(b <= a + 1e-3 for a, b in pairwise(costs)), costs
    assert costs[-1] < costs[0]


def test_pheromone_is_shown_while_only_ants_walk():
    ground = PlanGround.of_floor(room(0), ROBOT, (0.5, 0.5), WALLS)
    problem = _problem(ground, ROBOT, ANYWHERE)
    search = fe.Search(planner="fasaco", ants=64)
    shown = []
    ending = SearchEnd(None, None, lambda _: shown.append("walk"), lower_bound_of(problem))
    Planning(problem, ground, search, None, ending, lambda _: shown.append("ants")).run(
        "quick", ROBOT
    )
    assert shown.index("ants") < len(shown) - 1
    assert shown.count("ants") > 1


def test_a_requested_share_is_searched_for_beyond_the_budget():
    """The price of floor is found in three stages; a budget once ended after the first."""
    grid, shares = fe.load_map("office"), []
    for swept in (None, 0.995):
        plan = fe.plan(grid, ROBOT, search=fe.Search(budget_s=0.01, swept=swept))
        shares.append(plan.swept_share)
    assert shares[1] >= 0.994 > shares[0]


class Emergency:
    """A criterion of a program's own."""

    cuts_first_line = False

    def __call__(self, progress: object) -> bool:
        return self.cuts_first_line


@pytest.mark.parametrize("stop", [Interrupt(), Emergency()], ids=["Ctrl-C", "own"])
def test_ctrl_c_ends_even_the_first_line(monkeypatch, stop):
    """On a large map that line takes half a minute, which Ctrl-C did not shorten."""
    pieces = []

    def annealed(*given):
        if isinstance(stop, Interrupt):
            stop.asked.set()
        else:
            stop.cuts_first_line = True
        pieces.append(anneal(*given))

    monkeypatch.setattr("fasaco_edge.planners.line.anneal", annealed)
    plan = fe.plan(fe.load_map("flat"), stop=stop)
    assert (len(pieces), plan.ended_by) == (1, "Ctrl-C")
    assert plan.swept_share > 0.9
