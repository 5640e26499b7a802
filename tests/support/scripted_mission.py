"""Scripted mission: the messages that a daemon and a robot would publish.

The building is asymmetric, to reveal mirrored pictures. It is 8 m x 6 m, with corner (0, 0) at
(-1, -2) m, an inner wall from the bottom, and a box at the lower right. The part that the robot has
seen grows from the left.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bus.session import Bus
from fasaco_edge.config.config import DaemonConfig, PlannerConfig
from fasaco_edge.config.robot import RobotConfig
from fasaco_edge.daemon.loop.answers import config_document
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose, Window
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.planners.planner import ColonySnapshot
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.documents.rooms import RoomReport, Rooms
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.maps import encode_occupancy_grid
from fasaco_edge.wire.messages.paths import encode_path
from fasaco_edge.wire.messages.pheromone import encode_pheromone
from fasaco_edge.wire.messages.poses import encode_pose_stamped
from tests.support.senders import Sender

RESOLUTION_M = 0.05
CELL_M = 0.25
RADIUS_M = 0.17
CONFIG = DaemonConfig(
    robot=RobotConfig(tool_width_m=CELL_M, radius_m=RADIUS_M), planner=PlannerConfig(line="cells")
)
ORIGIN = (-1.0, -2.0)
ROWS, COLS = 120, 160
# Swept share of each cell that the robot passes [percent].
SWEPT_PERCENT = 90
# Outlines of two rooms [m].
HALL = (-1.0, -2.0), (3.0, -2.0), (3.0, 4.0), (-1.0, 4.0)
NOOK = (3.0, -2.0), (7.0, -2.0), (7.0, 4.0), (3.0, 4.0)
# Rows and columns of the pixels of a box that appears half-way, where the map was free.
SURPRISE = (slice(80, 92), slice(40, 52))


@dataclass
class Mission:
    """Publishes a mission on ``bus``: ``frames()`` yields after each tenth of a second of it."""

    bus: Bus
    keys: Keys = field(default_factory=Keys)

    def __post_init__(self) -> None:
        bus = self.bus
        self._map = Sender(bus, topics.MAP)
        self._pose = Sender(bus, topics.POSE)
        self._path = Sender(bus, topics.PATH)
        self._floor = Sender(bus, topics.FLOOR)
        self._pheromone = Sender(bus, topics.PHEROMONE)
        self._status = Sender(bus, topics.STATUS)
        self._rooms = Sender(bus, topics.ROOMS)
        self.walk = _walk()
        self.rest = self.walk
        self.seen_cells = 0
        self.revision = 0
        self.best_steps = 0
        self.visits = np.zeros((ROWS // 5, COLS // 5), np.int64)

    @property
    def sent(self) -> int:
        """Number of samples sent."""
        return sum(sender.sent for sender in vars(self).values() if isinstance(sender, Sender))

    def frames(self, count: int) -> Iterator[float]:
        """Publish ``count`` steps of the mission; yield its progress, from 0 to 1."""
        for frame in range(count):
            done = frame / max(count - 1, 1)
            if frame % max(count // 16, 1) == 0:
                self.publish_map(done)
                self.replan(done, "first map" if frame == 0 else "the map grew")
            self.drive(done)
            if frame % 4 == 0:
                self.publish_floor()
                self.publish_rooms(done)
            yield done

    def publish_rooms(self, done: float) -> None:
        """Publish rooms: one gets a name half-way; the swept share of the other grows."""
        hall = RoomReport(1, "hall" if done > 0.5 else "", HALL, 12.0, (2,), swept=1.0)
        self._rooms.put(
            encode_json(
                Rooms("map", 1 + (done > 0.5), (hall, RoomReport(2, outline=NOOK, swept=done)))
            )
        )

    def publish_map(self, done: float) -> None:
        """Publish the known part of the building, which grows to the right."""
        self.seen_cells = known_columns(done) // 5
        truth = building(done)[:, : known_columns(done)]
        self._map.put(encode_occupancy_grid(occupancy(truth)))

    def replan(self, done: float, reason: str) -> None:
        """Publish the living trail, and a walk."""
        self.revision += 1
        self.publish_status("planning", done, planning=True)
        self.publish_trail(done)
        self.rest = self.walk[round(done * (len(self.walk) - 1)) :]
        seen = cells(self.rest)[1] < self.seen_cells - 1
        rest = self.rest = self.rest[: np.argmin(seen) if not seen.all() else None]
        note = {
            "revision": self.revision,
            "map_stamp_ns": 0,
            "reason": reason,
            "planner": "fasaco",
            "seed": 7,
            "steps": len(rest) - 1,
            "plan_ms": 40.0 + 10.0 * math.sin(self.revision),
            "ants": 60,
            "planned_steps": len(rest) - 1,
            "lower_bound_steps": len(rest) - 4,
            "planned_cost_s": 1.2 * len(rest),
            "lower_bound_cost_s": 1.2 * (len(rest) - 4),
            "gap": 4 / (len(rest) - 4),
            "changed": self.changed(done) if reason == "the map grew" else None,
        }
        yaw = np.zeros(len(rest))
        self._path.put(encode_path(rest, yaw, "map", _stamp()), json.dumps(note).encode())
        self.publish_status("covering", done, planning=False)

    def changed(self, done: float) -> dict[str, float]:
        """Return the bounds of the part by which the map has just grown."""
        x, y = ORIGIN[0] + RESOLUTION_M * known_columns(done), ORIGIN[1]
        return {"x_min": x - 0.75, "y_min": y + 0.5, "x_max": x - 0.25, "y_max": y + 5.0}

    def publish_trail(self, done: float) -> None:
        """Publish the living trail; it becomes more decided with time."""
        self.best_steps = round(len(self.walk) * 1.1 - 40 * done)
        note = {"revision": self.revision, "cells": 12, "branching": 2.0 - done}
        self._pheromone.put(self._field(done), json.dumps(note).encode())

    def _window(self, shown: NDArray[np.generic]) -> Window:
        col, row = (round(at / CELL_M) for at in ORIGIN)
        return Window(0, 0, *shown.shape).moved(row, col)

    def _field(self, done: float) -> bytes:
        trail = np.full(self.visits.shape, 0.1, np.float32)
        rows, cols = cells(self.walk)
        along = np.arange(len(rows)) / len(rows)
        np.add.at(trail, (rows, cols), 20.0 * (0.2 + along).astype(np.float32))
        trail[blocked_cells(done)] = 0.0
        trail = trail[:, : self.seen_cells]
        snapshot = ColonySnapshot(self._window(trail), CELL_M, trail, 0, 0, 0, self.best_steps)
        return encode_pheromone(snapshot, "map", _stamp())

    def drive(self, done: float) -> None:
        """Publish the robot's pose, and count the visit of its cell."""
        place = done * (len(self.walk) - 1)
        index = min(int(place), len(self.walk) - 2)
        step = self.walk[index + 1] - self.walk[index]
        x, y = self.walk[index] + (place - index) * step
        passed = cells(self.walk[: index + 1])
        self.visits[:] = 0
        np.add.at(self.visits, passed, 1)
        pose = Pose2D(float(x), float(y), math.atan2(step[1], step[0]))
        self._pose.put(encode_pose_stamped(StampedPose(pose, "map", _stamp())))

    def publish_floor(self) -> None:
        """Publish the floor that the robot swept."""
        swept = np.where(self.visits > 0, SWEPT_PERCENT, 0).astype(np.int8)
        geometry = GridGeometry(*swept.shape, CELL_M, Pose2D(*ORIGIN))
        self._floor.put(encode_occupancy_grid(OccupancyGrid(geometry, swept, "map", _stamp())))

    def publish_status(self, state: str, done: float, planning: bool, **more: Any) -> None:
        """Publish a status as the daemon would."""
        status = {
            "robot": self.keys.robot,
            "version": "1.0.0",
            "state": state,
            "reason": "",
            "uptime_s": 40.0 * self.revision,
            "cpu_s": 8.0 * self.revision,
            "threads": 9,
            "coverage": {"coverable": 500, "covered": round(500 * done), "recovered": 3},
            "floor": {"swept_m2": round(70.0 * done, 3)},
            "plan": {"plans": self.revision, "unchanged": 2, "outdated": 1, "planning": planning},
            "latency_ms": {"ingest": 4.0 + done, "plan": 45.0, "map_to_path": 60.0 + 20 * done},
            "errors": {"total": 0, "last": "", "by_code": {}},
            "rss_mb": 120.0,
            "config": config_document(CONFIG),
        }
        self._status.put(encode_json(status | more))


