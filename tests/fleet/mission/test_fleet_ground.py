"""Ground of a fleet: what others can reach counts where a robot's own map shows nothing."""

from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.errors import FleetError
from fasaco_edge.fleet.mission import shared_ground
from fasaco_edge.fleet.mission.division import Division, Robot, divide
from fasaco_edge.fleet.mission.members import Members
from fasaco_edge.fleet.mission.shared import MOST_ROBOTS, MOST_TILES_OF_ONE, SharedProgress
from fasaco_edge.fleet.mission.shared_ground import GroundQueue, SharedGround
from fasaco_edge.fleet.mission.tiles import TILE_BYTES
from fasaco_edge.grid.lattice import BLOCKED, UNKNOWN, CoverageLattice
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.mission.coverage.ledger import TILE
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.events import MapReceived, MemberReceived, Part
from fasaco_edge.mission.map.frame_selector import PATIENCE_S
from tests.fleet.mission.fleets import FleetDrive, FleetRobot
from tests.mission.world import CELL, building, pose_at, reachable_cells

CORRIDOR = ["." * 40] * 3
# A whole tile that r2 can reach.
LARGER = MemberReceived("r2", frame="map", epoch=1, ground=(((0, 0), b"\xff" * TILE_BYTES),))


def area_of(*rows, cell=(0, 0)):
    drive = FleetDrive(rows, {"r1": cell})
    drive.tick()
    return drive.robots["r1"].mission.map.area


def cells_of(area):
    window = area.lattice.window
    return {(row + window.row0, col + window.col0) for row, col in np.argwhere(area.reachable)}


def test_ground_of_others_joins_where_the_own_map_is_unknown():
    own, other = area_of("....", "...."), area_of("...." + "." * 60, "...#" + "." * 60)
    ground = SharedGround()
    ground.receive("r2", GroundQueue().next(other, 10))
    joint = ground.joint(own)
    # The other's obstacle lies where the own map shows free floor.
    assert cells_of(joint) == cells_of(own) | cells_of(other)
    assert ground.joint(own) is joint
    assert cells_of(own) == reachable_cells(building("....", "...."), (0, 0))


def test_the_own_maps_wall_counts_unless_it_may_be_a_door():
    own, other = area_of("..#", "..#"), area_of("......", "......")
    ground = SharedGround()
    ground.receive("r2", GroundQueue().next(other, 10))
    joint, beyond = ground.joint(own), ground.with_doors(own)
    assert cells_of(joint) == cells_of(own)
    assert cells_of(beyond) == {(row, col) for row in range(2) for col in (0, 1, 3, 4, 5)}
    for area in (joint, beyond):
        assert (area.lattice.states[:2, 2] == BLOCKED).all()
    # Asked for in each step of a robot that looks.
    assert ground.joint(own) is joint
    assert ground.with_doors(own) is beyond


HALLS = ["." * 9 + "#" + "." * 20 if row != 2 else "." * 30 for row in range(5)]
SHUT = [row[:9] + "#" + row[10:] for row in HALLS]


@pytest.mark.parametrize("is_open", [True, False])
def test_a_robot_looks_at_a_shut_door_that_others_came_through(is_open):
    fleet = FleetDrive(HALLS, {"r2": (0, 28)})
    ours = fleet.robots["r1"] = FleetRobot("r1", (0, 0), SHUT)
    fleet.swept.add(ours.cell)
    while ours.mission.reason != "looks for its part, which others see":
        assert ours.mission.state != "done"
        fleet.tick()
    assert ours.cell == (2, 8)
    assert len(set(fleet.robots["r2"].driven)) < 60
    if is_open:
        ours.tell(MapReceived(building(*HALLS)))
    fleet.finish()
    assert not fleet.left_out()
    beyond = {cell for cell in ours.driven if cell[1] > 9}
    assert bool(beyond) is is_open


