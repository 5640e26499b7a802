"""The driven line: each gain is real, each way clear, and the same work gives the same line."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from fasaco_edge.grid.fine_raster import RobotDiscs
from fasaco_edge.grid.floor import Floor, StandLattice
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.map_files import find_map, read_map, suggested_start
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.judge.floor import SweepingRobot, judge_floor
from fasaco_edge.kernels.floor.sweeps import BLOCK
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.line import DrivenLine, LineConfig, LineSearch, left_in_blocks
from fasaco_edge.planners.path import FIRST_PIECE, common_beginning
from fasaco_edge.planners.planner import ignore
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.search.near_optimal import NearOptimal

ROBOT = SweepingRobot(tool_m=0.3, radius_m=0.18)
CELL_M = 0.276


@pytest.fixture(scope="module", params=["flat", "clutter"])
def planned(request):
    """A map, its floor, its stands and a walk over them."""
    if request.param == "flat":
        grid, start = read_map(find_map("flat")), suggested_start(find_map("flat"))
    else:
        grid, start = clutter(), (0.5, 0.5)
    floor = Floor.around(grid, RobotDiscs(ROBOT.radius_m, ROBOT.tool_m), start)
    stands = StandLattice.over(floor, CELL_M)
    cost = CoverageCost.for_robot(CELL_M, ROBOT.speed_m_s, ROBOT.turn_s)
    problem = CoverageProblem.of(stands.lattice, stands.start_cell(floor), cost=cost)
    walk = NearOptimal().plan(problem, lambda s: s.work.perturbations >= 50, ignore).cells
    return grid, floor, stands, walk


def line_over(walk, stands, floor, config, *, is_end_fixed=False):
    """The first line that a search finds."""
    search = LineSearch(walk, stands, floor, config, is_end_fixed=is_end_fixed)
    return next(search.best for _ in search.run() if search.best is not None)


def clutter():
    """Return a room of 4 x 3 m with pillars of one pixel and a wall askew."""
    cells = np.zeros((62, 82), np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    rng = np.random.default_rng(4)
    cells[rng.integers(20, 60, 25), rng.integers(20, 80, 25)] = 100
    for step in range(25):
        cells[30 + step, 20 + step // 2] = 100
    return OccupancyGrid(GridGeometry(62, 82, 0.05, Pose2D(-0.05, -0.05)), cells)


def seconds_and_left(grid, line: DrivenLine, price: float) -> float:
    """Return what is minimised, as the judge has it."""
    figures = judge_floor(grid, line.xy, ROBOT).figures
    return figures.seconds + price * (figures.reachable_m2 - figures.swept_m2)


@pytest.mark.parametrize("price", [60.0, 180.0])
def test_a_polished_line_is_better_by_the_judge(planned, price):
    grid, floor, stands, walk = planned
    plain = line_over(walk, stands, floor, LineConfig(price_s_m2=0.0))
    config = LineConfig(price_s_m2=price, patch_s=0.0)
    line = line_over(walk, stands, floor, config)
    before, after = (seconds_and_left(grid, one, price) for one in (plain, line))
    assert after < 0.93 * before
    figures = judge_floor(grid, line.xy, ROBOT).figures
    assert figures.illegal_share == 0.0
    assert line.reachable_m2 == pytest.approx(figures.reachable_m2, rel=0.01)
    # The judge adds a line's own pixels up again: each is counted in and out as often.
    assert line.swept_m2 == pytest.approx(figures.swept_m2, rel=0.01)


def test_the_same_work_gives_the_same_line(planned):
    _, floor, stands, walk = planned
    config = LineConfig(moves_m2=500)
    lines = [line_over(walk, stands, floor, config) for _ in range(2)]
    assert lines[0].xy.tobytes() == lines[1].xy.tobytes()
    # Patches come after the budget.
    assert lines[0].tried == lines[1].tried <= 600 * floor.reachable_m2


def test_a_longer_search_is_never_worse(planned):
    """After each stage the best line so far is kept; over four of them it gets cheaper."""
    grid, floor, stands, walk = planned
    config = LineConfig(moves_m2=1000)
    price = config.price_s_m2
    search = LineSearch(walk, stands, floor, config, is_end_fixed=False)
    costs = []
    for _ in search.run():
        if (best := search.best) is not None:
            costs.append(best.cost_s(price))
            seconds = judge_floor(grid, best.xy, ROBOT).figures.seconds
            assert best.seconds == pytest.approx(seconds, rel=1e-3)
        if best is not None and best.tried > 15 * config.moves_m2 * floor.reachable_m2:
            break
    assert costs == sorted(costs, reverse=True)
    assert costs[-1] < 0.98 * costs[0]


def test_a_share_that_is_asked_for_is_swept_in_the_least_time(planned):
    _, floor, stands, walk = planned
    config = LineConfig(moves_m2=1000, swept=0.992)
    search = LineSearch(walk, stands, floor, config, is_end_fixed=False)
    enough_s = []
    for _ in search.run():
        best = search.best
        if best is not None and best.swept_m2 >= 0.992 * floor.reachable_m2:
            enough_s.append(best.seconds)
        if best is not None and best.tried > 20 * config.moves_m2 * floor.reachable_m2:
            break
    assert enough_s == sorted(enough_s, reverse=True)
    assert enough_s
    assert enough_s[-1] < enough_s[0]


def test_a_fixed_end_stays(planned):
    _, floor, stands, walk = planned
    line = line_over(walk, stands, floor, LineConfig(moves_m2=1000), is_end_fixed=True)
    plain = floor.to_map(stands.points(walk))
    assert line.xy[-1].tolist() == plain[-1].tolist()
    assert line.xy[0].tolist() == plain[0].tolist()


def distances_m(grid, line: DrivenLine) -> np.ndarray:
    """Return the distances to what is not free, at points 5 cm apart along a line [m]."""
    rows, cols = np.nonzero((grid.cells < 0) | (grid.cells > 25))
    found = []
    for a, b in pairwise(line.xy):
        for x, y in np.linspace(a, b, math.ceil(math.dist(a, b) / 0.05), endpoint=False):
            col, row = grid.geometry.to_pixels(x, y)
            off = np.abs(np.stack([cols + 0.5 - col, rows + 0.5 - row])) - 0.5
            found.append(np.hypot(*np.maximum(off, 0.0)).min() * grid.geometry.resolution)
    return np.array(found)


def with_clearance(floor, clearance_m):
    return replace(floor, discs=replace(floor.discs, clearance_m=clearance_m))


def test_a_line_keeps_its_clearance_from_most_of_what_it_passes(planned):
    grid, floor, stands, walk = planned
    near, lines = [], []
    for clearance_m in (0.0, 0.02):
        on = with_clearance(floor, clearance_m)
        config = LineConfig(moves_m2=1500)
        lines.append(line_over(walk, stands, on, config))
        near.append((distances_m(grid, lines[-1]) < ROBOT.radius_m + 0.015).mean())
    assert near[1] < 0.4 * near[0]
    # What is left is a strip along walls, hardly wider than the clearance.
    assert lines[1].swept_m2 > 0.93 * lines[0].swept_m2


def test_clearance_is_given_up_for_the_floor_of_a_narrow_passage():
    cells = np.full((42, 62), 100, np.int8)
    cells[1:41, 1:41] = 0
    cells[18:26, 41:61] = 0  # 40 cm wide, a metre deep
    grid = OccupancyGrid(GridGeometry(42, 62, 0.05, Pose2D(0.0, 0.0)), cells)
    floor = Floor.around(grid, RobotDiscs(ROBOT.radius_m, ROBOT.tool_m), (1.0, 1.0))
    stands = StandLattice.over(floor, CELL_M)
    problem = CoverageProblem.of(stands.lattice, stands.start_cell(floor))
    walk = NearOptimal().plan(problem, lambda s: s.work.perturbations >= 20, ignore).cells
    on = with_clearance(floor, 0.03)
    line = line_over(walk, stands, on, LineConfig())
    assert line.xy[:, 0].max() > 2.7
    near = distances_m(grid, line) < ROBOT.radius_m + 0.03 - 0.005
    assert 0.0 < near.mean() < 0.3


def test_a_walk_of_one_cell_sweeps_what_is_below_the_tool(planned):
    _, floor, stands, walk = planned
    line = line_over(walk[:1], stands, floor, LineConfig())
    assert len(line.xy) == 1
    assert 0.0 < line.swept_m2 <= math.pi * 0.15**2 * 1.05


@pytest.mark.parametrize("resolution", [0.02, 0.025, 0.03, 0.04, 0.05, 0.06, 0.1])
def test_a_line_is_polished_on_pixels_as_fine_as_the_judge_s(resolution):
    cells = np.zeros((60, 60), np.int8)
    grid = OccupancyGrid(GridGeometry(60, 60, resolution, Pose2D(0.0, 0.0)), cells)
    middle = 30 * resolution
    floor = Floor.around(grid, RobotDiscs(0.18, 0.3), (middle, middle))
    judged = judge_floor(grid, np.array([(middle, middle)]), ROBOT)
    assert floor.geometry.resolution == judged.figures.pixel_m


@pytest.mark.parametrize("at", [0, 1, FIRST_PIECE - 1, FIRST_PIECE, 5 * FIRST_PIECE, 1999, 2000])
@pytest.mark.parametrize("axis", [0, 1])
def test_the_common_beginning_ends_where_walks_part(at, axis):
    walk = np.arange(4000, dtype=np.int32).reshape(2000, 2)
    other = np.concatenate([walk, walk[:10]])
    if at < 2000:
        other[at, axis] += 1
    assert common_beginning(walk, other) == common_beginning(other, walk) == at


def test_an_empty_walk_has_no_common_beginning():
    assert common_beginning(np.empty((0, 2), np.int32), np.ones((3, 2), np.int32)) == 0


@pytest.mark.parametrize("shape", [(1, 1), (8, 8), (9, 17), (300, 1003), (2000, 40)])
def test_unswept_pixels_are_counted_by_block(shape):
    counts = np.random.default_rng(2).integers(0, 3, shape).astype(np.int16)
    left, side = left_in_blocks(counts), 1 << BLOCK
    assert left.dtype == np.int32
    for (i, j), found in np.ndenumerate(left):
        block = counts[i * side : (i + 1) * side, j * side : (j + 1) * side]
        assert block.size
        assert found == np.count_nonzero(block == 0)
    assert left.sum() == np.count_nonzero(counts == 0)