def known_columns(done: float) -> int:
    """Return the number of columns of pixels that the robot has seen."""
    return min(COLS, 5 * round(10 + done * 32))


def building(done: float = 0.0) -> np.ndarray:
    """Return the building, int8 (ROWS, COLS)."""
    grid = np.zeros((ROWS, COLS), np.int8)
    grid[:2] = grid[-2:] = grid[:, :2] = grid[:, -2:] = 100
    grid[:80, 58:62] = 100
    grid[:25, 120:140] = 100
    grid[90:, 135:] = -1
    if done >= 0.5:
        grid[SURPRISE] = 100
    return grid


def occupancy(pixels: np.ndarray) -> OccupancyGrid:
    """Return pixels of the building, from its corner on, as a map."""
    rows, cols = pixels.shape
    geometry = GridGeometry(rows, cols, RESOLUTION_M, Pose2D(*ORIGIN))
    return OccupancyGrid(geometry, pixels.copy(), "map", _stamp())


def blocked_cells(done: float = 0.0) -> np.ndarray:
    """Return which lattice cells contain an obstacle or unknown pixels, bool."""
    pixels = building(done) != 0
    return pixels.reshape(ROWS // 5, 5, COLS // 5, 5).any(axis=(1, 3))


def cells(xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of the lattice cells that contain points [m]."""
    row_col = np.floor((xy[:, ::-1] - np.array(ORIGIN[::-1])) / CELL_M).astype(np.int64)
    return row_col[:, 0], row_col[:, 1]


def _walk() -> np.ndarray:
    """Return points [m], float64 (n, 2): up and down the columns of cells, left to right."""
    places: list[tuple[int, int]] = []
    for col in range(1, 31):
        low, high = (17 if col in (11, 12) else 6 if 24 <= col <= 28 else 1), 22
        high = 17 if col >= 27 else high
        rows = range(low, high + 1)
        near_top = bool(places) and abs(rows[-1] - places[-1][0]) < abs(rows[0] - places[-1][0])
        column = [(row, col) for row in (reversed(rows) if near_top else rows)]
        if places:
            towards = 1 if column[0][0] > places[-1][0] else -1
            back = range(places[-1][0] + towards, column[0][0] + towards, towards)
            places += [(row, places[-1][1]) for row in back if column[0][0] != places[-1][0]]
        places += column
    corner = np.array(ORIGIN)
    return np.array([corner + CELL_M * (np.array([col, row]) + 0.5) for row, col in places])


def _stamp() -> int:
    return time.time_ns()