@pytest.mark.parametrize("told", [5, 8])
def test_own_cells_beyond_others_ground_count_only_if_reachable(told):
    """Between there may be a wall: nobody came to sweep them, and a robot stood for them."""
    lattice = CoverageLattice.from_free(np.arange(10)[None] != 4)
    states = lattice.states.copy()
    states[0, 4] = UNKNOWN
    own = ReachableArea.around(replace(lattice, states=states), (0, 0))
    ground = SharedGround()
    bits = np.packbits(np.arange(TILE * TILE) < told).tobytes()
    ground.receive("r2", [((0, 0), bits)])
    assert cells_of(ground.joint(own)) == {(0, col) for col in range(told)}


def test_a_robot_looks_for_an_unseen_opening_before_a_shut_door():
    side = range(8, -1, -1)
    rows = ["." * 10 + ("." if row in (0, 6) else "#") + "." * 19 for row in side]
    # In row 6 r1 does not fit through; in row 0 it has not looked yet.
    own = ["." * 10 + ("#" if row else "?") + "?" * 19 for row in side]
    seen = ["." * 10 + ("#" if row else ".") + "." * 19 for row in side]
    fleet = FleetDrive(rows, {"r2": (8, 28)})
    ours = fleet.robots["r1"] = FleetRobot("r1", (8, 0), own)
    while ours.mission.reason != "looks for its part, which others see":
        assert ours.mission.state != "done"
        fleet.tick()
    assert ours.cell == (0, 9)
    ours.tell(MapReceived(building(*seen)))
    fleet.finish()
    assert len({cell for cell in ours.driven if cell[1] > 10}) > 20


def test_a_robot_too_wide_for_a_door_keeps_to_its_part():
    """Else it sweeps what the others are at, as a part beyond the door is none for it."""
    rows = ["." * 24 + ("." if row == 4 else "#") + "." * 12 for row in range(8)]
    fleet = FleetDrive(rows, {"r2": (7, 0), "r3": (0, 23)})
    fleet.robots["r1"] = FleetRobot("r1", (0, 0), ["." * 24 + "#" + "." * 12] * 8)
    fleet.finish(most=150)
    cells = [cell for robot in fleet.robots.values() for cell in robot.driven]
    assert len(cells) - len(set(cells)) < 40


def test_lost_ground_is_sent_as_lost():
    own, telling, ground = area_of("...."), GroundQueue(), SharedGround()
    larger, smaller = area_of("." * 9), area_of("." * 6)
    for told in (larger, smaller):
        ground.receive("r2", telling.next(told, 10))
    assert cells_of(ground.joint(own)) == cells_of(smaller)


@pytest.fixture
def members():
    ledger = MissionLedger(CELL, CELL, shared=SharedProgress())
    ledger.move_to("map")
    ledger.shared.begin_epoch(1)
    members = Members(ledger, CELL)
    members.receive(LARGER, 1.0)
    return members


def test_ground_of_an_unfitting_excessive_or_forgotten_robot_is_dropped(members):
    own = area_of("....")
    assert cells_of(members.ground.joint(own)) > cells_of(own)
    members.receive(replace(LARGER, frame="elsewhere"), 2.0)
    assert cells_of(members.ground.joint(own)) == cells_of(own)
    members.receive(LARGER, 3.0)
    assert cells_of(members.ground.joint(own)) > cells_of(own)
    tiles = tuple(((row, 9), b"\xff" * TILE_BYTES) for row in range(MOST_TILES_OF_ONE + 1))
    with pytest.raises(FleetError):
        members.receive(replace(LARGER, tiles=tiles), 4.0)
    assert cells_of(members.ground.joint(own)) == cells_of(own)
    members.receive(LARGER, 5.0)
    for number in range(MOST_ROBOTS):
        members.receive(MemberReceived(f"x{number}", frame="map", epoch=1), 20.0)
    assert "r2" not in members.known
    assert cells_of(members.ground.joint(own)) == cells_of(own)


