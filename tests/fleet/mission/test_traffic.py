"""Traffic of a fleet: who waits, who makes way, and that a narrow passage is no dead end."""

import math

import numpy as np
import pytest

from fasaco_edge.fleet.mission.refuge import refuge, without
from fasaco_edge.fleet.mission.traffic import Neighbour, obstruction, spaced
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.mission.events import MemberReceived

RADIUS_M, PACE_S_M = 0.2, 4.0


def heard(name, *points, waits_for=""):
    (x, y), *ahead = points
    return MemberReceived(
        name, state="covering", x=x, y=y, radius_m=RADIUS_M, ahead=tuple(ahead), waits_for=waits_for
    )


def seen(name, line, other, waits_for="", stands_s=0.0, pace_s_m=PACE_S_M):
    return obstruction(
        name,
        RADIUS_M,
        PACE_S_M,
        spaced(line),
        {other.robot: Neighbour(other, 0.0, stands_s, pace_s_m)},
        waits_for,
    )


EAST = [(0.0, 0.0), (2.0, 0.0)]
NORTH = [(1.0, -1.0), (1.0, 1.0)]


FACING = [(0.6, 0.0), (0.6, 2.0)]
ACROSS, LATER = [(1.0, -1.2), (1.0, 1.2)], [(1.0, -1.6), (1.0, 1.2)]
ON = [(0.5, 0.0), (2.5, 0.0)]
NEAR = [(0.7, 0.0), (2.0, 0.0)]
WEST = [(1.2, 0.0), (0.0, 0.0)]


def robots(case, name, line, waits_for, other, others_line, held_by, reason):
    return pytest.param(
        name, line, waits_for, heard(other, *others_line, waits_for=held_by), reason, id=case
    )


@pytest.mark.parametrize(
    ("name", "line", "waits_for", "other", "reason"),
    [
        robots("they meet: first", "r1", EAST, "", "r2", NORTH, "", ""),
        robots("they meet: second", "r2", NORTH, "", "r1", EAST, "", "waits for r1"),
        # The nearer one goes first, whatever its name.
        robots("nearer", "r9", NEAR, "", "r2", NORTH, "", ""),
        robots("farther", "r2", NORTH, "", "r9", NEAR, "", "waits for r9"),
        robots("far away", "r2", EAST, "", "r1", [(0.0, 3.0), (2.0, 3.0)], "", ""),
        robots("behind", "r2", EAST, "", "r1", [(-1.0, 0.0), (-3.0, 0.0)], "", ""),
        robots("there later", "r2", EAST, "", "r1", [(1.9, 1.0), (1.9, -1.0)], "", ""),
        robots("parting", "r2", EAST, "", "r1", [(0.0, 0.45), (0.0, 3.0)], "", ""),
        # One that waits needs a larger gap than one that drives.
        robots("gap", "r2", ON, "", "r1", LATER, "", ""),
        robots("larger gap", "r2", ON, "r1", "r1", LATER, "", "waits for r1"),
        # Face to face each waits for the other: the first by name is blocked, and plans around.
        robots("face to face: second", "r2", EAST, "r1", "r1", FACING, "r2", "waits for r1"),
        robots("face to face: first", "r1", EAST, "r2", "r2", FACING, "r1", "r2 stands in the way"),
        # Each waited for the other for ever: it had no place to go to.
        robots("no path", "r2", EAST, "r1", "r1", FACING[:1], "r2", "r1 stands in the way"),
        robots("in its way", "r1", FACING[:1], "r2", "r2", EAST, "r1", "makes way for r2"),
        robots("held by a third", "r2", EAST[:1], "", "r1", WEST, "r3", ""),
        # The other has the way, and does not make way at the same time.
        robots("over it", "r2", EAST, "r1", "r1", WEST, "r2", "makes way for r1"),
        robots("without work", "r1", [(1.0, 0.0)], "", "r2", EAST, "", "makes way for r2"),
        robots("stands near", "r1", EAST, "", "r2", [(0.8, 0.0)], "", "r2 stands in the way"),
        robots("stands far", "r1", EAST, "", "r2", [(1.9, 0.0)], "", ""),
    ],
)
def test_a_robot_waits_makes_way_or_goes_on(name, line, waits_for, other, reason):
    held = seen(name, line, other, waits_for)
    assert (held.reason if held else "") == reason


def test_of_two_on_one_line_only_the_second_makes_way():
    first = seen("r1", [(0.8, 0.0), (0.0, 0.0)], heard("r2", *EAST, waits_for="r1"), "r2")
    assert not first.is_on_path


def test_the_other_one_drives_at_its_own_pace():
    # It comes across 1 m away: as fast as this one both meet, at a tenth of the pace it is late.
    other = heard("r1", *ACROSS)
    assert seen("r2", ON, other, "r1").reason == "waits for r1"
    assert seen("r2", ON, other, "r1", pace_s_m=40.0) is None


def at(cell):
    return (cell[1] + 0.5) * 0.25, (cell[0] + 0.5) * 0.25


