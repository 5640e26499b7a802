"""What cannot be planned is refused by name; what can is posed and answered."""

from dataclasses import replace
from typing import get_args, get_type_hints

import numpy as np
import pytest

from fasaco_edge.config.config import PlannerConfig
from fasaco_edge.errors import (
    EndBlocked,
    EndOutsideMap,
    EndUnreachable,
    NothingToCover,
    StartBlocked,
    StartOutsideMap,
)
from fasaco_edge.grid.lattice import UNKNOWN
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import ignore, never
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.registry import PLANNER_NAMES, planner_of
from tests.support.grids import lattice, placed

GROUND = placed(lattice("..#", "..#", "###", "..."), -2, 5)
BEYOND = (-3, 5), (2, 5), (-2, 4), (-2, 8), (0, 0)
OUTSIDE = "lies outside rows -2..1, columns 5..7"
CLOSED = "is blocked: the robot does not fit there"
NO_WALK = "no walk leads from start cell (-2, 5) to end cell (1, 6)"


@pytest.mark.parametrize(
    ("error", "start", "end", "said"),
    [
        *((StartOutsideMap, at, None, f"start cell {at} {OUTSIDE}") for at in BEYOND),
        *((EndOutsideMap, (-2, 5), at, f"end cell {at} {OUTSIDE}") for at in BEYOND),
        (StartBlocked, (-1, 5), None, f"start cell (-1, 5) {CLOSED}"),
        (EndBlocked, (-2, 5), (-1, 5), f"end cell (-1, 5) {CLOSED}"),
        (StartBlocked, (0, 6), None, "start cell (0, 6) is unknown"),
        (EndBlocked, (-2, 5), (0, 6), "end cell (0, 6) is unknown"),
        (EndUnreachable, (-2, 5), (1, 6), NO_WALK),
    ],
)
def test_a_start_or_end_that_is_no_place_is_refused(error, start, end, said):
    states = GROUND.states.copy()
    states[2, 1] = UNKNOWN
    with pytest.raises(error) as caught:
        CoverageProblem.of(replace(GROUND, states=states), start, end=end)
    assert str(caught.value) == said
    assert caught.value.hint


def test_an_end_may_be_a_covered_cell():
    covered = np.zeros((4, 3), bool)
    covered[0, 2] = True
    problem = CoverageProblem.of(GROUND, (-2, 5), covered=covered, end=(-2, 7))
    assert problem.cells == 2
    for name in PLANNER_NAMES:
        walk = planner_of(name, ColonyConfig(ants=8)).plan(problem, never, ignore).cells.tolist()
        assert walk == [[-2, 5], [-2, 6], [-2, 7]], name


def test_a_covered_floor_leaves_nothing_to_cover():
    with pytest.raises(NothingToCover, match="every reachable cell is covered"):
        CoverageProblem.of(GROUND, (-2, 5), covered=np.ones((4, 3), bool))
    with pytest.raises(NothingToCover):
        CoverageProblem.of(GROUND, (-2, 5), covered=np.ones((4, 3), bool), end=(-2, 6))
    # What the robot cannot come to is not left to cover either.
    covered = np.zeros((4, 3), bool)
    covered[0] = True
    with pytest.raises(NothingToCover):
        CoverageProblem.of(GROUND, (-2, 5), covered=covered)


def test_unreachable_cells_are_reported_and_not_wanted():
    problem = CoverageProblem.of(GROUND, (-2, 6))
    assert np.argwhere(problem.to_cover).tolist() == [[0, 0], [0, 1], [0, 2]]
    assert np.argwhere(problem.unreachable).tolist() == [[2, 0], [2, 1], [3, 0], [3, 1]]
    assert problem.cells == 3
    for mask in (problem.to_cover, problem.unreachable):
        with pytest.raises(ValueError, match="read-only"):
            mask[0, 0] = True


def test_a_path_is_read_only_and_counts_its_steps():
    path = CoveragePath(np.array([[0, 0], [0, 1], [0, 2]], np.int32), "fasaco", 0)
    assert path.steps == 2
    assert path.gap is None
    assert replace(path, cost_s=3.0, lower_bound_cost_s=2.0).gap == 0.5
    assert CoveragePath(np.empty((0, 2), np.int32), "fasaco", 0).steps == 0
    with pytest.raises(ValueError, match="read-only"):
        path.cells[0] = 1


def test_the_configuration_takes_the_planners_of_the_registry():
    names = get_args(get_type_hints(PlannerConfig)["name"])
    assert names == PLANNER_NAMES
