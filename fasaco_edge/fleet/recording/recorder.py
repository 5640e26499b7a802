"""Recorder of a whole fleet: a process that records all its robots into one file.

Each robot is recorded from its first message to the fleet, even if it joins late. The recorder
subscribes to the newest status, path and pose of each robot, and requests the robots' maps one at a
time, to limit the load on the network. A robot's messages cannot harm the record of another: each
robot has its own queues, its own decoders, and its own share of the drawings.
"""

from __future__ import annotations

import re
import time
from collections import Counter

from fasaco_edge.bus.arrival import Arrival
from fasaco_edge.bus.session import Bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.errors import FasacoError
from fasaco_edge.fleet.observer.observed import JOINED, ObservedFleet, ObservedRobot
from fasaco_edge.fleet.observer.queues import FleetInbox, FleetSubscriptions, RobotSample
from fasaco_edge.fleet.recording.layout import build_layout
from fasaco_edge.fleet.recording.notes import (
    NOTES_VERSION,
    Note,
    NoteBatch,
    PendingNote,
    encode_notes,
    note_of_all_cells,
    noted,
)
from fasaco_edge.fleet.recording.scene import FleetScene
from fasaco_edge.host.processes import memory_limit
from fasaco_edge.recording import entities
from fasaco_edge.recording.scene.blueprint import NO_MAP
from fasaco_edge.recording.write.process import BusRecorder, afforded_bytes, begin_recording, record
from fasaco_edge.recording.write.quota import DiskBudget
from fasaco_edge.text import is_reported, one_line
from fasaco_edge.wire.documents.fleet import decode_member, fleet_of
from fasaco_edge.wire.documents.json_text import decode_tolerant
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.messages.maps import decode_occupancy_grid
from fasaco_edge.wire.messages.paths import decode_path
from fasaco_edge.wire.messages.poses import PoseDecoder
from fasaco_edge.wire.topics import FLEET, MAP, PATH, POSE, STATUS

# Periods of notes and of writing them [ns].
NOTE_NS, WRITE_NS = 1_000_000_000, 5_000_000_000
# Robots that send within this time of the first robot [ns] are numbered in the order of their
# names; largest number of messages that wait until then.
GATHER_NS, MOST_GATHERED = 2_000_000_000, 1_000
# Number of unknown robots and topics whose faults are counted separately.
MOST_FAULTS = 256
TOO_LARGE = "messages too large for its share of the memory are left out, such as its map"
TOO_WIDE = "its cells are too many or too far apart: some are left out"


def run_fleet_recorder(
    config: DaemonConfig, bus_settings: BusSettings, fleet: str, budget: DiskBudget
) -> int:
    """Record a fleet until SIGTERM or SIGINT; return the process's exit code, see ``record``.

    Args:
        config: has the prefix of all keys, and the type of poses whose samples do not name one.
        bus_settings: how to join the bus.
        fleet: name of the fleet.
        budget: the folder to write to, and its limits.
    """
    return record(
        budget.folder, bus_settings, lambda bus: FleetRecorder(config, bus, fleet, budget)
    )


