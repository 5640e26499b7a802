"""Maps in UTM: what a mission makes of a map does not depend on where it lies."""

import numpy as np
import pytest

from fasaco_edge.errors import MapTooFar
from fasaco_edge.grid.geometry import FARTHEST_M, MOST_INDEX, GridGeometry, Pose2D
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.events import MapReceived, State
from tests.mission.world import CELL, CONFIG, Drive, building, pose_at

# Easting and northing of a place in Germany, and the largest northing there is [m].
UTM = [(500_000.0, 5_500_000.0), (833_000.25, 9_999_990.5), (-19_999_000.0, 19_999_000.0)]
ROOM = ("#######", "#.....#", "#.##..#", "#.....#", "#######")


def cells_of(place):
    """The cell (row, col) that begins at a place (x, y) [m]."""
    return round(place[1] / CELL), round(place[0] / CELL)


@pytest.mark.parametrize("place", UTM)
def test_a_far_building_is_covered_as_one_at_zero(place):
    row, col = cells_of(place)
    near, far = Drive((1, 1)), Drive((row + 1, col + 1))
    for drive, at in ((near, (0, 0)), (far, (row, col))):
        drive.tell(MapReceived(building(*ROOM, at=at)), pose_at(*drive.cell))
        drive.plan()
    walk = near.mission.route.path.cells
    assert np.array_equal(far.mission.route.path.cells, walk + np.array((row, col)))
    centres = far.mission.lattice.centres(far.mission.route.path.cells)
    assert np.abs(centres - near.mission.lattice.centres(walk) - place).max() < 1e-8
    while far.walk:
        far.go()
    assert far.mission.state is State.DONE
    assert far.mission.coverage().covered == near.mission.coverage().coverable


@pytest.mark.parametrize("place", UTM)
@pytest.mark.parametrize("yaw", [0.0, 0.3])
def test_a_lattice_is_the_same_wherever_it_lies(place, yaw):
    """Of a real resolution, whose multiples float64 has not: cells of six pixels, walls of one."""
    footprint, pixels = Footprint(0.3, 0.18), np.zeros((120, 160), np.int8)
    pixels[[0, -1]], pixels[:, [0, -1]] = 100, 100
    pixels[40:50, 30:90] = 100
    pixels[:, 120:] = -1
    shift = np.array([round(at / 0.3) for at in place[::-1]])

    def lattice(row, col):
        origin = Pose2D(col * 0.3 + 0.013, row * 0.3 + 0.021, yaw)
        grid = OccupancyGrid(GridGeometry(*pixels.shape, 0.05, origin), pixels)
        return CoverageLattice.from_map(grid, footprint)

    near, far = lattice(0, 0), lattice(*shift.tolist())
    assert far.window == near.window.moved(*shift.tolist())
    assert np.array_equal(far.states, near.states)
    assert np.array_equal(far.steps, near.steps)


@pytest.mark.parametrize(
    ("x", "y", "cell_m"),
    [
        (-FARTHEST_M, 0.0, 0.3),
        (0.0, FARTHEST_M, 0.3),
        (np.nextafter(FARTHEST_M, 0.0), 0.0, 0.3),
        (0.0, 2.0 * MOST_INDEX * 0.001, 0.001),
    ],
)
def test_a_lattice_too_far_from_zero_is_refused(x, y, cell_m):
    geometry = GridGeometry(3, 3, cell_m, Pose2D(x, y))
    grid = OccupancyGrid(geometry, np.zeros((3, 3), np.int8))
    with pytest.raises(MapTooFar, match=r"a lattice from \(.*\) m, of cells of .* reaches beyond"):
        CoverageLattice.from_map(grid, Footprint(cell_m, cell_m / 2))


def test_the_state_says_that_the_only_map_was_refused():
    drive = Drive((1, 1), config=CONFIG)
    drive.tell(MapReceived(building(*ROOM, at=cells_of((0.0, FARTHEST_M)))))
    assert drive.mission.state is State.WAITING_FOR_MAP
    assert drive.mission.reason.startswith("no map yet: the last one was refused: a lattice from")