def test_a_path_around_a_standing_robot_is_driven_though_near():
    other = heard("r2", (0.4, 0.45))
    for is_avoided in (False, True):
        near = {"r2": Neighbour(other, 0.0, 9.0, PACE_S_M, is_avoided)}
        held = obstruction("r1", RADIUS_M, PACE_S_M, spaced(EAST), near, "")
        assert (held is None) == is_avoided
    near = {"r2": Neighbour(heard("r2", (0.4, 0.3)), 0.0, 9.0, PACE_S_M, True)}
    assert obstruction("r1", RADIUS_M, PACE_S_M, spaced(EAST), near, "").is_blocked


def sees_in(area):
    def sees(a, b):
        first, second = (area.lattice.cell_at(*point) for point in (a, b))
        return 1 <= len(area.shortest_path(first, second)) <= 2

    return sees


def area_of(free, cell):
    return ReachableArea.around(CoverageLattice.from_free(free, 0.25), cell)


def refuge_of(area, cell, *others, place=None, sees=None):
    """The way of a robot in a cell, or at a place in it, out of the way of others."""
    near = {other.robot: Neighbour(other, 0.0, 0.0, PACE_S_M) for other in others}
    here, sees = place or at(cell), sees or sees_in(area)
    return refuge(area, cell, here, RADIUS_M, near, area.lattice.centres, sees)


def test_a_refuge_and_its_way_avoid_discs_and_paths():
    free = np.zeros((12, 24), np.bool_)
    free[5], free[6:9, 4] = True, True  # a corridor with a niche
    way = refuge_of(area_of(free, (5, 8)), (5, 8), heard("r2", (3.2, 1.375), (0.1, 1.375)))
    assert tuple(way[-1].tolist()) in {(7, 4), (5, 2)}
    # Behind the other there is a place, too, but no way to it.
    free[6:9, 4] = False
    way = refuge_of(area_of(free, (5, 8)), (5, 8), heard("r2", (1.2, 1.375), (3.2, 1.375)))
    assert way[-1, 1] > 13


def test_the_way_to_a_refuge_leads_round_the_disc_of_the_other():
    # A ring of corridors: the other one comes from the east, where the way would be shorter.
    free = np.ones((3, 6), np.bool_)
    free[1, 1:5] = False
    area = area_of(free, (0, 2))
    ahead = [(0.125, 0.125), (0.125, 0.625), (0.625, 0.625)]
    way = refuge_of(area, (0, 2), heard("r2", (1.125, 0.125), *ahead))
    assert way.tolist()[-1] == [2, 4]
    assert [0, 0] in way.tolist()
    assert len(area.shortest_path((0, 2), (2, 4))) < len(way)


def test_a_robot_close_to_another_escapes_past_cells_near_it():
    free = np.zeros((2, 12), np.bool_)
    free[0, 4], free[1, 4:] = True, True
    area = area_of(free, (0, 4))
    other = heard("r2", (0.7, 0.45), at((0, 4)))
    # 0.41 m from the other; the first cell of the way, at 0.43 m, is reached by a corner.
    way = refuge_of(area, (0, 4), other, place=(1.02, 0.2))
    assert way is not None
    assert way.tolist() == [[1, 4], [1, 5], [1, 6]]
    assert refuge_of(area, (0, 4), other) is None


def test_a_way_out_of_a_doorway_may_begin_beside_the_own_cell():
    # Two stood in a doorway for good: the way through the next cell led round a corner, nearer to
    # the other; the way on which it had come led straight away, from a cell beside its own.
    area = area_of(np.ones((6, 12), np.bool_), (2, 5))
    (x, y), behind = at((2, 5)), at((1, 4))

    def sees(_, to):
        return math.dist(to, behind) < 0.01

    way = refuge_of(area, (2, 5), heard("r2", (x, y + 0.3), (x, y)), sees=sees)
    assert tuple(way[0].tolist()) == (1, 4)


def test_no_refuge_lies_beyond_another_robot():
    # A corridor: r1 stands in it, and r2 comes from the other side.
    free = np.zeros((3, 24), np.bool_)
    free[1] = True
    area = area_of(free, (1, 8))
    others = heard("r1", at((1, 5))), heard("r2", at((1, 12)), at((1, 7)))
    assert refuge_of(area, (1, 8), *others) is None


def test_a_refuge_is_sought_only_among_cells_around_the_robot():
    free = np.zeros((12, 100), np.bool_)
    free[5, 20:91] = free[5:11, 90] = free[10, 8:91] = True
    # At the other edge of these cells lies a room, connected far away only.
    free[6:11, 8:19] = True
    area = area_of(free, (5, 40))
    # Others, beside the corridor, are to drive all along it.
    others = [heard(f"r{x}", (x, 2.0), (x, 1.375), (x + 1.0, 1.375)) for x in range(5, 24)]
    assert area.reachable[7, 16]
    assert refuge_of(area, (5, 40), *others) is None


def test_closed_cells_have_no_steps_left():
    lattice = CoverageLattice.from_free(np.ones((3, 4), np.bool_))
    closed = np.zeros((3, 4), np.bool_)
    closed[1, 2] = True
    steps = without(lattice.steps, closed)
    rest = CoverageLattice.from_free(~closed)
    assert (steps == rest.steps).all()
