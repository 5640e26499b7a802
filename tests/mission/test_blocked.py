"""A robot whose follower meets what the map does not show: it sweeps elsewhere, and comes back."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.occupancy import MapPatch
from fasaco_edge.mission.config import MissionPolicy
from fasaco_edge.mission.events import CommandReceived, FollowerBlocked, PatchReceived
from fasaco_edge.mission.map.obstacles import CLOSED_S, WIDEN_AFTER_S, Obstacles
from fasaco_edge.mission.orders.order import read_order
from tests.mission.line_robot import CONFIG, RADIUS_M, LineRobot, map_of
from tests.support.rooms import FREE, WALL, fill, room

# Distance that the follower keeps from things [m].
MARGIN_M = 0.06
# Standstill after which it reports an obstacle [s].
HELD_S = 5.0
START = (0.6, 0.6)
TRIES_AGAIN = replace(CONFIG, policy=MissionPolicy(lost_pose_s=0.0))


ROOM = room(4.0, 3.0)
# Two rooms with a door of 0.8 m between them.
TWO_ROOMS = fill(fill(room(6.0, 3.0), 3.0, 0.0, 3.1, 3.0, WALL), 3.0, 1.1, 3.1, 1.9, FREE)


class SeeingRobot(LineRobot):
    """It does not come near to hidden points, and says so as a follower does.

    Attributes:
        hidden: points that no map shows [m].
        stood: how long it has stood before them in all [s].
    """

    def __init__(self, pixels, start, hidden):
        self.hidden = hidden
        self.held_s = self.stood = 0.0
        self.longest_s = 0.0
        super().__init__(pixels, start, TRIES_AGAIN)

    def _drive(self, metres):
        before = self.x, self.y, list(self.path)
        super()._drive(metres)
        near = [p for p in self.hidden if math.dist(p, (self.x, self.y)) < RADIUS_M + MARGIN_M]
        if any(math.dist(p, before[:2]) > math.dist(p, (self.x, self.y)) for p in near):
            self.x, self.y, self.path = before
            self.held_s += self.tick_s
        elif (self.x, self.y) != before[:2]:
            self.longest_s = max(self.longest_s, self.held_s)
            self.held_s = 0.0

    def step(self, *events):
        seconds = round(self.held_s / self.tick_s)
        if self.held_s >= HELD_S and seconds % 10 == 0 and self.path:
            here = self.x, self.y
            points = sorted((math.dist(p, here), p) for p in self.hidden)
            near = tuple(p for far, p in points if far < RADIUS_M + MARGIN_M + 0.5)
            said = FollowerBlocked(
                self.mission.route.revision, "obstacle ahead", self.held_s, "map", *here, near
            )
            events = (*events, said)
        super().step(*events)


def disc(x, y, radius=0.2):
    return [
        (x + radius * math.cos(a), y + radius * math.sin(a))
        for a in np.linspace(0.0, math.tau, 40, endpoint=False)
    ]


def closed_door():
    return [(3.05, y) for y in np.arange(1.1, 1.9, 0.02)]


def codes(robot):
    return {trouble.code for trouble in robot.mission.troubles}


def test_it_sweeps_the_place_of_a_person_later():
    robot = SeeingRobot(ROOM, START, disc(2.0, 1.5))
    assert robot.wait(400.0, lambda robot: robot.held_s >= HELD_S)
    assert robot.wait(3.0, lambda robot: "blocked" in codes(robot))
    assert robot.mission.state == "degraded"
    assert "obstacle ahead" in robot.mission.reason
    assert robot.wait(15.0, lambda robot: robot.held_s == 0.0)
    robot.hidden = []
    assert robot.wait(900.0, lambda robot: robot.mission.state == "done")
    covered = robot.mission.coverage()
    assert covered.covered == covered.coverable
    assert "blocked" not in codes(robot)


def test_a_lasting_obstacle_is_left_out_and_reported():
    robot = SeeingRobot(TWO_ROOMS, START, closed_door())
    assert robot.wait(1500.0, lambda robot: robot.mission.state == "done")
    assert "not reached" in robot.mission.reason
    assert "%" in robot.mission.reason
    # Half of the floor lies behind the door.
    assert robot.mission.coverage().fraction == pytest.approx(0.5, abs=0.05)
    # No longer in one place than it takes to be sure, and to plan.
    assert robot.longest_s < 20.0


def test_a_door_that_opens_is_driven_through():
    robot = SeeingRobot(TWO_ROOMS, START, closed_door())
    assert robot.wait(400.0, lambda robot: robot.held_s >= HELD_S)
    robot.wait(30.0, lambda robot: False)
    robot.hidden = []
    assert robot.wait(1500.0, lambda robot: robot.mission.state == "done")
    covered = robot.mission.coverage()
    assert covered.covered == covered.coverable
    assert "not reached" not in robot.mission.reason


def test_a_path_that_cannot_be_joined_is_rebuilt_from_the_robot():
    robot = LineRobot(ROOM, START)
    assert robot.wait(60.0, lambda robot: robot.x > 1.0 or robot.y > 1.0)
    robot.is_stuck = True
    robot.wait(3.0, lambda robot: False)
    before = len(robot.paths)
    for _ in range(20):
        robot.wait(1.0, lambda robot: False)
        revision = robot.mission.route.revision
        robot.step(FollowerBlocked(revision, "path elsewhere", 3.0, "map", robot.x, robot.y))
    anew = [path for path in robot.paths[before:] if "cannot follow it" in path[2]]
    assert 3 <= len(anew) <= 6
    for _, xy, reason in anew:
        assert "path elsewhere" in reason
        assert math.dist(xy[0], (robot.x, robot.y)) < 0.01


def test_a_report_of_another_path_or_frame_closes_nothing():
    robot = LineRobot(ROOM, START)
    ahead = ((1.0, 1.0),)
    maps = robot.mission.map.map_revision
    robot.step(FollowerBlocked(999, "obstacle ahead", 5.0, "map", robot.x, robot.y, ahead))
    revision = robot.mission.route.revision
    robot.step(FollowerBlocked(revision, "obstacle ahead", 5.0, "odom", robot.x, robot.y, ahead))
    assert robot.mission.map.map_revision == maps
    assert not robot.mission.troubles


def test_floor_closes_longer_each_time_never_under_the_robot():
    obstacles = Obstacles(RADIUS_M)
    grid = map_of(np.zeros((60, 80), np.int8))
    here, point = (1.0, 1.0), (1.0 + RADIUS_M + 0.03, 1.0)
    now, closed = 10.0, []
    for _ in range(3):
        assert obstacles.close([point], here, now)
        assert not obstacles.close([point], here, now + WIDEN_AFTER_S / 2)
        drawn = obstacles.on(grid)
        rows, cols = np.nonzero(drawn.cells)
        assert len(rows) > 10
        # By the nearest corner of each pixel.
        near = np.maximum(np.abs((cols + 0.5) * 0.05 - 1.0) - 0.025, 0.0)
        aside = np.maximum(np.abs((rows + 0.5) * 0.05 - 1.0) - 0.025, 0.0)
        assert np.hypot(near, aside).min() >= RADIUS_M
        begun = now
        while not obstacles.open_due(now):
            now += 1.0
        closed.append(now - begun)
        assert obstacles.on(grid) is grid
    assert closed == [CLOSED_S, 2 * CLOSED_S, 4 * CLOSED_S]


def test_a_map_that_is_too_large_to_be_kept_twice_stays_as_it_is(monkeypatch):
    obstacles, grid = Obstacles(RADIUS_M), map_of(np.zeros((60, 80), np.int8))
    assert obstacles.close([(1.5, 1.0)], (1.0, 1.0), 0.0)
    assert obstacles.on(grid) is not grid
    monkeypatch.setattr("fasaco_edge.mission.map.obstacles.MOST_PIXELS", 4799)
    assert obstacles.on(grid) is grid


def test_updates_come_on_the_map_without_obstacles():
    """What was drawn on it is gone once the floor is open again."""
    robot = LineRobot(ROOM, START)
    revision, here = robot.mission.route.revision, (robot.x, robot.y)
    robot.step(FollowerBlocked(revision, "obstacle", 5.0, "map", *here, ((2.0, 2.0),)))
    closed = robot.mission.coverage().coverable
    patch = MapPatch(Window(50, 70, 52, 72), np.full((2, 2), 100, np.int8))
    robot.step(PatchReceived(patch))
    assert np.count_nonzero(robot.mission.grid.cells != ROOM) == 4
    robot.wait(CLOSED_S, lambda robot: False)
    assert np.count_nonzero(robot.mission.grid.cells != ROOM) == 4
    assert robot.mission.lattice.coverable.sum() > closed - 4
    rows, cols = np.nonzero(robot.mission.map.grid.cells != ROOM)
    assert (set(rows), set(cols)) == ({50, 51}, {70, 71})


# What a follower meets says nothing of the building.


def all_round(robot):
    """A follower that says it meets something wherever it looks."""
    angles = np.linspace(0.0, 6.2, 20).tolist()
    points = tuple((robot.x + 0.4 * math.cos(a), robot.y + 0.4 * math.sin(a)) for a in angles)
    return FollowerBlocked(0, "obstacle", 5.0, "map", robot.x, robot.y, points)


def test_a_robot_that_is_crowded_keeps_its_ledger():
    robot = LineRobot(TWO_ROOMS, (1.0, 1.0))
    robot.wait(45.0, lambda _: False)
    covered = robot.mission.covered.current.total
    for _ in range(1000):
        robot.step(*([all_round(robot)] if robot.path and round(10 * robot.now) % 10 == 0 else []))
        assert robot.mission.covered.current.total >= covered, robot.mission.reason
        assert "another building" not in robot.mission.reason
    assert robot.wait(900.0, lambda robot: robot.mission.state == "done")
    assert robot.mission.coverage().remaining == 0


def test_an_order_that_begins_in_a_crowd_is_not_done_in_it():
    robot = LineRobot(TWO_ROOMS, (1.0, 1.0))
    robot.wait(30.0, lambda _: False)
    robot.step(all_round(robot))
    for tick in range(700):
        robot.step(*([all_round(robot)] if robot.path and tick % 10 == 0 else []))
    order = read_order({"return_home": True})
    robot.step(CommandReceived(1, "start", order, discard=True))
    for tick in range(600):
        robot.step(*([all_round(robot)] if robot.path and tick % 10 == 0 else []))
        assert robot.mission.state != "done"
    assert robot.wait(900.0, lambda robot: robot.mission.state == "done")
    assert robot.mission.coverage().remaining == 0
