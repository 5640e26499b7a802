"""What cannot be planned is refused by name; what can is posed and answered."""

import dataclasses
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
from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import COVERABLE, UNKNOWN, CoverageLattice
from fasaco_edge.planners.compiling import warm_up
from fasaco_edge.planners.paper.colony import ColonyConfig
from fasaco_edge.planners.path import CoveragePath
from fasaco_edge.planners.planner import ignore, never
from fasaco_edge.planners.problem import CoverageProblem
from fasaco_edge.planners.registry import PLANNER_NAMES, planner_of
from fasaco_edge.planners.stages import STAGES
from tests.support.grids import lattice, placed

GROUND = placed(lattice("..#", "..#", "###", "..."), -2, 5)


@pytest.mark.parametrize("start", [(-3, 5), (2, 5), (-2, 4), (-2, 8), (0, 0)])
def test_a_start_off_the_lattice_is_refused(start):
    with pytest.raises(StartOutsideMap) as caught:
        CoverageProblem.of(GROUND, start)
    assert str(caught.value) == f"start cell {start} lies outside rows -2..1, columns 5..7"


def test_a_blocked_start_is_refused():
    with pytest.raises(StartBlocked, match=r"\(-1, 5\) is blocked: the robot does not fit there"):
        CoverageProblem.of(GROUND, (-1, 5))


def test_an_unknown_start_is_refused():
    states = np.full((2, 2), UNKNOWN, np.uint8)
    unknown = CoverageLattice(Window(0, 0, 2, 2), 1.0, states, np.zeros((2, 2), np.uint8))
    with pytest.raises(StartBlocked, match=r"\(1, 0\) is unknown"):
        CoverageProblem.of(unknown, (1, 0))


@pytest.mark.parametrize("end", [(-3, 5), (2, 5), (-2, 8)])
def test_an_end_off_the_lattice_is_refused(end):
    with pytest.raises(EndOutsideMap) as caught:
        CoverageProblem.of(GROUND, (-2, 5), end=end)
    assert str(caught.value) == f"end cell {end} lies outside rows -2..1, columns 5..7"
    assert (caught.value.code, bool(caught.value.hint)) == ("end_outside_map", True)


def test_a_blocked_end_is_refused():
    with pytest.raises(EndBlocked) as caught:
        CoverageProblem.of(GROUND, (-2, 5), end=(-1, 5))
    assert str(caught.value) == "end cell (-1, 5) is blocked: the robot does not fit there"
    assert (caught.value.code, bool(caught.value.hint)) == ("end_blocked", True)


def test_an_unknown_end_is_refused():
    states = np.array([[COVERABLE, UNKNOWN]], np.uint8)
    unknown = CoverageLattice(Window(0, 0, 1, 2), 1.0, states, np.zeros((1, 2), np.uint8))
    with pytest.raises(EndBlocked, match=r"end cell \(0, 1\) is unknown"):
        CoverageProblem.of(unknown, (0, 0), end=(0, 1))


def test_an_end_in_another_area_is_refused():
    with pytest.raises(EndUnreachable) as caught:
        CoverageProblem.of(GROUND, (-2, 5), end=(1, 6))
    assert str(caught.value) == "no walk leads from start cell (-2, 5) to end cell (1, 6)"
    assert (caught.value.code, bool(caught.value.hint)) == ("end_unreachable", True)


def test_an_end_may_be_a_covered_cell():
    covered = np.zeros((4, 3), bool)
    covered[0, 2] = True
    problem = CoverageProblem.of(GROUND, (-2, 5), covered=covered, end=(-2, 7))
    assert problem.cells == 2
    for name in PLANNER_NAMES:
        walk = planner_of(name, ColonyConfig(ants=8)).plan(problem, never, ignore).cells.tolist()
        assert walk == [[-2, 5], [-2, 6], [-2, 7]], name


def test_a_problem_is_closed_if_it_ends_where_it_starts():
    assert CoverageProblem.of(GROUND, (-2, 5), end=(-2, 5)).closed
    assert not CoverageProblem.of(GROUND, (-2, 5), end=(-2, 6)).closed
    assert not CoverageProblem.of(GROUND, (-2, 5)).closed


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
    assert dataclasses.replace(path, cost_s=3.0, lower_bound_cost_s=2.0).gap == 0.5
    assert CoveragePath(np.empty((0, 2), np.int32), "fasaco", 0).steps == 0
    with pytest.raises(ValueError, match="read-only"):
        path.cells[0] = 1


def test_warm_up_names_each_stage_once():
    heard = []
    warm_up(heard.append)
    assert tuple(heard) == STAGES


def test_the_configuration_takes_the_planners_of_the_registry():
    names = get_args(get_type_hints(PlannerConfig)["name"])
    assert names == PLANNER_NAMES


def test_every_planner_of_the_registry_plans():
    problem = CoverageProblem.of(GROUND, (-2, 6))
    for name in PLANNER_NAMES:
        path = planner_of(name, ColonyConfig(ants=8)).plan(problem, never, ignore)
        assert path.planner == name
        assert path.first_walk_s > 0.0
        walk = [tuple(cell) for cell in path.cells.tolist()]
        assert walk[0] == (-2, 6)
        assert set(walk) == {(-2, 5), (-2, 6), (-2, 7)}
