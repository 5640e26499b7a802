"""When periodic messages are published: on change, again for late listeners, at once at an end."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from fasaco_edge.daemon.loop.mission_reports import floor_report, room_progress
from fasaco_edge.daemon.loop.periodic import (
    FLOOR_PERIOD_S,
    REPEAT_S,
    ROOMS_PERIOD_S,
    SWEPT_PERIOD_S,
    TRAIL_PERIOD_S,
    FloorPublisher,
    RoomsPublisher,
    TrailPublisher,
)
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.mission.coverage.swept_floor import SweptFloor
from fasaco_edge.mission.events import CommandReceived, State
from fasaco_edge.mission.orders.order import read_order
from fasaco_edge.wire.documents.json_text import decode_document
from fasaco_edge.wire.documents.rooms import Rooms
from fasaco_edge.wire.messages.maps import decode_occupancy_grid
from tests.mission.line_robot import LineRobot
from tests.mission.test_room_orders import BOTH, IN_EAST, room_at, settled, start


class Sent:
    def __init__(self, *, is_heard=True):
        self.messages, self.kept, self.is_heard = [], [], is_heard

    def has_listeners(self, topic):
        return self.is_heard

    def put(self, topic, payload, attachment=b""):
        self.messages.append((topic.name, payload))

    send = put

    def keep(self, name, reply):
        self.kept.append(reply)


def test_an_unchanged_floor_is_published_again_after_a_while():
    floor, sent = SweptFloor(0.3), Sent()
    floor.record(Pose2D(1.0, 1.0))
    mission = SimpleNamespace(
        covered=SimpleNamespace(floor=floor),
        grid=SimpleNamespace(frame="map", stamp_ns=1),
        rotation=SimpleNamespace(geometry=lambda geometry: geometry),
    )
    publisher = FloorPublisher(sent)
    # The mission is done: a recorder listens, and the floor no longer changes.
    counts = []
    for now in (0.0, FLOOR_PERIOD_S, REPEAT_S - 0.1, REPEAT_S, REPEAT_S + 0.1, 2 * REPEAT_S):
        publisher.publish(mission, now)
        counts.append(len(sent.messages))
    assert counts == [1, 1, 1, 2, 2, 3]
    floor.record(Pose2D(1.4, 1.0))
    publisher.publish(mission, 2 * REPEAT_S + FLOOR_PERIOD_S)
    assert len(sent.messages) == 4


def test_the_trail_is_sent_once_there_is_a_subscriber():
    drive, sent = settled(*BOTH), Sent(is_heard=False)
    start(drive, f"room {room_at(drive, *IN_EAST).id}")
    drive.plan()
    mission, publisher = drive.mission, TrailPublisher(sent)
    for now in (0.0, REPEAT_S, 2 * REPEAT_S):
        publisher.publish(mission, now)
    assert (len(sent.kept), sent.messages) == (1, [])
    sent.is_heard = True
    publisher.publish(mission, 2 * REPEAT_S + TRAIL_PERIOD_S)
    assert [name for name, _ in sent.messages] == ["pheromone", "directions"]
    assert sent.kept[-1]().payload == sent.messages[0][1]
    # The step from a cell that the path leaves once is where the trail points to, decidedly.
    grid = decode_occupancy_grid(sent.messages[1][1])
    ahead = [tuple(cell) for cell in mission.route.path.ahead.tolist()]
    origin, cell_m = grid.geometry.origin, mission.lattice.cell_m
    row0, col0 = round(origin.y / cell_m), round(origin.x / cell_m)
    assert len(ahead) > 9
    for (row, col), (then_row, then_col) in itertools.pairwise(ahead):
        if ahead.count((row, col)) == 1:
            direction = {(0, 1): 0, (1, 0): 1, (0, -1): 2, (-1, 0): 3}[
                then_row - row, then_col - col
            ]
            value = int(grid.cells[row - row0, col - col0])
            assert (value // 25, value % 25 > 6) == (direction, True)


def test_the_shares_of_rooms_are_of_floor_and_make_the_whole():
    """By cells they were more: floor along walls did not count."""
    robot = LineRobot(two_rooms(), (1.0, 1.0))
    robot.wait(90.0, lambda _: False)
    west, east = rooms_of(robot)
    floor = floor_report(robot.mission)
    m2 = west.swept * west.area_m2 + east.swept * east.area_m2
    assert m2 == pytest.approx(floor.reached_m2, rel=0.05)
    by_cells = room_progress(robot.mission)
    m2 = sum(by_cells[room.id].share * room.area_m2 for room in (west, east))
    assert m2 > 1.04 * floor.reached_m2


def test_an_order_leaves_the_share_of_other_rooms_as_it_was():
    """It was of the floor that the tool touches from the room of the order, or of cells: 100 %."""
    robot = LineRobot(two_rooms(), (1.0, 1.0))
    assert robot.wait(600.0, lambda robot: robot.mission.state is State.DONE)
    before = {room.id: room.swept for room in rooms_of(robot)}
    west, east = before
    assert 0.9 < before[west] < 0.99
    order = read_order({"zones": [{"name": f"room {east}"}]})
    robot.step(CommandReceived(1, "start", order, discard=True))
    robot.wait(5.0, lambda _: False)
    shares = {room.id: room.swept for room in rooms_of(robot)}
    assert shares[west] == pytest.approx(before[west], abs=0.01)
    assert shares[east] < 0.3


def two_rooms():
    """Return the pixels of two rooms side by side, with a door."""
    pixels = np.full((64, 124), 100, np.int8)
    pixels[2:-2, 2:-2] = 0
    pixels[:24, 60:64] = pixels[40:, 60:64] = 100
    return pixels


def rooms_of(robot):
    sent = Sent()
    RoomsPublisher(sent, robot.mission.rooms).publish(robot.mission, robot.now)
    return decode_document(sent.messages[-1][1], Rooms).rooms


def test_the_last_shares_of_an_order_do_not_wait():
    drive, sent = settled(*BOTH), Sent()
    publisher = RoomsPublisher(sent, drive.mission.rooms)
    publisher.publish(drive.mission, now=0.0)
    number = room_at(drive, *IN_EAST).id
    start(drive, f"room {number}")
    publisher.publish(drive.mission, now=ROOMS_PERIOD_S)
    assert len(sent.messages) == 2
    drive.plan()
    drive.go()
    # While it drives, shares are not worth a message a second.
    publisher.publish(drive.mission, now=2 * ROOMS_PERIOD_S)
    assert len(sent.messages) == 2
    publisher.publish(drive.mission, now=2 * SWEPT_PERIOD_S)
    assert len(sent.messages) == 3
    rooms = decode_document(sent.messages[-1][1], Rooms).rooms
    assert {room.id: room.to_go_s for room in rooms}[number] > 10.0
    drive.finish()
    publisher.publish(drive.mission, now=2 * SWEPT_PERIOD_S + ROOMS_PERIOD_S)
    rooms = decode_document(sent.messages[-1][1], Rooms).rooms
    assert {room.id: (room.swept, room.to_go_s) for room in rooms}[number] == (1.0, None)
    publisher.publish(drive.mission, now=3 * SWEPT_PERIOD_S)
    assert len(sent.messages) == 4
    # Nor those of the next order, which begins with nothing swept.
    start(drive, f"room {number}")
    publisher.publish(drive.mission, now=3 * SWEPT_PERIOD_S + 0.1)
    rooms = decode_document(sent.messages[-1][1], Rooms).rooms
    assert {room.id: room.swept for room in rooms}[number] < 0.2
