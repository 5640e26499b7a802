"""Visits are counted by cell, as the tool passes over its centre."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.grid.geometry import Pose2D, Window
from fasaco_edge.mission.coverage.ledger import (
    DROPPED_TILES,
    JUMP_CELLS,
    MOST_TILES,
    TILE,
    CoverageLedger,
)
from fasaco_edge.mission.coverage.mission_ledger import (
    MOST_AGAIN,
    MOST_PASSED,
    MissionLedger,
    PassedCells,
)
from fasaco_edge.mission.events import MapReceived
from tests.mission.world import CELL, Drive, building, pose_at
from tests.support.examples import examples


def drive(*points, cell_m=CELL):
    """A ledger of a drive over points (row, col) in cells, and what each pose entered."""
    ledger = CoverageLedger(cell_m)
    entered = [ledger.record(Pose2D(col * cell_m, row * cell_m)) for row, col in points]
    return ledger, entered


NEARBY = Window(-8, -8, 12, 40)


def counts(ledger, window=NEARBY):
    visits = ledger.visits(window)
    return {
        (row + window.row0, col + window.col0): int(visits[row, col])
        for row, col in np.argwhere(visits).tolist()
    }


def test_a_jump_is_not_swept():
    ledger, entered = drive((0.5, 0.5), (0.5, 0.6 + JUMP_CELLS))
    assert entered[1] == {(0, 2)}
    assert counts(ledger) == {(0, 0): 1, (0, 2): 1}
    # From where it landed it goes on as ever.
    ledger.record(Pose2D(4.5 * CELL, 0.5 * CELL))
    assert counts(ledger) == {(0, 0): 1, (0, 2): 1, (0, 3): 1, (0, 4): 1}


def test_coming_back_counts_again():
    there = [(0.5, 0.5 + 0.5 * step) for step in range(7)]
    ledger, _ = drive(*there, *there[::-1])
    # The far end was never left.
    assert counts(ledger) == {(0, 0): 2, (0, 1): 2, (0, 2): 2, (0, 3): 1}
    assert ledger.total == 7


def test_a_small_wobble_within_a_cell_is_no_second_visit():
    ledger, _ = drive(*[(0.5 + 0.2 * (step % 2), 0.5) for step in range(9)])
    assert ledger.total == 1


def test_negative_cells_and_far_ones_are_kept_as_the_array_grows():
    ledger, _ = drive((0.5, 0.5), (-99.5, 130.5), (400.5, -7.5), (0.5, 0.5))
    window = Window(-120, -20, 420, 150)
    assert counts(ledger, window) == {(0, 0): 2, (-100, 130): 1, (400, -8): 1}


def test_a_window_beside_what_was_driven_is_empty():
    ledger, _ = drive((0.5, 0.5))
    assert not ledger.visits(Window(1, 1, 5, 5)).any()
    assert not ledger.visits(Window(500, 500, 502, 503)).any()
    assert ledger.visits(Window(500, 500, 502, 503)).shape == (2, 3)
    assert CoverageLedger(CELL).visits(Window(0, 0, 2, 2)).tolist() == [[0, 0], [0, 0]]


def test_the_returned_array_is_a_copy():
    ledger, _ = drive((0.5, 0.5))
    ledger.visits(Window(0, 0, 1, 1))[0, 0] = 9
    assert counts(ledger) == {(0, 0): 1}


def test_visits_stop_counting_before_they_wrap():
    nearly = np.full((TILE, TILE), 65_534, np.uint16)
    ledger = CoverageLedger.restored(
        replace(CoverageLedger(CELL).snapshot(), tiles={(0, 0): nearly})
    )
    for _ in range(3):
        ledger.record(Pose2D(0.5 * CELL, 0.5 * CELL))
        ledger.record(Pose2D(9.5 * CELL, 0.5 * CELL))
    assert ledger.visits(Window(0, 0, 1, 1))[0, 0] == 65_535


@examples(40)
@given(
    st.lists(st.tuples(st.floats(-1.2, 1.2), st.floats(-1.2, 1.2)), max_size=12),
    st.sampled_from([0.25, 0.3, 1.0]),
)
def test_a_drive_visits_the_cells_under_many_small_discs(moves, cell_m):
    """The twin walks each leg in tiny steps and asks at every one what lies under the tool."""
    points = np.cumsum([(0.5, 0.5), *moves], axis=0)
    ledger, _ = drive(*points, cell_m=cell_m)
    window = Window(-16, -16, 17, 17)
    visits = ledger.visits(window) > 0
    rows, cols = np.mgrid[window.row0 : window.row1, window.col0 : window.col1] + 0.5
    nearest = np.full(rows.shape, np.inf)
    for a, b in zip(points, [*points[1:], points[-1]], strict=True):
        for share in np.linspace(0, 1, 200):
            row, col = a + share * (b - a)
            nearest = np.minimum(nearest, np.hypot(rows - row, cols - col))
    sure = abs(nearest - 0.5) > 1e-3
    assert np.array_equal(visits[sure], (nearest < 0.5)[sure])


@pytest.mark.parametrize("order", [1, -1])
def test_the_robots_cell_counts_in_either_order_of_map_and_pose(order):
    first = MapReceived(building("....")), pose_at(0, 2)
    standing = Drive((0, 2), *first[::order])
    assert standing.visited == {(0, 2)}
    standing.tell(pose_at(0, 2), MapReceived(building(".....")))
    assert standing.mission.covered.current.total == 1, "it has stood there all the time"


def same(one, other):
    """Tell whether two snapshots hold the same."""
    return (
        (one.cell_m, one.frame, one.total, one.under_tool)
        == (other.cell_m, other.frame, other.total, other.under_tool)
        and set(one.tiles) == set(other.tiles)
        and all(np.array_equal(one.tiles[place], other.tiles[place]) for place in one.tiles)
    )


def test_a_snapshot_stays_as_it_was():
    ledger, _ = drive((0.5, 0.5))
    first = ledger.snapshot()
    ledger.record(Pose2D(0.5 * CELL, 1.5 * CELL))
    ledger.record(Pose2D(200.5 * CELL, 1.5 * CELL))
    second = ledger.snapshot()
    assert (first.cells, second.cells) == (1, 3)
    assert first.visits(NEARBY).sum() == 1
    with pytest.raises(ValueError, match="read-only"):
        first.tiles[0, 0][0, 0] = 7
    with pytest.raises(TypeError):
        first.tiles[9, 9] = first.tiles[0, 0]


def test_a_restored_ledger_continues_without_a_difference():
    points = [(0.5, 0.5 + 0.4 * step) for step in range(12)]
    whole, _ = drive(*points, *points[::-1])
    begun, _ = drive(*points)
    restored = CoverageLedger.restored(begun.snapshot())
    assert same(restored.snapshot(), begun.snapshot())
    for row, col in points[::-1]:
        restored.record(Pose2D(col * CELL, row * CELL))
    assert same(restored.snapshot(), whole.snapshot())
    assert begun.total < restored.total, "they share nothing"


def test_cells_between_the_last_and_first_pose_are_not_covered():
    """Around a corner, and not straight to where the robot is heard of again."""
    ledger, _ = drive((0.5, 0.5))
    restored = CoverageLedger.restored(ledger.snapshot())
    assert restored.record(Pose2D(2.5 * CELL, 0.5 * CELL)) == {(0, 2)}
    assert counts(restored) == {(0, 0): 1, (0, 2): 1}


def test_poses_that_jump_over_the_world_keep_the_ledger_bounded():
    """A tile for each pose, as thin maps far away make them; then the robot is at home again."""
    ledger = CoverageLedger(CELL)
    here = Pose2D(0.5 * CELL, 0.5 * CELL)
    for number in range(2 * MOST_TILES):
        row, col = divmod(number, 100)
        ledger.record(Pose2D((col * TILE + 0.5) * CELL, ((row + 200) * TILE + 0.5) * CELL))
    ledger.record(here)
    assert len(ledger.snapshot().tiles) <= MOST_TILES
    assert len(ledger.snapshot().tiles) > MOST_TILES - 2 * DROPPED_TILES
    assert ledger.dropped > 0
    assert ledger.has_visited((0, 0))
    assert set(ledger.snapshot().tiles) == set(CoverageLedger.restored(ledger.snapshot())._tiles)


def test_the_tiles_nearest_to_the_robot_are_kept():
    ledger = CoverageLedger(CELL)
    for number in range(MOST_TILES + 1):
        ledger.record(Pose2D((number * TILE + 0.5) * CELL, 0.5 * CELL))
    kept = sorted(col for _, col in ledger.snapshot().tiles)
    assert kept == list(range(DROPPED_TILES, MOST_TILES + 1))


def test_the_robot_comes_back_to_a_cell_a_few_times_only():
    ledger = MissionLedger(CELL, CELL)
    for _ in range(MOST_AGAIN):
        assert ledger.may_open_again((0, 1))
        ledger.open_again([(0, 1)])
    assert not ledger.may_open_again((0, 1))
    assert ledger.may_open_again((1, 0))
    ledger.begin_elsewhere("map")
    assert ledger.may_open_again((0, 1))


def test_a_reopened_cell_is_covered_only_by_another_visit():
    ledger = MissionLedger(CELL, CELL)
    for col in (0, 1, 2):
        ledger.record(pose_at(0, col).pose.pose)
    before = ledger.version
    ledger.open_again([(0, 1), (5, 5)])
    assert ledger.version != before
    assert [ledger.current.has_visited((0, col)) for col in (0, 1, 2)] == [True, False, True]
    assert not ledger.current.has_visited((5, 5))
    ledger.record(pose_at(0, 1).pose.pose)
    assert ledger.current.has_visited((0, 1))


def test_a_cell_is_kept_until_its_floor_is_swept():
    cells = PassedCells()
    cells.add((3, 5))
    assert cells.next(9) == [(3, 5)]
    assert cells.inside(Window(3, 5, 4, 6)).all()
    cells.drop((3, 5))
    assert cells.next(9) == []
    assert not cells.inside(Window(0, 0, 9, 9)).any()


def test_passed_cells_are_checked_in_turn_and_bounded():
    cells = PassedCells()
    for col in range(MOST_PASSED + 5):
        cells.add((0, col))
    seen = [cells.next(500)[0][1] for _ in range(5)]
    assert seen == [5, 505, 1005, 1505, 5]
