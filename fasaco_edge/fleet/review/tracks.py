"""Cells that robots of a fleet swept, from the recording of the fleet or of one robot."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

import msgspec
import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bus.arrival import Arrival
from fasaco_edge.errors import FasacoError
from fasaco_edge.fleet.mission.frames import seen_from
from fasaco_edge.fleet.observer.cells import (
    Cells,
    Place,
    Seat,
    cells_of,
    mask_of,
    together,
    window_of,
)
from fasaco_edge.fleet.observer.observed import ObservedRobot
from fasaco_edge.fleet.recording.notes import Note, NoteBatch, NotedRobot
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.judge.pixels import within
from fasaco_edge.recording.read.robot_clock import RobotClock
from fasaco_edge.samples import SampleDecoder
from fasaco_edge.wire.documents.fleet import decode_member
from fasaco_edge.wire.documents.settings import FleetSettings
from fasaco_edge.wire.documents.turns import decode_turns
from fasaco_edge.wire.topics import FLEET

# Time by which a simulated robot's clock is extended beyond its stamps [s], longer than recordings.
AROUND_S = 1e6
# Distance that includes the eight neighbours of a cell [cells].
BESIDE = 1.5


@dataclass(slots=True, eq=False)
class RobotTrack:
    """Notes of a robot, and its cells on the lattice of the first robot.

    Attributes:
        name: name of the robot.
        number: its number in the order of joining, which decides its colour.
        notes: in order of time.
        swept_ms: the cells that it swept, with the time of their first report [ms].
        entered: the cells that it entered, in order, int64 (n, 3): time [ms], row, col.
        again: the cells of ``swept_ms`` that another robot had swept before, each with the share of
            the robot's steps there that counts as sweeping again.
        clock: conversion of the recorder's time to the robot's seconds since the recording began.
    """

    name: str
    number: int = 0
    notes: list[Note] = field(default_factory=list)
    swept_ms: dict[Place, int] = field(default_factory=dict)
    entered: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 3), np.int64))
    again: dict[Place, float] = field(default_factory=dict)
    clock: RobotClock = field(default_factory=lambda: RobotClock(0))


def seat_of(robot: NotedRobot) -> Seat:
    return Seat(*msgspec.structs.astuple(robot)[2:])


def tracks_of(batches: Sequence[NoteBatch], seat: Seat) -> tuple[list[RobotTrack], Cells]:
    """Return the robots by name, and the cells that any of them could reach."""
    tracks: dict[str, RobotTrack] = {}
    entered: dict[str, list[NDArray[np.int64]]] = {}
    ground: list[Cells] = []
    for batch in batches:
        for note in batch.notes:
            robot = batch.robots[note.robot]
            own = seat_of(robot)
            track = tracks.setdefault(robot.name, RobotTrack(robot.name, note.robot))
            for cell in own.carried(cells_of(note.swept), seat).tolist():
                track.swept_ms.setdefault((cell[0], cell[1]), note.at_ms)
            ground.append(np.unique(own.carried(cells_of(note.ground), seat), axis=0))
            if note.is_repeated:
                continue
            track.notes.append(note)
            if note.entered:
                passed = np.array([(p.at_ms, p.row, p.col) for p in note.entered], np.int64)
                passed[:, 1:] = own.carried(passed[:, 1:], seat)
                entered.setdefault(robot.name, []).append(passed)
    for name, pieces in entered.items():
        tracks[name].entered = np.concatenate(pieces)
    for track in tracks.values():
        track.clock = _clock(track.notes)
    return sorted(tracks.values(), key=lambda track: track.name), together(ground)


def _clock(notes: Sequence[Note]) -> RobotClock:
    """Return the clock of a robot, by the stamps of its poses if it is simulated.

    Before the first stamp and after the last stamp, the clock runs at the configured time scale.
    """
    stamped = [note for note in notes if note.stamp_ms]
    scale = stamped[-1].time_scale if stamped else 1.0
    if scale == 1.0 or not 0.0 < scale < math.inf:
        return RobotClock(0)
    times_s = 1e-3 * np.array([(note.at_ms, note.stamp_ms) for note in stamped])
    around_s = [times_s[end] + (sign * AROUND_S, sign * scale * AROUND_S)
                for end, sign in ((0, -1.0), (-1, 1.0))]  # fmt: skip
    return RobotClock.by_stamps(0, scale, *np.vstack([around_s[0], times_s, around_s[1]]).T)


def seconds_of(clock: RobotClock, at_ms: Sequence[int]) -> NDArray[np.float64]:
    return clock.all_seconds(1_000_000 * np.array(at_ms, np.int64))


def swept_by_others(
    turns: Iterable[Arrival], fleet: FleetSettings, geometry: GridGeometry
) -> NDArray[np.bool_] | None:
    """Return the pixels that others swept, bool (rows, cols); None without messages of others.

    A swept cell counts as a whole, and so do unreachable cells beside it: the floor along walls.

    Args:
        turns: the samples of the turn log, which contain the messages of the others.
        fleet: settings of the recorded robot.
        geometry: placement of the pixels in the recorded robot's map frame.
    """
    members = _members(turns, fleet.name)
    if not members:
        return None
    own = Pose2D(fleet.x_m, fleet.y_m, math.radians(fleet.yaw_deg))
    cols = np.arange(0.5, geometry.cols, dtype=np.float64)
    found = np.zeros((geometry.rows, geometry.cols), np.bool_)
    for member in members:
        swept, ground, seat = member.swept.cells(), member.ground.cells(), member.seat
        window = window_of(together([swept, ground]))
        if window is None:
            continue
        window = Window(window.row0 - 1, window.col0 - 1, window.row1 + 1, window.col1 + 1)
        cells = mask_of(swept, window)
        cells |= within(cells, BESIDE) & ~mask_of(ground, window)
        here = seen_from(seat.frame, own)
        placed = Seat(seat.cell_m, seat.lattice_deg, here.x, here.y, math.degrees(here.yaw))
        lattice = placed.geometry(window)
        for row in range(geometry.rows):
            x, y = geometry.to_map(cols, np.full_like(cols, row + 0.5))
            found[row] |= lattice.values_at(cells, np.column_stack((x, y)))
    return found


def _members(turns: Iterable[Arrival], fleet: str) -> list[ObservedRobot]:
    members: dict[str, ObservedRobot] = {}
    decoder = SampleDecoder()
    for arrival in turns:
        with suppress(FasacoError):
            inputs = decode_turns(arrival.sample.payload).told
            for numbered in decoder.samples(inputs) if inputs else ():
                sample = numbered.arrival.sample
                if numbered.arrival.topic != FLEET.name:
                    continue
                message = decode_member(sample.payload, fleet)
                if message is not None:
                    new = ObservedRobot(sample.key, len(members), Seat.of(message), message, 0)
                    members.setdefault(sample.key, new).receive(message, 0)
    return list(members.values())