def test_ground_sent_in_a_frame_since_left_does_not_count():
    fleet = FleetDrive(["...."], {"r1": (0, 0)})
    ours = fleet.robots["r1"]
    fleet.tick()
    ours.tell(LARGER)
    ground, own = ours.mission.company.others.ground, area_of("....")
    assert cells_of(ground.joint(own)) > cells_of(own)
    for _ in range(int(PATIENCE_S) + 2):
        ours.tell(MapReceived(building("....", frame="map2")), pose_at(0, 0, "map2"), after=1.0)
    assert ours.mission.covered.current.frame == "map2"
    assert cells_of(ground.joint(own)) == cells_of(own)


def test_tiles_are_sent_a_few_at_a_time_changed_ones_first():
    area = ReachableArea.around(CoverageLattice.from_free(np.ones((64, 64 * 5), np.bool_)), (0, 0))
    telling = GroundQueue()
    assert telling.next(None, 3) == ()
    assert [place for place, _ in telling.next(area, 3)] == [(0, 0), (0, 1), (0, 2)]
    assert [place for place, _ in telling.next(area, 3)] == [(0, 3), (0, 4), (0, 0)]


def test_ground_far_away_of_a_robot_that_lies_takes_no_memory():
    own, ground = area_of("...."), SharedGround()
    all_set = b"\xff" * TILE_BYTES
    ground.receive("r2", [((2**20, 2**20), all_set), ((1, 0), all_set)])
    joint = ground.joint(own)
    assert joint.lattice.states.size <= own.lattice.states.size + shared_ground.MOST_ADDED


def divided(robots, seeds, handicaps_s=(0.0, 0.0, 0.0)):
    parts = zip(robots, seeds, handicaps_s, strict=False)
    return Division.of(Part(robot.name, seed, s, robot.step_s) for robot, seed, s in parts)


@pytest.mark.parametrize("moved", [(0, 12), (1, 15)])
def test_parts_stay_in_place_while_nothing_ends_much_earlier(moved):
    lattice = CoverageLattice.from_free(np.ones((3, 40), np.bool_))
    wanted = np.ones((3, 40), np.bool_)
    robots = [Robot("r1", (0, 0), 1.0), Robot("r2", (0, 39), 1.0)]
    first = divide(lattice, wanted, robots)
    later = divide(lattice, wanted, [Robot("r1", moved, 1.0), robots[1]], first)
    assert [part.seed for part in later.parts] == [part.seed for part in first.parts]


@pytest.mark.parametrize(("idle_at", "helps"), [((5, 7), False), ((0, 20), True)])
def test_a_robot_gets_its_first_cells_only_if_all_end_sooner(idle_at, helps):
    """From too far its help comes late, and other robots' cells changed hands all the same."""
    lattice = CoverageLattice.from_free(np.ones((6, 40), np.bool_))
    wanted = np.zeros((6, 40), np.bool_)
    wanted[:2, 2:6], wanted[:, 34:] = True, True
    places, seeds = [(2, 5), idle_at, (3, 33)], ((1, 4), (3, 20), (3, 36))
    robots = [Robot(f"r{number}", cell, 1.0) for number, cell in enumerate(places)]
    before = divided(robots, seeds)
    after = divide(lattice, wanted, robots, before)
    changed = wanted & (before.owners(lattice) != after.owners(lattice))
    assert changed.any() == helps


# 30 x 60 cells, of which r1 knows the first 40 columns, or sees a wall after them.
WIDE = CoverageLattice.from_free(np.ones((30, 60), np.bool_))
NARROW = CoverageLattice.from_free(np.ones((30, 40), np.bool_))
WALLED = CoverageLattice.from_free(np.arange(60) != np.full((30, 1), 40))


@pytest.mark.parametrize("own", [NARROW, WALLED], ids=["off the map", "behind a wall"])
@pytest.mark.parametrize("step_s", [0.6, 1.2])
@pytest.mark.parametrize("wide", [20, 40])
def test_a_seed_out_of_reach_is_not_kept(own, step_s, wide):
    """Its huge handicap gave all to one robot, on its map and on the other's to different ones."""
    robots = [Robot("r1", (0, 0), step_s), Robot("r2", (29, 39), step_s)]
    before = divided(robots, ((0, 0), (15, 50)))
    wanted = np.zeros(own.steps.shape, np.bool_)
    wanted[:, :wide] = True
    after = divide(own, wanted, robots, before)
    on_r1s, on_r2s = (after.owners(lattice)[:, :wide] for lattice in (own, WIDE))
    assert (on_r1s == on_r2s).all()
    assert np.bincount(on_r1s.ravel(), minlength=2).min() > 0.4 * wanted.sum()


