"""The living trail through a mission: it follows map, paths and robot, and outlives a restart."""

from itertools import pairwise

import numpy as np
import pytest

from fasaco_edge.daemon.ledger.codec import decode_ledger, encode_ledger
from fasaco_edge.mission.core.mission import Mission
from fasaco_edge.mission.events import MapReceived
from fasaco_edge.planners.living_trail import branching
from tests.mission.world import CELL, CONFIG, building, patch, pose_at, robot_in, started

ROOMS = ("..........", "..........", "....##....", "....##....", "..........", "..........")
TAU0 = np.float32(CONFIG.trail.tau0)


def tau_of(drive):
    """The trail over the lattice as it is."""
    return drive.mission.trail.snapshot().on(drive.mission.lattice.window)


def along(drive, cells):
    """Pheromone on the steps of a walk over cells (row, col)."""
    held, found = drive.mission.trail.snapshot(), []
    ways = {(0, 1): 0, (1, 0): 1, (0, -1): 2, (-1, 0): 3}
    for (row, col), (to_row, to_col) in pairwise(cells):
        way = ways[to_row - row, to_col - col]
        found.append(held.tau[row - held.window.row0, col - held.window.col0, way])
    return np.array(found)


def growing():
    """A mission over a map that grows twice, and in which a box appears."""
    drive = robot_in(*(row[:4] for row in ROOMS))
    for tick in range(300):
        if drive.mission.state == "done":
            return drive
        news = []
        if tick == 5:
            news = [MapReceived(building(*(row[:7] for row in ROOMS)))]
        elif tick == 12:
            news = [MapReceived(building(*ROOMS))]
        elif tick == 20:
            news = [patch("##", at=(0, 8))]
        drive.tick(*news)
        steps = drive.mission.lattice.steps
        legal = (steps[..., np.newaxis] >> np.arange(4)) & 1
        np.testing.assert_array_equal(tau_of(drive) > 0, legal > 0)
    raise AssertionError("not done")


def test_a_trail_has_each_maps_steps_and_repeats_bit_for_bit():
    one, other = growing(), growing()
    assert one.mission.lattice.window.cols == 10
    np.testing.assert_array_equal(tau_of(one), tau_of(other))
    assert one.mission.trail.changes == other.mission.trail.changes > 10


def test_a_planned_path_strengthens_it_and_what_was_driven_fades():
    drive = robot_in(*ROOMS)
    assert branching(tau_of(drive)) > 2
    np.testing.assert_array_equal(tau_of(drive)[tau_of(drive) > 0], TAU0)
    drive.plan()
    walk = drive.updates[-1].cells.tolist()
    planned = along(drive, walk)
    assert (planned > 1.5 * TAU0).all()
    assert branching(tau_of(drive)) < 1.5
    drive.go(times=5)
    np.testing.assert_allclose(along(drive, walk[:6]), (planned[:5] + TAU0) / 2, rtol=1e-6)
    np.testing.assert_array_equal(along(drive, walk[5:]), planned[5:])


def test_a_path_that_is_only_cut_off_strengthens_no_trail():
    drive = started(*ROOMS)
    before = drive.mission.trail.snapshot().tau
    row, col = drive.walk[12]
    there = drive.tell(patch("#", at=(row, col))).path
    assert there is not None
    assert there.plan is None
    far = np.ones(before.shape[:2], bool)
    far[max(row - 2, 0) : row + 3, max(col - 2, 0) : col + 3] = False
    np.testing.assert_array_equal(tau_of(drive)[far], before[far])
    assert not tau_of(drive)[row, col].any()


def test_the_trail_continues_after_a_restart():
    drive = started(*ROOMS)
    drive.go(times=8)
    before = drive.mission.snapshot()
    kept = decode_ledger(encode_ledger(before), CELL)
    np.testing.assert_allclose(kept.trail.tau, before.trail.tau, rtol=0.004)
    again = Mission(CONFIG)
    again.restore(kept)
    again.step([MapReceived(building(*ROOMS)), pose_at(*drive.cell)], 0.0)
    np.testing.assert_array_equal(again.trail.snapshot().tau, kept.trail.tau)


def test_the_trail_is_cleared_by_a_reset_or_another_frame():
    drive = started(*ROOMS)
    assert tau_of(drive).max() > TAU0
    drive.command("reset")
    assert tau_of(drive).max() == TAU0
    drive = started(*ROOMS)
    for _ in range(20):
        drive.tell(MapReceived(building(*ROOMS, frame="odom")), pose_at(0, 0, "odom"), after=1.0)
    assert drive.mission.grid.frame == "odom"
    assert drive.request is not None
    assert tau_of(drive).max() == TAU0


WALLED = ("############", *(f"#{row}#" for row in ROOMS), "############")


@pytest.mark.parametrize("together", [True, False])
def test_a_loop_closure_takes_it_along(together):
    drive = started(*WALLED, cell=(1, 1))
    drive.go(times=4)
    before, walk = tau_of(drive), drive.walk[:]
    row, col = drive.cell
    moved, there = MapReceived(building(*WALLED, at=(0, 3))), pose_at(row, col + 3)
    if together:
        drive.tell(moved, there)
    else:
        drive.tell(moved)
        drive.tell(there)
    assert drive.mission.lattice.window.col0 == 3
    tau = tau_of(drive)
    # No step is another one, but the path may be repaired by then, and strengthens its steps.
    ahead = along(drive, [(row, col + 3) for row, col in walk])
    assert (ahead > 1.5 * TAU0).all()
    np.testing.assert_array_equal(tau > 0, before > 0)
    np.testing.assert_array_equal(tau, before)


def test_a_plan_starts_from_the_trail():
    drive = robot_in(*ROOMS)
    np.testing.assert_array_equal(drive.request.problem.trail.tau, tau_of(drive))
    drive.plan()
    seen = drive.request
    assert seen is None
    drive.go(patch("#", at=(5, 9)))
    assert (drive.request.problem.trail.tau > 0.11).any()


def test_missions_on_the_living_trail_are_reproducible():
    drives = []
    for _ in range(2):
        drive = started(*(row[:5] for row in ROOMS))
        drive.go(MapReceived(building(*ROOMS)))
        drive.finish()
        drives.append(drive)
    assert drives[0].driven == drives[1].driven
    np.testing.assert_array_equal(*(tau_of(drive) for drive in drives))
