"""The price of steps from one room into another: where rooms are known, and as it is asked for."""

from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.rooms import find_rooms
from fasaco_edge.grid.rotation import rotated_geometry
from fasaco_edge.mission.rooms.room_cells import RoomCells
from fasaco_edge.mission.rooms.room_watch import RoomWatch, update
from fasaco_edge.mission.work.plan_scope import with_rooms
from fasaco_edge.mission.work.progress import seconds_in
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.problem import CoverageProblem
from tests.benchmarks.rooms.homes import home
from tests.benchmarks.rooms.one_by_one import building_of

FLOOR, LOOKS = home("home", 4), 12


@pytest.fixture(scope="module")
def watch():
    """Rooms of a home, seen long enough to be there."""
    watch, found = RoomWatch(), find_rooms(FLOOR.grid)
    for _ in range(LOOKS):
        update(watch.book, found, "map")
    return watch


def problem_at(lattice_deg):
    """The home to be covered, by cells at an angle to the axes of the map."""
    grid = FLOOR.grid
    if lattice_deg:
        grid = replace(grid, geometry=rotated_geometry(grid.geometry, -lattice_deg))
    there = building_of(replace(FLOOR, grid=grid))
    problem = CoverageProblem.of(there.lattice, there.start, cost=CoverageCost(1.2, 1.5))
    return problem, grid.geometry


@pytest.mark.parametrize("lattice_deg", [0.0, 17.0])
def test_cells_are_in_the_rooms_that_they_lie_in(watch, lattice_deg):
    problem, geometry = problem_at(lattice_deg)
    priced = with_rooms(problem, RoomCells(watch, lattice_deg), "auto")
    assert priced.cost == replace(problem.cost, room_s=54.0)
    own = np.argwhere(problem.to_cover)
    corner = np.array((problem.lattice.window.row0, problem.lattice.window.col0), np.int32)
    centres = problem.lattice.centres((own + corner).astype(np.int32))
    true = geometry.values_at(FLOOR.rooms, centres)
    rooms = priced.rooms[tuple(own.T)]
    assert np.mean(rooms > 0) > 0.95
    # Two of the true rooms are found as one.
    counts = [np.bincount(true[(rooms == room) & (true > 0)]) for room in np.unique(rooms) if room]
    assert sum(count.max() for count in counts) > 0.85 * sum(count.sum() for count in counts)
    assert len(np.unique(rooms)) > 4


def test_without_rooms_a_problem_does_not_change(watch):
    problem, _ = problem_at(0.0)
    assert with_rooms(problem, RoomCells(watch, 0.0), "never") is problem
    assert with_rooms(problem, RoomCells(RoomWatch(), 0.0), "auto") is problem


def test_a_way_takes_its_time_in_the_rooms_it_leads_through():
    rooms, window = np.array([[1, 1, 0, 2, 2]], np.uint16), Window(0, 0, 1, 5)
    ahead = np.array([[0, col] for col in (0, 1, 2, 3, 4, 3)], np.int32)
    assert seconds_in(rooms, window, ahead, 10.0) == {0: 2.0, 1: 2.0, 2: 6.0}
    assert seconds_in(rooms, window, ahead[:1], 0.0) == {}