@pytest.mark.parametrize("own", [NARROW, WALLED], ids=["off the map", "behind a wall"])
def test_cells_out_of_reach_of_seeds_go_by_handicap_not_pace(own):
    robots = Robot("r1", (0, 0), 3.0), Robot("r2", (29, 39), 0.6)
    seeds = (15, 50), (20, 50)
    for handicaps_s, owner in (((0.0, 1000.0), 0), ((1000.0, 0.0), 1)):
        owners = divided(robots, seeds, handicaps_s).owners(own)
        assert (owners[:, :40] == owner).all()


def test_a_part_of_slow_cells_has_fewer_cells():
    # Dead ends on the left, each driven twice, and a hall on the right, along one corridor.
    free = np.zeros((8, 60), np.bool_)
    free[0], free[:, :40:2], free[:4, 40:] = True, True, True
    robots = [Robot("r1", (0, 0), 1.0), Robot("r2", (0, 59), 1.0)]
    lattice = CoverageLattice.from_free(free)
    owners = divide(lattice, free, robots).owners(lattice)[free]
    first, second = np.bincount(owners).tolist()
    assert 1.15 * first < second


def test_robots_that_stand_on_the_last_cells_each_have_their_own():
    # A cell took them no time: one got all, and the handicaps were no numbers.
    lattice = CoverageLattice.from_free(np.ones((5, 12), np.bool_))
    wanted = np.zeros((5, 12), np.bool_)
    wanted[2, 2], wanted[2, 9] = True, True
    robots = [Robot("r1", (2, 2), 1.0), Robot("r2", (2, 9), 1.0)]
    owners = divide(lattice, wanted, robots).owners(lattice)
    assert (owners[2, 2], owners[2, 9]) == (0, 1)


@pytest.mark.parametrize("step_s", [1.0, 1e-3, 1e3])
@pytest.mark.parametrize("cell", [(8, 30), (-500, 10**6), (2**29, -(2**29))])
def test_a_robot_out_of_reach_takes_no_cells_from_the_others(cell, step_s):
    free = np.ones((9, 60), np.bool_)
    free[6:] = False
    lattice = CoverageLattice.from_free(free)
    robots = [Robot("r1", (0, 0), 1.0), Robot("r2", cell, step_s), Robot("r3", (0, 59), 1.0)]
    division = divide(lattice, free, robots)
    assert division.names == ("r1", "r2", "r3")
    first, away, third = np.bincount(division.owners(lattice)[free], minlength=3).tolist()
    assert away == 0
    assert min(first, third) > 150


def test_a_robot_just_off_the_ground_gets_no_more_than_its_share():
    free = np.ones((9, 60), np.bool_)
    free[6:] = False
    robots = [Robot(f"r{col}", (7 * (col == 30), col), 1.0) for col in (0, 30, 59)]
    lattice = CoverageLattice.from_free(free)
    counts = np.bincount(divide(lattice, free, robots).owners(lattice)[free], minlength=3)
    assert counts.max() - counts.min() < 30


def test_a_distant_robot_without_a_part_takes_over_cells():
    lattice = CoverageLattice.from_free(np.ones((3, 100), np.bool_))
    wanted = np.zeros((3, 100), np.bool_)
    wanted[:, 60:] = True
    robots = [Robot("r1", (1, 0), 1.0), Robot("r2", (1, 99), 1.0)]
    before = divided(robots, ((1, 20), (1, 80)))
    assert (before.owners(lattice)[wanted] == 1).all()
    owners = divide(lattice, wanted, robots, before).owners(lattice)
    assert 20 < np.count_nonzero(owners[wanted] == 0) < 50
