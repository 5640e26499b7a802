"""A ledger from before a restart: taken over where the map does not speak against it."""

import time
from itertools import permutations

import numpy as np
import pytest

from fasaco_edge.errors import LedgerMismatchError
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.map_files import find_map, read_map, suggested_start
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.grid.reachable_area import ReachableArea, anchor_cell
from fasaco_edge.mission.coverage.fit import Fit, Verdict
from fasaco_edge.mission.coverage.ledger import CoverageLedger
from fasaco_edge.mission.coverage.loop_closure import Motion
from fasaco_edge.mission.events import Decision, MapReceived, State
from fasaco_edge.mission.map.building_watch import FOREIGN, Agreement
from tests.mission.world import Drive, building, pose_at, started
from tests.support.grids import seen_around

MAPS = ("office", "flat", "basement", "walled_grid", "warehouse")
ROBOT = Footprint(0.3, 0.18)

HALL = ("##############", *("#............#",) * 10, "##############")
# The same walls, with pillars where the hall's floor is.
PILLARS = (
    "##############",
    *("#.##.##.##.#.#", "#............#", "#.##.##.##.#.#") * 3,
    "#............#",
    "##############",
)


def moved(grid, x, y):
    """A map with its place in the frame moved [m]."""
    geometry = grid.geometry
    origin = Pose2D(geometry.origin.x + x, geometry.origin.y + y, geometry.origin.yaw)
    size = geometry.rows, geometry.cols, geometry.resolution
    return OccupancyGrid(GridGeometry(*size, origin), grid.cells)


def from_its_start(name):
    """A building in the frame of a mapper that was switched on where the robot starts."""
    x, y = suggested_start(find_map(name))
    return moved(read_map(find_map(name)), -x, -y)


def seen_within(grid, reach_m):
    """What a mapper knows that was just switched on."""
    return seen_around(grid, (0.0, 0.0), reach_m)


def covered_all(grid):
    """The ledger of a robot that has covered all it could reach."""
    lattice = CoverageLattice.from_map(grid, ROBOT)
    reachable = ReachableArea.around(lattice, anchor_cell(lattice, Pose2D(0, 0))).reachable
    ledger = CoverageLedger(ROBOT.cell_m, "map")
    for row, col in np.argwhere(reachable).tolist():
        x, y = col + lattice.window.col0 + 0.5, row + lattice.window.row0 + 0.5
        ledger.record(Pose2D(x * ROBOT.cell_m, y * ROBOT.cell_m))
    return ledger.snapshot()


@pytest.fixture(scope="module")
def buildings():
    return {name: from_its_start(name) for name in MAPS}


@pytest.fixture(scope="module")
def ledgers(buildings):
    return {name: covered_all(grid) for name, grid in buildings.items()}


def verdict(ledger, grid):
    return Fit.of(ledger, CoverageLattice.from_map(grid, ROBOT)).verdict


@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("reach_m", [2.0, 3.5, 8.0, 100.0])
def test_a_building_is_never_taken_for_another(buildings, ledgers, name, reach_m):
    """Nor if the mapper has just begun, and puts the walls a little elsewhere."""
    for x, y in ((0.0, 0.0), (0.1, 0.0), (-0.06, 0.08)):
        seen = seen_within(moved(buildings[name], x, y), reach_m)
        assert verdict(ledgers[name], seen) in (Verdict.SAME, Verdict.OPEN)
    assert verdict(ledgers[name], buildings[name]) is Verdict.SAME


@pytest.mark.parametrize("name", MAPS)
def test_most_other_buildings_are_detected_by_their_whole_maps(buildings, ledgers, name):
    others = [verdict(ledgers[name], buildings[other]) for other in MAPS if other != name]
    assert others.count(Verdict.OTHER) >= (2 if name == "office" else 3)


def fit(known, blocked, chance, covered=100):
    return Fit(covered, known, blocked, chance).verdict


def test_the_verdict_follows_the_measured_agreement():
    assert fit(0, 0, 0.0) is Verdict.OPEN
    assert fit(9, 9, 1.0) is Verdict.OPEN, "too few to tell"
    assert fit(30, 10, 1.0) is Verdict.OTHER
    assert fit(31, 10, 1.0) is Verdict.OPEN
    assert fit(100, 0, 0.3) is Verdict.SAME
    assert fit(100, 0, 0.3, covered=200) is Verdict.SAME
    assert fit(100, 0, 0.3, covered=201) is Verdict.OPEN, "the rest may tell"
    assert fit(100, 9, 0.3) is Verdict.SAME
    assert fit(100, 10, 0.3) is Verdict.OPEN
    assert fit(100, 18, 0.3) is Verdict.OPEN
    assert fit(100, 19, 0.3) is Verdict.OTHER
    assert fit(1000, 40, 0.02) is Verdict.OPEN, "a new rack in a hall"


def after(drive):
    """The ledger of a robot that drove, as its successor gets it."""
    return drive.mission.covered.current.snapshot()


def resumed(before, cell, *events):
    """A robot whose mission goes on after a restart."""
    drive = Drive(cell)
    drive.mission.restore(before)
    drive.tell(*events)
    return drive


def test_a_mission_continues_where_it_stopped():
    first = started(*HALL, cell=(1, 1))
    first.go(times=60)
    again = resumed(after(first), first.cell, MapReceived(building(*HALL)), pose_at(*first.cell))
    assert again.visited == first.visited
    assert again.mission.covered.current.total == first.mission.covered.current.total
    assert again.request.reason == "first plan, 61 cells were covered before"
    assert again.request.problem.cells == 120 - 61
    again.plan()
    again.finish()
    assert len(again.driven) < 100, "what was covered is not driven all over again"
    assert again.mission.coverage().remaining == 0


def test_a_finished_mission_stays_finished():
    first = started("....", "....")
    first.finish()
    again = resumed(after(first), (0, 0), MapReceived(building("....", "....")), pose_at(0, 0))
    assert again.mission.state is State.DONE
    assert again.decisions[-1] == Decision()


def test_a_restarted_mapper_keeps_the_ledger():
    first = started(*HALL, cell=(1, 1))
    first.go(times=60)
    small = building("...", "...", at=(1, 1))
    again = resumed(after(first), (1, 1), MapReceived(small), pose_at(1, 1))
    assert again.decisions[-1].faults == ()
    again.plan() if again.request else None
    decision = again.tell(MapReceived(building(*HALL)))
    assert decision.faults == ()
    assert again.mission.covered.current.snapshot().cells == 61


def test_another_building_is_reported_and_covered_from_zero():
    first = started(*HALL, cell=(1, 1))
    first.finish()
    other = MapReceived(building(*PILLARS))
    again = resumed(after(first), (1, 1), other, pose_at(1, 1))
    (fault,) = again.decisions[-1].faults
    assert isinstance(fault, LedgerMismatchError)
    assert str(fault) == "the ledger of 120 covered cells is of another building than the map"
    assert again.request.reason == f"{fault}: begun anew"
    assert again.mission.reason == again.request.reason
    assert again.visited == {(1, 1)}
    again.plan()
    again.finish()
    assert again.mission.covered.current.frame == "map"
    # It is asked once.
    assert again.tell(MapReceived(building(*HALL))).faults == ()


# How well two maps agree, and what of that makes them maps of two buildings.


def lattice(grid):
    return CoverageLattice.from_map(grid, ROBOT)


def test_maps_without_a_difference_agree_fully():
    assert Agreement(0, (0, 0), 0).kappa == Agreement(100, (0, 0), 0).kappa == 1.0


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
