"""An hour of a mission, recorded at speed: memory and disk it takes.

    python -m tests.campaigns.recorder_hour [--seconds 3600]

Takes minutes.

A hall of 75 m x 75 m, 250 x 250 cells of the lattice: a map of 1,500 x 1,500 pixels once a second
that comes to be known while the robot drives, poses at 20 Hz, a status once a second, and every
half minute a plan and its path: a quarter of an hour takes 23 s. Exit code 1 if a goal is missed.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose, Window
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.host.processes import resident_mb, return_soon
from fasaco_edge.planners.planner import ColonySnapshot
from fasaco_edge.recording.scene.blueprint import build_blueprint
from fasaco_edge.recording.scene.runcard import RunDescription
from fasaco_edge.recording.scene.scene import Scene
from fasaco_edge.recording.write.input_log import InputLog
from fasaco_edge.recording.write.quota import budget_of
from fasaco_edge.recording.write.writer import RecordingWriter
from fasaco_edge.wire.documents.json_text import decode_tolerant, encode_json
from fasaco_edge.wire.documents.path_documents import PathAttachment, TrailAttachment
from fasaco_edge.wire.documents.status import Recorder, Status
from fasaco_edge.wire.messages.maps import decode_occupancy_grid, encode_occupancy_grid
from fasaco_edge.wire.messages.paths import decode_path, encode_path
from fasaco_edge.wire.messages.pheromone import decode_pheromone, encode_pheromone
from fasaco_edge.wire.messages.poses import decode_pose, encode_pose_stamped
from fasaco_edge.wire.schemas import POSE_STAMPED

SECOND_NS = 1_000_000_000
BEGAN_NS = 1_700_000_000 * SECOND_NS
SIDE, PIXELS_PER_CELL, CELL_M = 250, 6, 0.3
POSES_HZ, SPEED_M_S, PLAN_EVERY_S = 20, 0.25, 30
GOAL_RSS_MB, GOAL_MB_PER_HOUR = 150.0, 60.0


@dataclass(frozen=True, slots=True)
class Hour:
    """What a mission took.

    Attributes:
        seconds: how long it was [s].
        rss_mb: resident memory, once a minute of the mission [MB].
        bytes: of all parts [bytes].
        parts: files.
        messages: how many were recorded.
        took_s: how long recording it took [s].
    """

    seconds: int
    rss_mb: list[float]
    bytes: int
    parts: int
    messages: int
    took_s: float

    @property
    def mb_per_hour(self) -> float:
        """Growth [MB per hour]."""
        return self.bytes / 1e6 * 3600 / self.seconds


class Hall:
    """The samples of a mission, second by second."""

    def __init__(self, seed: int = 0) -> None:
        self._rng = np.random.default_rng(seed)
        side = SIDE * PIXELS_PER_CELL
        self._pixels = np.zeros((side, side), np.int8)
        self._pixels[:: side // 10] = self._pixels[:, :: side // 10] = 100
        self._pixels[:, 40 :: side // 10] = self._pixels[40 :: side // 10] = 0
        self._geometry = GridGeometry(side, side, CELL_M / PIXELS_PER_CELL, Pose2D(0.0, 0.0))
        cells = self._pixels.reshape(SIDE, PIXELS_PER_CELL, SIDE, PIXELS_PER_CELL)
        self._blocked = (cells != 0).any(axis=(1, 3))
        walk = np.array(
            [
                (row, col if row % 2 else SIDE - 1 - col)
                for row in range(SIDE)
                for col in range(SIDE)
            ]
        )
        self._walk = walk[~self._blocked[walk[:, 0], walk[:, 1]]]
        self._covered = np.where(self._blocked, 100, 0).astype(np.int8)
        self._plans = 0
        self._cpu_s = 0.0

    def second(self, second: int) -> Iterator[tuple[float, str, bytes, bytes]]:
        """Yield (seconds into it, topic, payload, attachment)."""
        place = second * SPEED_M_S / CELL_M
        yield 0.0, "map", self._map(second), b""
        if second % PLAN_EVERY_S == 0:
            yield from self._plan(int(place))
        for tick in range(POSES_HZ):
            yield tick / POSES_HZ, "pose", self._pose(place + tick / POSES_HZ * SPEED_M_S), b""
        row, col = self._walk[int(place)]
        self._covered[row, col] = 75 if self._covered[row, col] else 50
        yield 0.96, "status", self._status(second), b""

    def _map(self, second: int) -> bytes:
        pixels = self._pixels.copy()
        # Walls flicker, a box is moved now and then, and ever more becomes known.
        rows, cols = self._rng.integers(0, len(pixels), (2, 100))
        pixels[rows, cols] = 30
        box = 40 + second // PLAN_EVERY_S % 20
        pixels[box : box + 8, box : box + 8] = 100
        pixels[200 + second // 3 :] = -1
        return encode_occupancy_grid(OccupancyGrid(self._geometry, pixels))

    def _plan(self, place: int) -> Iterator[tuple[float, str, bytes, bytes]]:
        self._plans += 1
        trail = self._rng.gamma(1.0, 1.0, (SIDE, SIDE)).astype(np.float32)
        trail[self._blocked] = 0.0
        snapshot = ColonySnapshot(Window(0, 0, SIDE, SIDE), CELL_M, trail, 0, 0, 20, 60_000)
        about = encode_json({"revision": self._plans, "cells": SIDE**2, "branching": 2.0})
        yield 0.0, "pheromone", encode_pheromone(snapshot, "map", 0), about
        rest = CELL_M * (self._walk[place:, ::-1] + 0.5)
        changed = dict(
            zip(("x_min", "y_min", "x_max", "y_max"), (0, 0, 75, self._plans), strict=True)
        )
        note = encode_json(
            {"revision": self._plans, "reason": "map: 120 cells more", "plan_ms": 80.0}
            | {"planner": "fasaco", "planned_steps": len(rest), "gap": 0.02 + 1e-4 * self._plans}
            | {"lower_bound_steps": 60_000 - place, "planned_cost_s": 1.3 * len(rest)}
            | {"changed": changed}
        )
        yield 0.0, "path", encode_path(rest, np.zeros(len(rest)), "map", 0), note

    def _pose(self, place: float) -> bytes:
        index = int(place)
        step = self._walk[index + 1] - self._walk[index]
        row, col = self._walk[index] + (place - index) * step
        noise = self._rng.normal(0, 0.003, 3)
        pose = Pose2D(CELL_M * (col + 0.5) + noise[0], CELL_M * (row + 0.5) + noise[1], noise[2])
        return encode_pose_stamped(StampedPose(pose, "map", 0))

    def _status(self, second: int) -> bytes:
        ingest_ms, rss_mb = self._rng.normal([6.0, 150.0], 0.2).round(3).tolist()
        self._cpu_s += float(self._rng.uniform(0.1, 0.3))
        covered, recovered = (int(np.count_nonzero(self._covered == value)) for value in (50, 75))
        return encode_json(
            {
                "uptime_s": float(second),
                "cpu_s": self._cpu_s,
                "threads": 9,
                "coverage": {
                    "coverable": 50_000 + second,
                    "covered": covered + recovered,
                    "recovered": recovered,
                    "unreachable": 40,
                },
                "path": {"remaining_steps": 60_000 - covered},
                "plan": {"plans": self._plans, "unchanged": second // 100, "outdated": 0},
                "errors": {"total": 0, "last": "", "by_code": {"malformed_message": second // 60}},
                "state": "covering",
                "version": "1.0.0",
                "latency_ms": {
                    "ingest": ingest_ms,
                    "plan": 80.0 + self._plans,
                    "map_to_path": 90.0 + self._plans,
                },
                "rss_mb": rss_mb,
                "config": {"planner": "fasaco"},
            }
        )


class Desk:
    """What a recorder does with a sample, at any speed."""

    def __init__(self, folder: Path) -> None:
        room = budget_of(DaemonConfig())
        self.writer = RecordingWriter(folder, "run", room, build_blueprint(None))
        self.writer.at(BEGAN_NS)
        self._inputs = InputLog(self.writer, BEGAN_NS)
        self._scene = Scene(self.writer, RunDescription("robot", "now"))
        scene = self._scene
        self._readers = {
            "map": lambda sample: scene.add_map(decode_occupancy_grid(sample.payload)),
            "pose": lambda sample: scene.add_pose(decode_pose(sample.payload, POSE_STAMPED)),
            "path": lambda sample: scene.add_path(
                decode_path(sample.payload), decode_tolerant(sample.attachment, PathAttachment)
            ),
            "pheromone": lambda sample: scene.add_pheromone(
                decode_pheromone(sample.payload),
                decode_tolerant(sample.attachment, TrailAttachment),
            ),
            "status": lambda sample: scene.add_status(decode_tolerant(sample.payload, Status)),
        }

    def hear(self, topic: str, payload: bytes, attachment: bytes, at_ns: int) -> None:
        """Record a sample."""
        arrival = Arrival(
            topic, Sample(f"robot/{topic}", payload, "", attachment), at_ns, BEGAN_NS + at_ns
        )
        self.writer.message(arrival.wall_ns)
        self._inputs.add(arrival)
        self._readers[topic](arrival.sample)
        self._inputs.write_if_due(at_ns)
        self.writer.sync(at_ns)

    def report(self) -> None:
        """Say how the recorder is, and draw what waits, as is done once a second."""
        word = Recorder("recording", "", "", 0, 0, 0, 0, resident_mb(), 1)
        self._scene.add_report(word)
        self._scene.catch_up()

    def close(self) -> None:
        """End the recording."""
        self._inputs.finish()
        self._scene.finish()
        assert self.writer.close()


def record_mission(folder: Path, seconds: int) -> Hour:
    """Record ``seconds`` of a mission into ``folder``."""
    return_soon()
    desk = Desk(folder)
    rss_mb, messages = [], 0
    began = time.monotonic()
    for second, samples in enumerate(_told(seconds)):
        messages += len(samples)
        for into_s, topic, payload, attachment in samples:
            desk.hear(topic, payload, attachment, round((second + into_s) * SECOND_NS))
        desk.report()
        if second % 60 == 59:
            rss_mb.append(resident_mb())
    desk.close()
    took_s = time.monotonic() - began
    parts = list(folder.glob("*.rrd"))
    size = sum(part.stat().st_size for part in parts)
    return Hour(seconds, rss_mb, size, len(parts), messages, took_s)


def _told(seconds: int) -> Iterator[list[tuple[float, str, bytes, bytes]]]:
    """Yield the samples of each second, from a process of their own: its memory is not counted."""
    spawn = multiprocessing.get_context("spawn")
    here, there = spawn.Pipe(duplex=False)
    teller = spawn.Process(target=_tell, args=(there, seconds), daemon=True)
    teller.start()
    for _ in range(seconds):
        yield here.recv()
    teller.join()


def _tell(pipe: Connection, seconds: int) -> None:
    hall = Hall()
    for second in range(seconds):
        pipe.send(list(hall.second(second)))


def main() -> int:
    """Record, and report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=int, default=3600, help="of the mission")
    parser.add_argument("--out", type=Path, help="keep the recording there")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        out = args.out or Path(folder)
        hour = record_mission(out, args.seconds)
    print(
        f"{hour.seconds} s of a mission, {hour.messages} messages, in {hour.took_s:.0f} s, "
        f"{hour.parts} parts"
    )
    print("resident [MB] over time:", *hour.rss_mb[:: max(len(hour.rss_mb) // 10, 1)])
    print(f"most {max(hour.rss_mb, default=0.0)} MB (at most {GOAL_RSS_MB:g})")
    print(f"{hour.mb_per_hour:.1f} MB per mission hour (at most {GOAL_MB_PER_HOUR:g})")
    met = max(hour.rss_mb, default=0.0) <= GOAL_RSS_MB and hour.mb_per_hour <= GOAL_MB_PER_HOUR
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