class FleetRecorder(BusRecorder):
    """Connection of the bus to the writer: ``step`` takes samples, writes and draws them."""

    def __init__(self, config: DaemonConfig, bus: Bus, fleet: str, budget: DiskBudget) -> None:
        self._fleet = fleet
        self._schema = config.pose.schema
        self.writer, self._clock = begin_recording(
            budget, file_name(fleet), build_layout((), NO_MAP)
        )
        self._began_ns = self._clock.began_ns
        self._title = f"fleet {fleet} {self._clock.began:%Y-%m-%d %H:%M:%S} UTC"
        self.writer.describe(self._title)
        self._members = ObservedFleet()
        self._scene = FleetScene(self.writer, self._members)
        self._inbox = FleetInbox(afforded_bytes(memory_limit()), self._clock.arrival)
        self._subscriptions = FleetSubscriptions(
            bus, config.keys(), (STATUS, PATH, POSE), self._inbox.post
        )
        self._first: list[RobotSample] = []
        self._gathers = True
        self._poses: dict[str, PoseDecoder] = {}
        self._pending: dict[str, PendingNote] = {}
        self._notes: list[Note] = []
        self._next_note_ns = self._next_write_ns = self._began_ns
        self._part = 0
        self._faults: Counter[tuple[str, str]] = Counter()

    def listen(self) -> None:
        """Subscribe to the fleet messages of all robots."""
        self._subscriptions.listen()

    def step(self, timeout_s: float) -> None:
        """Write and draw what arrives within ``timeout_s`` [s], and all drawings that are due."""
        for received in self._gathered(self._inbox.take(timeout_s)):
            self.writer.message(received.arrival.wall_ns)
            self._attempt(received)
            self.writer.sync(time.monotonic_ns())
        now_ns = self._clock.now_ns()
        self.writer.at(now_ns)
        if now_ns >= self._next_note_ns:
            self._next_note_ns = now_ns + NOTE_NS
            self._note(now_ns)
        if now_ns >= self._next_write_ns:
            self._next_write_ns = now_ns + WRITE_NS
            self._write()
        self._subscriptions.ask_for_maps([member.name for member in self._members], now_ns)
        self._scene.catch_up()
        self.writer.sync(time.monotonic_ns())

    def end(self) -> bool:
        self._gathers = False
        for received in self._gathered(self._inbox.take(0.0)):
            self._attempt(received)
        now_ns = self._clock.now_ns()
        self.writer.at(now_ns)
        self._note(now_ns)
        self._write()
        self._scene.finish()
        return self.writer.close()

    def _gathered(self, arrived: list[RobotSample]) -> list[RobotSample]:
        """Return the samples to process now.

        The samples of the first robots are processed together, sorted by the robots' names, so that
        robots have the same colours in all recordings and pictures.
        """
        if self._gathers:
            strange = {
                one.robot for one in arrived if fleet_of(one.arrival.sample.payload) != self._fleet
            }
            for robot in strange:
                self._inbox.forget(robot)
            arrived = [one for one in arrived if one.robot not in strange]
        self._first += arrived
        if self._gathers and self._first:
            since_ns = time.monotonic_ns() - self._first[0].arrival.at_ns
            self._gathers = since_ns < GATHER_NS and len(self._first) < MOST_GATHERED
        if self._gathers:
            return []
        first, self._first = self._first, []
        return sorted(first, key=lambda received: received.robot)

    def note(self, line: str) -> None:
        self._scene.add_line(line, "WARN")

    def _attempt(self, received: RobotSample) -> None:
        """Take in a sample; an unusable sample is logged with its robot's name."""
        try:
            self._take(received.robot, received.arrival)
        except FasacoError as error:
            what = received.robot, received.arrival.topic
            if self._members.get(received.robot) is None:
                # Invented names must not take all queues.
                self._inbox.forget(received.robot)
                if what not in self._faults and len(self._faults) >= MOST_FAULTS:
                    what = "other robots", received.arrival.topic
            self._faults[what] += 1
            count = self._faults[what]
            if is_reported(count):
                self._scene.add_line(
                    one_line(f"{': '.join(what)}: {count} refused: {error}"), "WARN"
                )

    def _warn_once(self, robot: str, fault: str) -> None:
        if (robot, fault) not in self._faults:
            self._scene.add_line(one_line(f"{robot}: {fault}"), "WARN")
        self._faults[robot, fault] += 1

    def _take(self, robot: str, arrival: Arrival) -> None:
        if arrival.topic == FLEET.name:
            self._take_fleet(robot, arrival)
            return
        member = self._members.get(robot)
        if member is None:
            return
        sample = arrival.sample
        if arrival.topic == POSE.name:
            stamped = self._poses[robot].decode(sample.payload, sample.schema)
            if stamped is not None:
                pose, seat = stamped.pose, member.seat
                cell = seat.cell_at(pose.x, pose.y)
                self._pending[robot].move(cell, stamped, self._ms(arrival.wall_ns))
                self._scene.add_pose(member, pose)
        elif arrival.topic == PATH.name:
            self._scene.add_path(member, decode_path(sample.payload).xy)
        elif arrival.topic == MAP.name:
            self._subscriptions.end_map_turn(robot)
            self._scene.add_map(member, decode_occupancy_grid(sample.payload))
        elif arrival.topic == STATUS.name:
            status = decode_tolerant(sample.payload, Status)
            # A second daemon with the robot's name does not plan.
            if status.claim.stand == "plans":
                self._pending[robot].note_status(status)

    def _take_fleet(self, robot: str, arrival: Arrival) -> None:
        said = decode_member(arrival.sample.payload, self._fleet)
        if said is None or not robot:
            if self._members.get(robot) is None:
                self._inbox.forget(robot)
            return
        before = self._members.get(robot)
        if before is None or before.is_moved_by(said):
            # A batch has one list of robots and frames for all its notes.
            self._write()
        member, news = self._members.receive(robot, said, arrival.wall_ns)
        if news == JOINED:
            self._join(member)
        elif news:
            self._scene.add_line(one_line(f"{robot}: {news}"), "WARN")
            self._pending[robot].forget_cell()

    def _join(self, member: ObservedRobot) -> None:
        self._poses[member.name] = PoseDecoder(self._schema)
        self._pending[member.name] = PendingNote()
        self._subscriptions.subscribe(member.name)
        self._scene.add_line(f"{member.name}: joined, cells of {member.seat.cell_m:g} m")
        self._scene.join(member)

    def _note(self, now_ns: int) -> None:
        for member in self._members:
            traffic = self._inbox.traffic(member.name)
            if traffic.too_large:
                self._warn_once(member.name, TOO_LARGE)
            if member.swept.refused or member.ground.refused:
                self._warn_once(member.name, TOO_WIDE)
            counts = traffic.messages, traffic.bytes
            note = self._pending[member.name].note(member, self._ms(now_ns), now_ns, counts)
            self._notes.append(note)
            figures = {"left_cells": float(note.open_cells)}
            if note.swept:
                figures["swept_m2"] = member.swept.count * member.seat.cell_m**2
                self._scene.add_cells(member)
            self._scene.add_figures(member, figures)
            self._scene.enter(member, member.state(now_ns), _why(member))
        if len(self._members):
            self._scene.add_division()
            self._scene.describe(self._title)

    def _write(self) -> None:
        """Write the notes gathered; in a new part also the cells of earlier parts."""
        if self._part != self.writer.part_number:
            self._part = self.writer.part_number
            at_ms = self._notes[0].at_ms if self._notes else self._ms(self.writer.wall_ns)
            self._notes = [
                *(note_of_all_cells(member, at_ms) for member in self._members),
                *self._notes,
            ]
        if not self._notes:
            return
        robots = [noted(member) for member in self._members]
        batch = NoteBatch(NOTES_VERSION, self._began_ns, self._fleet, robots, self._notes)
        self._notes = []
        if not self.writer.write_blob(encode_notes(batch), entities.FLEET_NOTES):
            # The next part repeats all cells.
            self._part = 0

    def _ms(self, wall_ns: int) -> int:
        return max(wall_ns - self._began_ns, 0) // 1_000_000


def _why(member: ObservedRobot) -> str:
    return f"for {member.newest.waits_for}" if member.newest.waits_for else ""


def file_name(fleet: str) -> str:
    """Return the name of a fleet's recordings: letters, digits, ``_`` and ``-``."""
    return "fleet-" + re.sub(r"[^A-Za-z0-9_-]", "_", fleet)
