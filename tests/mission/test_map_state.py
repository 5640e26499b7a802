"""Maps taken one after the other: the map state is what the last map alone would give."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.grid.geometry import Pose2D, StampedPose, Window
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.occupancy import MapPatch
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.orders.zones import kept_out, without
from tests.support.examples import examples
from tests.support.grids import displaced, grid, occupancy_grids, part_of, repainted

FOOTPRINT = Footprint(cell_m=0.2, robot_radius_m=0.08)
ZONE = ((0.3, 0.3), (0.9, 0.3), (0.9, 0.8), (0.3, 0.8))


def take_something_in(draw, state, whole, zones):
    """A map or an update of it comes, or the zones are others; return building and zones."""
    match draw(st.sampled_from(["map", "part", "update", "jump", "zones"])):
        case "map":
            whole = repainted(draw, whole)
            state.receive_map(whole)
        case "part":
            state.receive_map(part_of(draw, whole))
        case "update" if state.grid is not None and state.grid.cells.size:
            rows, cols = state.grid.cells.shape
            row, col = draw(st.integers(0, rows - 1)), draw(st.integers(0, cols - 1))
            window = Window(row, col, min(row + 5, rows), min(col + 5, cols))
            cells = repainted(draw, state.grid).cells[row : row + 5, col : col + 5]
            state.receive_patches([MapPatch(window, cells.copy())])
        case "jump":
            whole = displaced(draw, whole)
            state.receive_map(whole)
        case _:
            zones = draw(st.sampled_from([(), (ZONE,)]))
            state.ground.keep_out(zones, state.grid)
            state.receive_map(replace(state.grid or whole))
    return whole, zones


@examples(150)
@given(st.data(), occupancy_grids(max_side=30))
def test_from_map_to_map_the_state_is_what_its_last_map_says(data, whole):
    state = MapState(MissionConfig(FOOTPRINT))
    zones, radius_m = (), FOOTPRINT.robot_radius_m
    x0, y0, x1, y1 = whole.geometry.bounds()
    for _ in range(6):
        whole, zones = take_something_in(data.draw, state, whole, zones)
        free = CoverageLattice.from_map(state.grid, FOOTPRINT)
        driven = without(free, kept_out(zones, free.window, free.cell_m, radius_m))
        for ours, theirs in ((state.ground.free, free), (state.ground.lattice, driven)):
            assert ours.window == theirs.window
            assert np.array_equal(ours.states, theirs.states)
            assert np.array_equal(ours.steps, theirs.steps)
        share = data.draw(st.sampled_from([0.2, 0.5, 0.8]))
        place = Pose2D(x0 + share * (x1 - x0), y0 + share * (y1 - y0))
        state.receive_pose(StampedPose(place))
        state.update_area()
        cell = state.robot_cell()
        assert (state.area is None) == (cell is None)
        if cell is not None:
            reachable = ReachableArea.around(driven, cell).reachable
            assert np.array_equal(state.area.reachable, reachable)


def test_a_map_that_says_nothing_new_changes_nothing():
    """Mappers send their map again and again: nothing that hangs on it is to be made anew."""
    state = MapState(MissionConfig(FOOTPRINT))
    cells = np.zeros((60, 60), np.int8)
    first = grid(cells)
    state.receive_map(first)
    state.receive_pose(StampedPose(Pose2D(1.0, 1.0)))
    state.update_area()
    lattice, ground = state.ground.lattice, state.area
    state.receive_map(grid(cells))
    state.update_area()
    assert state.map_revision == 2
    assert state.grid is not first
    assert state.ground.lattice is lattice
    assert state.area is ground
