"""Robots whose maps have frames of their own share an area: what others tell is placed."""

import math
from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.config.config import DaemonConfig, FleetConfig
from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.fleet.daemon.exchange import PERIOD_S, FleetReceiver, FleetSender
from fasaco_edge.fleet.mission.division import Division
from fasaco_edge.fleet.mission.frames import (
    MOST_OTHERS,
    FleetFrames,
    ResampledTiles,
    placed_point,
    seen_from,
)
from fasaco_edge.fleet.mission.kind import FleetKind
from fasaco_edge.grid.geometry import Pose2D, StampedPose
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.mission.coverage.ledger import TILE
from fasaco_edge.mission.events import MapReceived, MemberReceived, Part, PoseReceived
from fasaco_edge.wire.documents.fleet import CellTile, FleetMember, FleetPart
from fasaco_edge.wire.documents.json_text import encode_json
from tests.mission.world import CELL, Drive, building

AT = Pose2D(3.1, -2.0, math.radians(30.0))


def bits_of(cells):
    bits = np.zeros((TILE, TILE), np.bool_)
    bits[tuple(np.array(sorted(cells)).T)] = True
    return np.packbits(bits.reshape(-1)).tobytes()


def cells_of(tiles):
    return {
        (row * TILE + int(r), col * TILE + int(c))
        for (row, col), bits in tiles
        for r, c in np.argwhere(np.unpackbits(np.frombuffer(bits, np.uint8)).reshape(TILE, TILE))
    }


@pytest.mark.parametrize(
    "cells", [{(0, 0), (5, 60)}, {(r, c) for r in range(40) for c in range(9)}]
)
def test_on_the_same_lattice_tiles_stay_as_they_are(cells):
    told = (((-1, 2), bits_of(cells)),)
    assert ResampledTiles(Pose2D(0.0, 0.0), CELL).tiles(told) == told


def test_quarter_turns_and_whole_cells_lose_and_add_no_cell():
    cells = {(0, 0), (0, 63), (7, 9), (63, 63)}
    resampled = ResampledTiles(Pose2D(5 * CELL, -3 * CELL, math.pi / 2), CELL)
    # A quarter-turn leads from (x, y) to (-y, x).
    expected = {(col - 3, -1 - row + 5) for row, col in cells}
    assert cells_of(resampled.tiles([((0, 0), bits_of(cells))])) == expected
    assert {resampled.cell(*cell) for cell in cells} == expected


def test_a_cell_askew_has_the_value_of_the_cell_below_its_centre():
    cells = {(row, col) for row in range(3, 40) for col in range(10, 50)}
    found = cells_of(ResampledTiles(AT, CELL).tiles([((0, 0), bits_of(cells))]))
    back = seen_from(Pose2D(0.0, 0.0), AT)
    for row in range(-60, 60):
        for col in range(-60, 80):
            x, y = placed_point(back, (col + 0.5) * CELL, (row + 0.5) * CELL)
            below = math.floor(y / CELL), math.floor(x / CELL)
            assert ((row, col) in found) == (below in cells)


def test_repeated_tiles_of_another_frame_give_the_same_cells():
    resampled = ResampledTiles(AT, CELL)
    every = bits_of({(row, col) for row in range(TILE) for col in range(TILE)})
    resampled.tiles([((0, 0), every)])
    both = cells_of(resampled.tiles([((0, 1), every)]) + resampled.tiles([((0, 0), every)]))
    # Along the border of the two tiles nothing is missing.
    assert abs(len(both) - 2 * TILE * TILE) < 4 * TILE * 0.1
    assert resampled.tiles([((0, 1), every)]) == resampled.tiles([((0, 1), every)])


def test_a_new_epoch_ends_what_was_swept_before():
    frames = FleetFrames(Pose2D(0.0, 0.0), 0.0, CELL)
    first, second = ({(row, col) for row in range(8) for col in cols} for cols in ((1, 2), (8, 9)))
    heard = MemberReceived("r2", frame="house", epoch=1, tiles=(((0, 0), bits_of(first)),))
    before = cells_of(frames.event(heard, AT, 0.0).tiles)
    later = replace(heard, epoch=2, tiles=(((0, 0), bits_of(second)),))
    after = cells_of(frames.event(later, AT, 0.0).tiles)
    assert before
    assert after
    assert not before & after


def test_each_known_robot_keeps_its_ground():
    """With one more than there was room for, each lost what it had told before, in turn."""
    frames, every = FleetFrames(Pose2D(10 * CELL, 0.0), 0.0, CELL), bits_of({(0, 0), (0, 63)})
    names = [f"r{number}" for number in range(MOST_OTHERS)]

    def told(name, col):
        heard = MemberReceived(name, epoch=1, ground=(((0, col), every),))
        return frames.event(heard, Pose2D(0.0, 0.0), 0.0).ground

    # Shifted by ten cells, the first tile here has cells of two of theirs.
    for name in names:
        told(name, 0)
    for name in names:
        assert cells_of(told(name, 1)) == {(0, 53), (0, 54), (0, 117)}
    # One more displaces the one heard longest ago.
    told("r0", 0)
    told("new", 0)
    assert cells_of(told("r0", 0)) == {(0, -10), (0, 53), (0, 54)}
    assert cells_of(told("r1", 1)) == {(0, 54), (0, 117)}


