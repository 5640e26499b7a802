"""Buildings that come into sight bit by bit, and a robot that does as it is told."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.occupancy import MapPatch
from fasaco_edge.mission.events import MapReceived, PatchReceived, State
from tests import naive
from tests.mission.world import (
    FOOTPRINT,
    PIXELS,
    Drive,
    building,
    idle,
    patch,
    placed,
    pose_at,
    reachable_cells,
    rectangle,
)
from tests.support.examples import examples


class Reveal:
    """A building whose blocks come into sight one by one.

    A block inside the map sent before comes as an update; one beyond it as a larger
    map, with another origin.
    """

    def __init__(self, truth, at, block, first, random):
        self.truth, self.at = truth, at
        self.known = np.full_like(truth, -1)
        rows, cols = (range(0, size, block) for size in truth.shape)
        blocks = [(row, col, row + block, col + block) for row in rows for col in cols]
        random.shuffle(blocks)
        # First of all the robot knows the ground it stands on.
        row, col = first
        self.left = [(row, col, row + PIXELS, col + PIXELS), *blocks]
        self.sent = None

    def event(self):
        """Reveal the next block."""
        row0, col0, row1, col1 = self.left.pop(0)
        here = np.s_[row0:row1, col0:col1]
        self.known[here] = self.truth[here]
        seen = Window(row0, col0, min(row1, len(self.truth)), min(col1, self.truth.shape[1]))
        if self.sent and self.sent.intersection(seen) == seen:
            base = self.sent
            window = Window(
                seen.row0 - base.row0, seen.col0 - base.col0,
                seen.row1 - base.row0, seen.col1 - base.col0,
            )  # fmt: skip
            return PatchReceived(MapPatch(window, self.truth[here].copy()))
        # The map's borders are pixels of the sensor's: they need not be cell borders.
        base = self.sent or seen
        base = self.sent = Window(
            min(base.row0, seen.row0), min(base.col0, seen.col0),
            max(base.row1, seen.row1), max(base.col1, seen.col1),
        )  # fmt: skip
        part = self.known[base.row0 : base.row1, base.col0 : base.col1].copy()
        at = self.at[0] + base.row0 / PIXELS, self.at[1] + base.col0 / PIXELS
        return MapReceived(placed(part, at))


@examples(80)
@given(
    rows=st.integers(1, 8),
    cols=st.integers(1, 8),
    at=st.sampled_from([(0, 0), (-5, 3), (100, -40)]),
    block=st.sampled_from([3, 4, 7, 16]),
    walls=st.sampled_from([0.0, 0.05, 0.15]),
    pace=st.integers(1, 6),
    patience=st.integers(0, 4),
    seed=st.integers(0, 2**32),
)
def test_a_robot_that_follows_its_paths_covers_all_it_can_reach(
    rows, cols, at, block, walls, pace, patience, seed
):
    """Each ``pace`` ticks a block is revealed; plans take up to ``patience`` ticks."""
    random = np.random.default_rng(seed)
    truth = np.where(random.random((rows * PIXELS, cols * PIXELS)) < walls, 100, 0)
    truth = truth.astype(np.int8)
    start = int(random.integers(rows)), int(random.integers(cols))
    inner = tuple(PIXELS * index for index in start)
    truth[inner[0] : inner[0] + PIXELS, inner[1] : inner[1] + PIXELS] = 0
    cell = start[0] + at[0], start[1] + at[1]
    building = placed(truth, at)
    reveal = Reveal(truth, at, block, inner, random)

    drive = Drive(cell, pose_at(*cell))
    waits = 0
    for tick in range(60 * rows * cols + 200):
        events = [reveal.event()] if reveal.left and tick % pace == 0 else []
        drive.go(*events)
        if drive.request is not None:
            waits += 1
            if waits > random.integers(patience + 1):
                waits = 0
                drive.plan()
        if drive.mission.state is State.DONE and not reveal.left:
            break
    assert drive.mission.state in (State.DONE, State.BLOCKED)
    expected = reachable_cells(building, cell)
    assert expected <= drive.visited
    assert not drive.decisions[-1].faults
    coverage = drive.mission.coverage()
    assert (coverage.covered, coverage.remaining) == (len(expected), 0)

    # What was legal on the map then is legal in the building: it never grows walls.
    whole = CoverageLattice.from_map(building, FOOTPRINT)
    around = naive.neighbours(whole.steps)
    for here, there in itertools.pairwise(map(whole.local, drive.driven)):
        assert there in around[here].values()


@examples(40)
@given(seed=st.integers(0, 2**32), pace=st.integers(2, 9))
def test_walls_that_come_and_go_never_lead_to_an_illegal_step(seed, pace):
    """People and doors: single cells close and open again, never under the robot."""
    random = np.random.default_rng(seed)
    truth = np.zeros((6 * PIXELS, 7 * PIXELS), np.int8)
    drive = Drive((0, 0), MapReceived(placed(truth.copy(), (0, 0))), pose_at(0, 0))
    for tick in range(150):
        events = []
        if tick % pace == 0:
            row, col = int(random.integers(6)), int(random.integers(7))
            if (row, col) != drive.cell and (not drive.walk or (row, col) != drive.walk[0]):
                block = np.s_[row * PIXELS : (row + 1) * PIXELS, col * PIXELS : (col + 1) * PIXELS]
                truth[block] = 100 - truth[block]
                window = Window(block[0].start, block[1].start, block[0].stop, block[1].stop)
                events = [PatchReceived(MapPatch(window, truth[block].copy()))]
        drive.go(*events)
        if drive.request is not None and random.random() < 0.5:
            drive.plan()
    drive.tell(MapReceived(placed(np.zeros_like(truth), (0, 0))))
    drive.finish()
    assert drive.visited == set(np.ndindex(6, 7))


@pytest.mark.parametrize(
    ("wall", "col0", "col1", "area"),
    [
        ("#", 6, 8, "0.2"),
        ("#", 6, 16, "1.2"),  # most of it lies beyond the map
        ("?", 6, 8, "0.2"),
    ],
)
def test_the_area_of_an_unreached_zone_is_reported(wall, col0, col1, area):
    drive = idle(*(f"...#{wall}#...",) * 2)
    zones = [
        {"name": "here", "polygon": rectangle(0, 0, 2, 2)},
        {"name": "there", "polygon": rectangle(0, col0, 2, col1)},
    ]
    drive.command("start", {"zones": zones})
    drive.finish()
    assert drive.mission.reason.endswith(f"; not reached: 'there' ({area} m2)")


def test_a_zone_covered_before_its_door_shut_is_not_named():
    drive = idle("." * 9, cell=(0, 8))
    zones = [
        {"name": "a", "polygon": rectangle(0, 6, 1, 9)},
        {"name": "b", "polygon": rectangle(0, 0, 1, 3)},
    ]
    drive.command("start", {"zones": zones})
    for _ in range(100):
        if drive.cell == (0, 3):
            break
        drive.tick()
    drive.tell(patch("#", at=(0, 4)))
    drive.finish()
    assert drive.mission.reason == "every reachable cell of the zones is covered"


@pytest.mark.parametrize("over", [False, True])
def test_a_restarted_mapper_hides_no_floor_of_an_order(over):
    """What is covered in sight is not all: beyond it the map showed more before the restart."""
    wall = "#" * 14
    seen = building(wall, "#........     ", wall)
    whole = building(wall, f"#{'.' * 12}#", wall)
    drive = Drive((1, 1), MapReceived(whole), pose_at(1, 1))
    while len(drive.visited) < 9:
        drive.tick()
    if over:
        drive.finish()
    drive.cell = 1, 1
    again = drive.restarted(MapReceived(seen), pose_at(1, 1))
    again.tick(times=20)
    # An order that was over is not begun again for this.
    assert again.cell == ((1, 1) if over else (1, 8))
    assert (again.mission.state is State.DONE) is over
    if not over:
        again.tell(MapReceived(whole))
        again.finish()
        assert len(again.visited) == 12


def test_a_restart_on_the_same_map_explores_no_border():
    wall = "#" * 14
    seen = building(wall, "#........     ", wall)
    drive = Drive((1, 8), MapReceived(seen), pose_at(1, 8))
    while len(drive.visited) < 5:
        drive.tick()
    again = drive.restarted(MapReceived(seen), pose_at(*drive.cell))
    again.finish()
    assert len(again.visited) == 8
    assert (1, 8) not in again.driven
