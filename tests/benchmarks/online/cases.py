"""Missions in which something happens: doors, a late room, a loop closure, a passer-by."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.grid.occupancy import FREE, OCCUPIED
from fasaco_edge.planners.grids import MAP_FOOTPRINT, NamedGrid
from tests.benchmarks.online.buildings import CASE, Building, of_grid
from tests.benchmarks.online.mission import OnlineMission
from tests.benchmarks.online.sight import Point

# Three rooms, linked, on a hall; a letter is a cell. Letters but S, the start, are doors.
FLOOR = (
    "##################################",
    "#..........#..........#..........#",
    "#..........#..........#..........#",
    "#..........L....#.....#..........#",
    "#..........L....#.....M..........#",
    "#...##.....#..........M..........#",
    "#...##.....#..........#.....#....#",
    "#..........#..........#.....#....#",
    "#..........#..........#..........#",
    "####AAA########BBB##########CCC###",
    "#................................#",
    "#.S..............................#",
    "#.......##.......................#",
    "#.......##.............#.........#",
    "#......................#.........#",
    "#................................#",
    "##################################",
)
HALL_DOORS = "ABC"
# As fine as a mapper's: where the map turns, cells and pixels do not fall together.
PIXELS = 6

# Share of the cells after which the room opens and the loop closes.
LATE = 0.5
CLOSES_BEFORE_M = 0.5
JUMP = Pose2D(0.32, 0.24, math.radians(3.0))

# A passer-by is a disc that walks up and down the hall for a while.
PERSON_M, PERSON_M_S, COMES_S, LEAVES_S = 0.25, 0.8, 20.0, 400.0
# How far off the robot's middle that disc's middle stays [m].
DISTANCE_M = 0.6
# The walk begins here and leads east so far [pixels].
WALK_FROM, WALK_PX = (3.5 * PIXELS, 5.5 * PIXELS), 27.0 * PIXELS

# Called before each leg; tells whether it has happened.
Act = Callable[[OnlineMission], bool]


@dataclass(frozen=True, slots=True)
class Case:
    """Something that happens.

    Attributes:
        name: what it is called.
        acts: returns what makes it happen, anew for each mission.
        closed: doors that are closed in the beginning.
    """

    name: str
    acts: Callable[[], Act]
    closed: str = ""

    def building(self) -> Building:
        """Return where it happens."""
        letters = np.array([list(row) for row in FLOOR[::-1]])
        row, col = np.argwhere(letters == "S")[0].tolist()
        free = ~np.isin(letters, ["#", *self.closed])
        grid = NamedGrid(self.name, CoverageLattice.from_free(free), (row, col))
        return replace(of_grid(grid, MAP_FOOTPRINT.cell_m, PIXELS), kind=CASE)


def _door(name: str) -> list[Cell]:
    rows = FLOOR[::-1]
    return [(r, c) for r, row in enumerate(rows) for c, letter in enumerate(row) if letter == name]


def _set_door(mission: OnlineMission, name: str, value: int) -> None:
    for row, col in _door(name):
        cell = np.s_[row * PIXELS : (row + 1) * PIXELS, col * PIXELS : (col + 1) * PIXELS]
        mission.sight.truth[cell] = value


def _distance_m(mission: OnlineMission, door: str) -> float:
    row, col = np.mean(_door(door), axis=0).tolist()
    middle = ((col + 0.5) * PIXELS, (row + 0.5) * PIXELS)
    return math.dist(mission.robot.at, middle) * mission.sight.geometry.resolution


def _share(mission: OnlineMission) -> float:
    """Return the share of the cells that the robot was in."""
    visited = {(int(y) // PIXELS, int(x) // PIXELS) for x, y in mission.robot.trail}
    return len(visited) / int(np.count_nonzero(mission.building.reachable))


def _close_ahead(mission: OnlineMission) -> bool:
    """Close a door that the robot is about to go through."""
    soon = {(row, col) for row, col in mission.robot.ahead[1:5].tolist()}
    for name in HALL_DOORS:
        if soon.intersection(_door(name)) and _distance_m(mission, name) > CLOSES_BEFORE_M:
            _set_door(mission, name, OCCUPIED)
            return True
    return False


def _close_behind(mission: OnlineMission) -> bool:
    """Close the door that the robot has come through, once it is two cells beyond."""
    if mission.robot.at[1] < (_door("A")[0][0] + 2.5) * PIXELS:
        return False
    _set_door(mission, min(HALL_DOORS, key=lambda name: _distance_m(mission, name)), OCCUPIED)
    return True


def _open_late(mission: OnlineMission) -> bool:
    """Open a room when much of the hall is covered: the nearest, so that the robot sees it."""
    if _share(mission) < LATE:
        return False
    _set_door(mission, min(HALL_DOORS, key=lambda name: _distance_m(mission, name)), FREE)
    return True


def _close_loop(mission: OnlineMission) -> bool:
    """Let the mapper find out that all lies elsewhere, and say so before the robot drives on."""
    if _share(mission) < LATE:
        return False
    mission.sight.place_anew(JUMP)
    mission.sense()
    return True


def _once(act: Act) -> Callable[[], Act]:
    """Return what makes something happen once, anew for each mission."""

    def acts() -> Act:
        happened = False

        def act_once(mission: OnlineMission) -> bool:
            nonlocal happened
            happened = happened or act(mission)
            return happened

        return act_once

    return acts


class _PasserBy:
    """Somebody who walks up and down the hall, and waits where the robot is in the way."""

    def __init__(self) -> None:
        self._walked_px, self._since_s = 0.0, COMES_S
        self._is_there = False
        self._empty: NDArray[np.int8] | None = None

    def __call__(self, mission: OnlineMission) -> bool:
        """Take the steps that the time since the last call allows."""
        truth, now = mission.sight.truth, mission.now
        pixel_m = mission.sight.geometry.resolution
        if self._empty is None:
            self._empty = truth.copy()
        truth[:] = self._empty
        if COMES_S <= now < LEAVES_S:
            ahead_px = self._walked_px + (now - self._since_s) * PERSON_M_S / pixel_m
            if math.dist(_on_walk(ahead_px), mission.robot.at) * pixel_m >= DISTANCE_M:
                self._walked_px, self._is_there = ahead_px, True
            self._since_s = now
        if self._is_there and now < LEAVES_S:
            x, y = _on_walk(self._walked_px)
            rows, cols = np.indices(truth.shape)
            truth[np.hypot(rows + 0.5 - y, cols + 0.5 - x) * pixel_m < PERSON_M] = OCCUPIED
        return self._is_there


def _on_walk(walked_px: float) -> Point:
    """Return where somebody is after so long a way up and down the hall."""
    (x, y), length = WALK_FROM, WALK_PX
    return x + length - abs(walked_px % (2 * length) - length), y


CASES = {
    case.name: case
    for case in (
        Case("door-closes-ahead", _once(_close_ahead)),
        Case("door-closes-behind", _once(_close_behind)),
        Case("room-appears-late", _once(_open_late), closed="ABCLM"),
        Case("loop-closure", _once(_close_loop)),
        Case("person", _PasserBy),
    )
}
