"""What can be reached, what changed of it, and where a robot that stands badly belongs."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.grid import reachable_area as area_module
from fasaco_edge.grid.changes import LatticeChange
from fasaco_edge.grid.geometry import Pose2D, Window
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.reachable_area import AreaChange, ReachableArea, anchor_cell
from fasaco_edge.mission.path.path_progress import FAR_CELLS, LOOK_AHEAD, PathProgress
from tests import naive
from tests.support.examples import examples
from tests.support.grids import lattice, placed, problems, with_passages_closed


def ground(*rows, at=(0, 0), cell=None):
    return ReachableArea.around(placed(lattice(*rows), *at), cell or at)


def path(*cells):
    return np.array(cells, np.int32).reshape(-1, 2)


def test_changes_are_counted_over_reachable_cells_only():
    before = ground("....#..", "....#..")
    assert not ground("....#.#", "....#..").change_since(before)
    assert ground("...##..", "....#..").change_since(before) == AreaChange(0, 1, 2)
    assert ground(".......", "....#..").change_since(before) == AreaChange(5, 0, 1)
    assert ground("....", "....").change_since(before) == AreaChange(0, 0, 0)
    assert ground("..", "..", at=(50, 50)).change_since(before) == AreaChange(4, 8, 0)


def test_a_change_knows_where_it_is():
    before = ground("....#..", "....#..")
    assert ground("...##..", "....#..").change_since(before).window == Window(0, 2, 2, 4)
    assert ground(".......", "....#..").change_since(before).window == Window(0, 3, 2, 7)
    assert ground("....", "....").change_since(before).window is None
    # What one of the two has no cells for counts, too.
    assert ground("....", "....", "....").change_since(before).window == Window(1, 0, 3, 4)
    assert ground("..", "..", at=(50, 50)).change_since(before).window == Window(0, 0, 52, 52)


def test_a_shifted_window_is_no_change():
    before = ground("###", "#..", at=(3, -4), cell=(3, -3))
    after = ground("#####", "#####", "##..#", "#####", at=(2, -5), cell=(3, -3))
    assert not after.change_since(before)
    assert not before.change_since(after)


def change_to(before, after):
    """What a new map tells: the cells that differ; beyond its window a lattice is unknown."""
    known = [
        {
            (row + lattice.window.row0, col + lattice.window.col0): (state, lattice.steps[row, col])
            for (row, col), state in np.ndenumerate(lattice.states)
        }
        for lattice in (before, after)
    ]
    old, new = known
    cells = [cell for cell in old.keys() | new.keys() if old.get(cell) != new.get(cell)]
    return LatticeChange(before, after, np.array(cells, np.int32).reshape(-1, 2))


def reworked(draw, lattice):
    """Some cells are open, closed or cut off that were not; the window may be another."""
    window, random = lattice.window, np.random.default_rng(draw(st.integers(0, 2**32)))
    toggled = random.random(lattice.states.shape) < draw(st.sampled_from((0.0, 0.02, 0.1)))
    pads = draw(st.tuples(*[st.integers(-1, 2)] * 4))
    south, north, west, east = (max(pad, 0) for pad in pads)
    floor = np.pad(lattice.coverable ^ toggled, ((south, north), (west, east)))
    inner = np.s_[max(-pads[0], 0) : -1 if pads[1] < 0 else None]
    across = np.s_[max(-pads[2], 0) : -1 if pads[3] < 0 else None]
    row0, col0 = window.row0 - pads[0], window.col0 - pads[2]
    again = CoverageLattice.from_free(floor[inner, across], lattice.cell_m)
    return placed(
        with_passages_closed(again, draw(st.sampled_from((0.0, 0.02))), random), row0, col0
    )


@examples(300)
@given(problems(max_side=24), st.data())
def test_an_update_of_the_area_equals_a_full_search(given_ground, data):
    lattice, start = given_ground
    before = ReachableArea.around(lattice, start)
    for _ in range(3):
        after = reworked(data.draw, before.lattice)
        corner = np.array((after.window.row0, after.window.col0))
        places = np.argwhere(after.coverable) + corner
        if not len(places):
            return
        here = tuple(places[data.draw(st.integers(0, 10**6)) % len(places)].tolist())
        start = start if start in set(map(tuple, places.tolist())) else here
        with pytest.MonkeyPatch.context() as patch:
            # However much has changed, first it is tried to look at that alone.
            patch.setattr(area_module, "LOCAL_SHARE", 1.0)
            ground = before.updated(change_to(before.lattice, after), start)
        assert ground.lattice is after
        assert np.array_equal(ground.reachable, ReachableArea.around(after, start).reachable)
        before = ground


def forged(ground):
    """A ground that holds a blocked cell in its corner: lost once all is searched anew."""
    reachable = ground.reachable.copy()
    reachable[-1, -1] = True
    return ReachableArea(ground.lattice, reachable)


def is_searched(before, *rows, cell=(0, 0)):
    """Tell whether the whole lattice was searched for a change to a drawing."""
    after = lattice(*rows)
    ground = forged(before).updated(change_to(before.lattice, after), cell)
    return not ground.reachable[-1, -1]


def drawn_over(rows, at, *pieces):
    """A drawing with something else from line and column ``at`` on."""
    line, col = at
    drawing = list(rows)
    for piece in pieces:
        drawing[line] = drawing[line][:col] + piece + drawing[line][col + len(piece) :]
        line += 1
    return drawing


# Two rooms with a door between them, and a third that nobody can come to.
ROOMS = ["." * 40 + "#" + "." * 18 + "##", *["." * 40 + "#" + "." * 18 + "#."] * 59]
WITH_DOOR = drawn_over(ROOMS, (30, 40), ".")


@pytest.mark.parametrize(
    ("at", "pieces", "searched"),
    [
        ((10, 12), ("##", "##"), False),  # a crate in the open
        ((10, 38), ("##",), False),  # and at a wall
        ((0, 0), ("#",), False),  # and in a corner
        ((30, 40), ("#",), True),  # the door is closed
        ((30, 39), ("#",), True),  # or blocked
        ((31, 40), (".",), False),  # or wider: a way more to where there was one
        ((20, 40), (".",), True),  # a second door, far from the first
        ((30, 59), (".",), True),  # a door to the third room
    ],
)
def test_a_full_search_runs_only_if_areas_split_or_merge(at, pieces, searched):
    before = ground(*WITH_DOOR)
    assert is_searched(before, *drawn_over(WITH_DOOR, at, *pieces)) is searched


def test_a_map_without_the_way_between_two_rooms_parts_them(monkeypatch):
    """The way led through cells that fell out of the map: among those left nothing came apart."""
    before = ground("......##", "........", "#######.", "........", "......##")
    after = lattice("......#", ".......", "#######", ".......", "......#")
    monkeypatch.setattr(area_module, "LOCAL_SHARE", 1.0)
    here = before.updated(change_to(before.lattice, after), (0, 0))
    assert before.contains((4, 0))
    assert not here.contains((4, 0))


def test_a_robot_carried_away_during_a_map_change_gets_its_area():
    before = ground(*ROOMS)
    after = lattice(*drawn_over(ROOMS, (10, 12), "##"))
    there = before.updated(change_to(before.lattice, after), (0, 50))
    assert there.contains((0, 50))
    assert not there.contains((0, 0))


def test_the_ground_of_another_lattice_is_searched():
    before = ground("...", "...")
    other = lattice("...", "...")
    after = lattice("..#", "...")
    assert before.updated(change_to(other, after), (0, 0)).reachable.sum() == 5


def test_a_robot_that_stands_elsewhere_has_another_ground():
    rooms = lattice("..#..", "..#..")
    before = ReachableArea.around(rooms, (0, 0))
    unchanged = LatticeChange(rooms, rooms, np.empty((0, 2), np.int32))
    assert before.updated(unchanged, (1, 1)) is before
    assert before.updated(unchanged, (0, 3)).reachable.tolist() == [[False] * 3 + [True] * 2] * 2


@examples(100)
@given(problems(max_side=5), st.lists(st.integers(0, 3), max_size=12), st.integers(0, 12))
def test_cells_hold_up_to_the_first_illegal_step(given_ground, headings, jump_at):
    lattice, start = given_ground
    walk = [start]
    for index, heading in enumerate(headings):
        up, right = naive.DIRECTIONS[heading]
        far = 2 if index == jump_at else 1
        walk.append((walk[-1][0] + far * up, walk[-1][1] + far * right))
    around = naive.neighbours(lattice.steps)
    legal = [
        there in around.get(here, {}).values()
        for here, there in itertools.pairwise(map(lattice.local, walk))
    ]
    expected = 1 + legal.index(False) if False in legal else len(walk)
    assert ReachableArea.around(lattice, start).drivable_prefix(path(*walk)) == expected


def test_a_walk_from_an_impossible_cell_cannot_be_driven():
    room = ground("..#")
    assert room.drivable_prefix(path()) == 0
    assert room.drivable_prefix(path((0, 1))) == 1
    for nowhere in ((7, 7), (0, 2), (-1, 1)):
        assert (
            room.drivable_prefix(path(nowhere)) == room.drivable_prefix(path(nowhere, (0, 1))) == 0
        )


def test_the_way_is_in_cells_of_the_map_frame():
    room = ground("...", ".#.", "...", at=(-2, 10))
    assert len(room.shortest_path((-2, 10), (0, 12))) == 5
    assert room.shortest_path((0, 11), (0, 12)).tolist() == [[0, 11], [0, 12]]
    assert room.shortest_path((-2, 10), (-2, 10)).tolist() == [[-2, 10]]
    for goal in ((-1, 11), (1, 10), (-2, 13)):
        assert room.shortest_path((-2, 10), goal).shape == (0, 2)


def test_a_robot_is_in_or_next_to_the_nearest_coverable_cell():
    room = lattice("...", "###", "...")
    assert anchor_cell(room, Pose2D(1.5, 0.5)) == (0, 1)
    assert anchor_cell(room, Pose2D(1.5, 0.99)) == (0, 1)
    assert anchor_cell(room, Pose2D(1.5, 1.3)) == (0, 1)
    assert anchor_cell(room, Pose2D(1.5, 1.7)) == (2, 1)
    assert anchor_cell(room, Pose2D(-0.4, 0.5)) == (0, 0)
    assert anchor_cell(room, Pose2D(-1.1, 0.5)) is None
    assert anchor_cell(room, Pose2D(80.0, -30.0)) is None


def test_a_robot_two_cells_from_anything_is_nowhere():
    room = lattice("####", "####", ".###", "####")
    assert anchor_cell(room, Pose2D(1.5, 2.5)) == (1, 0)
    assert anchor_cell(room, Pose2D(2.5, 3.5)) is None


def everywhere(cell):
    """The tool has passed over every cell."""
    return True


def test_a_pose_in_the_lane_beside_leaves_out_nothing():
    lanes = PathProgress(
        path(*[(0, col) for col in range(6)], *[(1, col) for col in range(5, -1, -1)])
    )
    beside = lanes.driven_to((1, 3), lambda cell: cell == (0, 0))
    assert beside.index == 0
    assert beside.driven_to((0, 1), lambda cell: False).index == 1, "the next cell needs no proof"
    assert lanes.driven_to((1, 3), lambda cell: cell[0] == 0 or cell[1] > 3).index == 8


def test_a_driven_path_follows_the_robot_a_little_way_ahead():
    line = PathProgress(path(*[(0, col) for col in range(40)]))
    assert line.driven_to((0, 3), everywhere).index == 3
    assert line.driven_to((0, LOOK_AHEAD - 1), everywhere).index == LOOK_AHEAD - 1
    assert line.driven_to((0, LOOK_AHEAD), everywhere).index == 0
    assert line.driven_to((0, 3), everywhere).driven_to((0, 1), everywhere).index == 3, (
        "never backwards"
    )
    assert line.driven_to((5, 5), everywhere) is line
    assert line.driven_to((0, 3), everywhere).ahead[0].tolist() == [0, 3]


def test_a_path_that_comes_back_is_followed_once_each_way():
    spike = PathProgress(path((0, 0), (0, 1), (0, 0), (1, 0)))
    out = spike.driven_to((0, 1), everywhere)
    assert (
        spike.driven_to((0, 0), everywhere).index,
        out.index,
        out.driven_to((0, 0), everywhere).index,
    ) == (0, 1, 2)
    assert not out.finished
    assert out.driven_to((1, 0), everywhere).finished


def test_a_robot_is_far_from_its_path_beyond_some_cells():
    line = PathProgress(path((0, 0), (0, 1)))
    assert not line.is_far((FAR_CELLS, 0))
    assert line.is_far((FAR_CELLS, 1))
    nothing = PathProgress(np.empty((0, 2), np.int32))
    assert not nothing.is_far((9, 9))
    assert nothing.finished
    assert nothing.driven_to((0, 0), everywhere) is nothing
