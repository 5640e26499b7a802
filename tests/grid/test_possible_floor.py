"""The floor that the tool would reach if walls were thinner than the map shows them."""

import numpy as np
import pytest

from fasaco_edge.grid import possible_floor
from fasaco_edge.grid.fine_raster import RobotDiscs
from fasaco_edge.grid.floor import Floor
from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.grid.possible_floor import possible_m2

PIXEL_M = 0.05
DISCS = RobotDiscs(0.18, 0.3)
FOOTPRINT = Footprint(0.276, 0.18)


def building(gap_px, thick_px):
    """Two rooms and a gap between them; walls of the rooms ``thick_px`` thicker on either side."""
    cells = np.full((50, 90), 100, np.int8)
    cells[5 + thick_px : 45 - thick_px, 5 + thick_px : 43 - thick_px] = 0
    cells[5 + thick_px : 45 - thick_px, 47 + thick_px : 85 - thick_px] = 0
    first = 25 - gap_px // 2
    cells[first + thick_px : first + gap_px - thick_px, 40:50] = 0
    return OccupancyGrid(GridGeometry(50, 90, PIXEL_M, Pose2D(0.0, 0.0, 0.0)), cells)


def floor_of(grid):
    plain = CoverageLattice.from_map(grid, FOOTPRINT)
    return FloorMap(grid, plain, FOOTPRINT, DISCS, 8_000_000)


def everywhere(floor):
    return np.ones(floor.stands.lattice.states.shape, bool)


def nowhere(floor):
    return ~everywhere(floor)


def test_possible_floor_allows_for_walls_a_pixel_too_thick():
    """The 0.4 m gap is 0.3 m on the map, which closes off the other room."""
    start = 1.0, 1.0
    true_m2 = Floor.around(building(8, 0), DISCS, start).reachable_m2
    seen = building(8, 1)
    floor = floor_of(seen)
    shown_m2 = Floor.around(seen, DISCS, start).reachable_m2
    assert shown_m2 < 0.5 * true_m2
    found_m2 = possible_m2(floor, PIXEL_M, start, everywhere(floor), nowhere(floor))
    assert found_m2 == pytest.approx(true_m2, rel=0.06)
    assert possible_m2(floor, 0.0, start, everywhere(floor), nowhere(floor)) == pytest.approx(
        shown_m2, rel=0.001
    )


def test_a_room_behind_a_wall_is_not_possible():
    floor = floor_of(building(0, 0))
    one_m2 = possible_m2(floor, PIXEL_M, (1.0, 1.0), everywhere(floor), nowhere(floor))
    assert one_m2 < 2.0 * 2.0


def test_a_room_stays_possible_after_a_wall_closes_it_off():
    floor = floor_of(building(0, 0))
    cut_off = nowhere(floor)
    row, col = floor.stands.lattice.local(floor.stands.lattice.cell_at(3.4, 1.2))
    cut_off[row, col] = True
    one_m2 = possible_m2(floor, PIXEL_M, (1.0, 1.0), everywhere(floor), nowhere(floor))
    both_m2 = possible_m2(floor, PIXEL_M, (1.0, 1.0), everywhere(floor), cut_off)
    assert both_m2 == pytest.approx(2 * one_m2, rel=0.01)


def test_only_floor_that_is_asked_for_counts():
    floor = floor_of(building(8, 1))
    asked = everywhere(floor)
    asked[:, asked.shape[1] // 2 :] = False
    whole_m2 = possible_m2(floor, PIXEL_M, (1.0, 1.0), everywhere(floor), nowhere(floor))
    assert possible_m2(floor, PIXEL_M, (1.0, 1.0), asked, nowhere(floor)) == pytest.approx(
        whole_m2 / 2, rel=0.1
    )


def test_a_large_raster_and_a_full_one_have_no_answer(monkeypatch):
    floor = floor_of(building(8, 0))
    grid = building(8, 0)
    full = floor_of(OccupancyGrid(grid.geometry, np.full_like(grid.cells, 100)))
    assert possible_m2(full, PIXEL_M, (1.0, 1.0), everywhere(full), nowhere(full)) is None
    monkeypatch.setattr(possible_floor, "MOST_PIXELS", 1000)
    assert possible_m2(floor, PIXEL_M, (1.0, 1.0), everywhere(floor), nowhere(floor)) is None
