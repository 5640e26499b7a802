"""How well two maps agree, and what of that makes them maps of two buildings."""

import time
from itertools import permutations

import numpy as np
import pytest

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.coverage.loop_closure import Motion
from fasaco_edge.mission.map.building_watch import FOREIGN, Agreement
from tests.mission.test_fit import MAPS, ROBOT, from_its_start, moved, seen_within


def lattice(grid):
    return CoverageLattice.from_map(grid, ROBOT)


@pytest.fixture(scope="module")
def buildings():
    return {name: from_its_start(name) for name in MAPS}


def test_kappa_of_maps():
    assert Agreement(0, (0, 0), 0).kappa == 1.0
    assert Agreement(100, (0, 0), 0).kappa == 1.0
    assert Agreement(100, (40, 40), 40).kappa == pytest.approx(1.0)
    assert Agreement(100, (50, 50), 25).kappa == pytest.approx(0.0)
    assert Agreement(100, (20, 0), 0).kappa == pytest.approx(0.0), "all walls are gone"
    assert Agreement(100, (50, 50), 0).kappa == pytest.approx(-1.0)


@pytest.mark.parametrize("reach_m", [3.5, 8.0, 100.0])
def test_two_buildings_agree_by_chance_alone(buildings, reach_m):
    for one, other in permutations(MAPS, 2):
        seen = lattice(seen_within(buildings[other], reach_m))
        found = Agreement.of(lattice(buildings[one]), seen)
        assert found.kappa < FOREIGN
        assert not found.is_close


@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("reach_m", [2.0, 3.5, 100.0])
@pytest.mark.parametrize("by_m", [0.1, 0.3])
def test_a_building_agrees_with_itself(buildings, name, reach_m, by_m):
    """Also if the map lies a cell aside."""
    seen = lattice(seen_within(moved(buildings[name], by_m, 0.0), reach_m))
    assert Agreement.of(lattice(buildings[name]), seen).kappa > FOREIGN


@pytest.mark.parametrize("name", MAPS)
def test_a_map_that_has_moved_agrees_once_it_is_moved_back(buildings, name):
    before, after = lattice(buildings[name]), lattice(moved(buildings[name], 1.2, -0.9))
    motion = Motion(Pose2D(0.0, 0.0), Pose2D(1.2, -0.9))
    assert Agreement.of(before, after).kappa < FOREIGN
    found = Agreement.of(before, after, motion)
    assert found.kappa == pytest.approx(1.0)
    assert found.known > 0.9 * np.count_nonzero(after.states)


def test_maps_of_a_million_pixels_are_compared_in_milliseconds():
    cells = np.where(np.random.default_rng(0).random((1000, 1000)) < 0.02, 100, 0).astype(np.int8)
    grid = OccupancyGrid(GridGeometry(1000, 1000, 0.05, Pose2D(0.0, 0.0)), cells)
    before = CoverageLattice.from_map(grid, Footprint(0.1, 0.05))
    started = time.thread_time()
    for _ in range(10):
        assert Agreement.of(before, before).is_close
    assert (time.thread_time() - started) / 10 < 0.005
