"""Short mission of a real daemon with a real recorder: a robot in an unknown room.

The mapper sends whole maps while they grow, and otherwise updates. For some time its map shows a
crate that does not exist. The robot is paused and resumed once.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.mailbox import LatestSlot
from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.errors import BusUnavailable
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.grid.rotation import rotated_geometry, rotated_pose
from fasaco_edge.planners.compiling import warm_up
from fasaco_edge.simulation.robot import SimulationConfig
from fasaco_edge.simulation.world import World
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.json_text import decode_json, encode_json
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.maps import encode_map_update, encode_occupancy_grid
from fasaco_edge.wire.messages.paths import decode_path
from fasaco_edge.wire.messages.poses import encode_pose_stamped
from tests.support.processes import daemon_process
from tests.support.rooms import RESOLUTION_M, WALL, fill, room
from tests.support.senders import Sender
from tests.support.waiting import until

SIZE_M = (3.6, 2.7)
START = Pose2D(0.75, 0.75)
# Place of the crate on the map [m], and period in which the map shows it [simulated s].
CRATE = (2.4, 1.2, 2.7, 1.5)
CRATE_S = (8.0, 25.0)
# Time of each command [simulated s], the command, and the code of its error, "" for none.
COMMANDS = (
    (14.0, {"command": "pause"}, ""),
    (16.0, {"command": "resume"}, ""),
    (19.0, {"command": "replan"}, ""),
)
# Least time from the first path to the first command [s]; recordings give the daemon's times of
# arrival only this exactly.
DRIVES_S = 0.5
# Simulated seconds per second.
SPEED = 16.0
TIMEOUT_S = 250.0
SIMULATION = SimulationConfig(
    robot_radius_m=0.18, range_m=1.2, map_chunk_m=1.5, map_hz=1.0, pose_hz=4.0
)


@dataclass(frozen=True)
class Recording:
    """The parts, the daemon's messages, and the robot's true track.

    ``statuses``, and ``notes`` (attachments of paths), are with their times of arrival [s].
    """

    paths: list[Path]
    status: dict
    statuses: list[tuple[float, dict]]
    notes: list[tuple[float, dict]]
    trail: np.ndarray


def is_done(status: dict) -> bool:
    """Return whether all is covered."""
    return status.get("state") == "done"


def record_mission(
    folder: Path,
    name: str = "runs",
    ends=is_done,
    *,
    broken_poses: int = 0,
    line: str = "cells",
    yaw_deg: float = 0.0,
    commands=COMMANDS,
    blocked_s: tuple[float, ...] = (),
    priorities: OccupancyGrid | None = None,
) -> Recording:
    """Record a mission from its first map until a status for which ``ends`` holds.

    ``broken_poses`` is the number of malformed poses sent; ``line`` the daemon's ``planner.line``;
    ``yaw_deg`` the angle of the room to the map frame. At ``blocked_s`` [simulated s] a follower
    reports an obstacle. ``priorities`` are published before the start.
    """
    runs = folder / name
    planner = {"budget_s": 0.05, "line": line}
    warm_up()  # so that the daemon need not compile while the robot waits
    with daemon_process(folder, "--record", str(runs), planner=planner) as daemon:
        with until(lambda: _joined(daemon.endpoint), TIMEOUT_S, why=daemon.log_text) as bus:
            robot = MappingRobot(bus, broken_poses, yaw_deg, commands, blocked_s)
            robot.wait(lambda status: (status["recorder"] or {}).get("state") == "recording")
            if priorities is not None:
                Sender(bus, topics.PRIORITY).put(encode_occupancy_grid(priorities))
            robot.drive(ends)
        # The recorder's last messages may take some time on a busy machine.
        daemon.process.terminate()
        daemon.process.wait(TIMEOUT_S)
    return Recording(
        sorted(runs.glob("*.rrd")), robot.status, robot.statuses, robot.notes, robot.trail
    )


def _joined(endpoint: str) -> Bus | None:
    try:
        return open_bus(BusSettings("client", (endpoint,)))
    except BusUnavailable:
        return None


class MappingRobot:
    """A robot on the bus, and the newest status of the daemon."""

    def __init__(
        self,
        bus: Bus,
        broken_poses: int = 0,
        yaw_deg: float = 0.0,
        commands=COMMANDS,
        blocked_s: tuple[float, ...] = (),
    ) -> None:
        self._bus, self._keys = bus, Keys()
        self._broken_poses, self._broken_sent = broken_poses, 0
        keys = self._keys
        self._commands, self._blocked_s = list(commands), list(blocked_s)
        pixels = fill(room(*SIZE_M), 1.5, 0.0, 1.6, 1.2, WALL)
        geometry = GridGeometry(*pixels.shape, RESOLUTION_M, Pose2D(0.0, 0.0))
        geometry, start = rotated_geometry(geometry, yaw_deg), rotated_pose(START, yaw_deg)
        self._world = World(OccupancyGrid(geometry, pixels), start, SIMULATION)
        self._maps = Sender(bus, topics.MAP)
        self._updates = Sender(bus, topics.MAP_UPDATE)
        self._poses = Sender(bus, topics.POSE)
        self._blocked = Sender(bus, topics.BLOCKED)
        self._newest_path = LatestSlot[Sample]()
        self.status: dict = {}
        self.statuses: list[tuple[float, dict]] = []
        self.notes: list[tuple[float, dict]] = []
        self._sent: OccupancyGrid | None = None
        self._told_at = math.nan, math.nan
        bus.listen(keys, topics.PATH, self._take_path)
        bus.listen(keys, topics.STATUS, self._hear)

    def wait(self, holds) -> None:
        """Wait for a status."""
        until(
            lambda: self.status and holds(self.status),
            TIMEOUT_S,
            why=lambda: f"not received; the last status was {self.status}",
        )

    def drive(self, ends=is_done) -> None:
        """Drive until a status for which ``ends`` holds."""
        deadline = time.monotonic() + TIMEOUT_S
        tick_s = SIMULATION.tick_s / SPEED
        due = time.monotonic()
        while not ends(self.status):
            assert time.monotonic() < deadline, f"not done; the last status was {self.status}"
            if (sample := self._newest_path.take(0.0)) is not None:
                self._world.follow(decode_path(sample.payload).xy)
            self._publish()
            self._report()
            if self._is_time():
                self._command(*self._commands.pop(0)[1:])
                due = time.monotonic()
            due += tick_s
            time.sleep(max(due - time.monotonic(), 0.0))
        # The recording must contain the last path, which stops the robot, and the cycle after it.
        self.wait(self._is_up_to_date)
        heard = len(self.statuses)
        until(lambda: len(self.statuses) > heard, TIMEOUT_S)

    def _is_up_to_date(self, status: dict) -> bool:
        """Return whether a status includes the last pose, and no search runs."""
        pose = status["pose"] or {}
        here = pytest.approx(self._told_at, abs=1e-3)
        return (pose.get("x"), pose.get("y")) == here and not status["plan"]["planning"]

    def _is_time(self) -> bool:
        """Return whether the next command is due; no command is due before the first path."""
        if not self._commands or 1e-9 * self._world.stamp_ns < self._commands[0][0]:
            return False
        if not self.notes or time.monotonic() - self.notes[0][0] < DRIVES_S:
            return False
        return self._commands[0][1]["command"] == "resume" or self.status.get("state") == "covering"

    def _report(self) -> None:
        """Report an obstacle 0.4 m ahead, if due."""
        if not self._blocked_s or 1e-9 * self._world.stamp_ns < self._blocked_s[0]:
            return
        del self._blocked_s[0]
        pose = self._world.pose
        ahead = pose.x + 0.4 * math.cos(pose.yaw), pose.y + 0.4 * math.sin(pose.yaw)
        place = {"frame": "map", "x": pose.x, "y": pose.y, "points": (ahead,)}
        why = {"reason": "obstacle", "detail": "obstacle ahead", "held_s": 5.0}
        self._blocked.put(encode_json({"daemon": "a1", "revision": 0, **why, **place}))

    def _publish(self) -> None:
        emission = self._world.tick()
        if emission.map is not None:
            self._publish_map(self._believed(emission.map))
        if emission.pose is not None:
            pose = encode_pose_stamped(emission.pose)
            self._told_at = emission.pose.pose.x, emission.pose.pose.y
            self._poses.put(pose)
            if self._broken_sent < self._broken_poses:
                self._broken_sent += 1
                self._poses.put(pose[:-5])
                # If the daemon were busy, the next pose would replace this one.
                self.wait(lambda status: status["errors"]["total"] >= self._broken_sent)

    def _command(self, document: dict, code: str) -> None:
        payload = encode_json(document)
        (reply,) = self._bus.get(self._keys.rpc("mission"), timeout_s=TIMEOUT_S, payload=payload)
        assert decode_json(reply.payload).get("code", "") == code, reply.payload

    def _believed(self, grid: OccupancyGrid) -> OccupancyGrid:
        if not CRATE_S[0] <= 1e-9 * self._world.stamp_ns < CRATE_S[1]:
            return grid
        (col0, row0), (col1, row1) = (
            (round(place) for place in grid.geometry.to_pixels(x, y))
            for x, y in (CRATE[:2], CRATE[2:])
        )
        cells = grid.cells.copy()
        cells[max(row0, 0) : max(row1, 0), max(col0, 0) : max(col1, 0)] = WALL
        return replace(grid, cells=cells)

    def _publish_map(self, grid: OccupancyGrid) -> None:
        before, self._sent = self._sent, grid
        if before is None or before.geometry != grid.geometry:
            self._maps.put(encode_occupancy_grid(grid))
            return
        changed = before.cells != grid.cells
        if not changed.any():
            return
        rows, cols = np.flatnonzero(changed.any(axis=1)), np.flatnonzero(changed.any(axis=0))
        window = Window(int(rows[0]), int(cols[0]), int(rows[-1]) + 1, int(cols[-1]) + 1)
        cells = grid.cells[window.row0 : window.row1, window.col0 : window.col1].copy()
        patch = MapPatch(window, cells, grid.frame, grid.stamp_ns)
        self._updates.put(encode_map_update(patch))

    @property
    def trail(self) -> np.ndarray:
        """The robot's true track: points (x, y) [m], float64 (n, 2)."""
        return self._world.track

    def _take_path(self, sample: Sample) -> None:
        note = decode_json(sample.attachment)
        # The empty path that a starting daemon publishes does not belong to the mission.
        if note["revision"]:
            self.notes.append((time.monotonic(), note))
            self._newest_path.put(sample)

    def _hear(self, sample: Sample) -> None:
        self.status = decode_json(sample.payload)
        self.statuses.append((time.monotonic(), self.status))