def test_places_and_seeds_come_in_this_robots_frames():
    frames = FleetFrames(Pose2D(1.0, 0.0), 0.0, CELL)
    part = Part("r1", (0, 4), 0.0, 1.0)
    heard = MemberReceived("r2", x=2.0, y=1.0, ahead=((2.0, 2.0),), parts=(part,))
    placed = frames.event(heard, Pose2D(1.0, 5.0, math.pi / 2), 0.0)
    assert (placed.x, placed.y) == pytest.approx((-1.0, 7.0))
    assert placed.ahead[0] == pytest.approx((-2.0, 7.0))
    assert placed.parts[0].seed == (24, -1)
    # Where the lattices lie alike, turned in their maps, cells stay.
    placed = FleetFrames(Pose2D(1.0, 0.0, 0.5), 0.0, CELL).event(
        heard, Pose2D(1.0, 0.0), math.degrees(0.5)
    )
    assert placed.parts == heard.parts


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_division_with_seeds_out_of_range_is_dropped_and_named(sign):
    """A follower would repeat its seeds as they lie here, and be refused by all."""
    tile = CellTile(0, 0, bits_of({(3, 4)}))
    config = DaemonConfig(robot=RobotConfig(name="r1"), fleet=FleetConfig("hall", "house"))
    said = FleetMember(1, "hall", config.cell_m, "house", "covering", 1.0, 2.0, 1.0, 1, 7, 5, ())
    parts = FleetPart("r1", 0, 0, 0.0, 1.0), FleetPart("r2", 0, sign * 2**30, 0.0, 1.0)
    said = structs.replace(said, swept=(tile,), parts=parts, by="r2", origin=(sign * 9.0, 0.0, 0.0))
    receiver = FleetReceiver(config)

    def heard(said):
        return receiver.event(Sample("fasaco/@v1/r2/fleet", encode_json(said)))

    event = heard(said)
    assert (event.parts, event.division, event.by, event.misfit) == ((), 0, "", "")
    assert (event.x, event.y) == (1.0 + sign * 9.0, 2.0)
    assert cells_of(event.tiles)
    (fault,) = receiver.take_faults()
    assert str(fault) == "r2: its division has a seed outside this robot's limits"
    fits = structs.replace(said, origin=(-sign * 9.0, 0.0, 0.0))
    assert heard(fits).division == 7
    assert receiver.take_faults() == []


def test_a_seed_off_the_map_counts_as_on_the_nearest_cell():
    free = np.ones((5, 9), np.bool_)
    free[2, :3] = False
    lattice = CoverageLattice.from_free(free)
    told, here = (
        Division((Part("r1", seed, 0.0, 1.0), Part("r2", (2, 8), 0.0, 1.0))).owners(lattice)
        for seed in ((2, 0), (1, 0))
    )
    assert (told == here)[free].all()
    assert (told[:, 0] == 0).all()


class Robot(Drive):
    def __init__(self, name, cell, origin, rows):
        fleet = FleetConfig("hall", "house", origin.x, origin.y, math.degrees(origin.yaw))
        tool = {"tool_width_m": CELL, "radius_m": CELL / 2}
        config = DaemonConfig(robot=RobotConfig(name=name, overlap=0.0, **tool), fleet=fleet)
        self.name, self.origin, self.rows, self.heard = name, origin, rows, []
        self.said, self.receiver = [], FleetReceiver(config)
        self.sender = FleetSender(self, config)
        super().__init__(cell, kind=FleetKind(name))
        self.mission.covered.shared.begin_epoch(1)
        map_frame = seen_from(Pose2D(0.0, 0.0), origin)
        grid = building(*rows)
        self.tell(MapReceived(replace(grid, geometry=replace(grid.geometry, origin=map_frame))))

    def put(self, payload):
        self.said.append(payload)

    def there(self, x, y):
        return placed_point(self.origin, x, y)


def test_two_robots_whose_maps_lie_askew_share_a_hall():
    rows = ["." * 24] * 12
    robots = [
        Robot("r1", (0, 0), Pose2D(0.0, 0.0), rows),
        Robot("r2", (0, 0), Pose2D(6.0, 3.0, math.radians(200.0)), rows),
    ]
    at = {"r1": (0.5 * CELL, 0.5 * CELL), "r2": (23.5 * CELL, 11.5 * CELL)}
    swept = {name: [] for name in at}
    for second in range(400):
        for robot in robots:
            if robot.request is not None:
                robot.plan()
            back = seen_from(Pose2D(0.0, 0.0), robot.origin)
            if robot.walk:
                row, col = robot.walk.pop(0)
                at[robot.name] = robot.there((col + 0.5) * CELL, (row + 0.5) * CELL)
            swept[robot.name].append(at[robot.name])
            x, y = placed_point(back, *at[robot.name])
            robot.tell(PoseReceived(StampedPose(Pose2D(x, y), "map")), after=1.0)
            robot.sender.publish(robot.mission, second * PERIOD_S * 1.01)
        for speaker, listener in (robots, robots[::-1]):
            for payload in speaker.said:
                sample = Sample(f"fasaco/@v1/{speaker.name}/fleet", payload)
                listener.tell(listener.receiver.event(sample), after=0.0)
            speaker.said.clear()
        if all(robot.mission.state == "done" for robot in robots):
            break
    assert all(robot.mission.state == "done" for robot in robots), second
    assert not any(
        m.left_out for robot in robots for m in robot.mission.company.others.known.values()
    )
    points = np.array([point for track in swept.values() for point in track])
    for row in range(1, 11):
        for col in range(1, 23):
            away = np.hypot(*(points - ((col + 0.5) * CELL, (row + 0.5) * CELL)).T).min()
            assert away < CELL, (row, col, away)
    # Each did about a half: together hardly more than one alone.
    assert sum(len(set(track)) for track in swept.values()) < 1.5 * 288
