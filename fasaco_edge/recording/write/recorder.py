"""The recorder of a robot, a process that records the samples on the bus.

It cannot delay the daemon. Zenoh's threads only add samples to a queue; one thread decodes, draws
and writes them.
"""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Callable
from functools import partial

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.bus.publisher import Publisher
from fasaco_edge.bus.session import Bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.errors import FasacoError, MalformedMessage
from fasaco_edge.host.processes import memory_limit, resident_mb
from fasaco_edge.mission.orders.commands import read_command
from fasaco_edge.recording import entities
from fasaco_edge.recording.scene.blueprint import build_blueprint
from fasaco_edge.recording.scene.runcard import RunDescription
from fasaco_edge.recording.scene.scene import Scene
from fasaco_edge.recording.write.input_log import InputLog
from fasaco_edge.recording.write.process import (
    QUEUE_BYTES,
    BusRecorder,
    SampleQueue,
    afforded_bytes,
    begin_recording,
    record,
)
from fasaco_edge.recording.write.quota import DiskBudget
from fasaco_edge.text import is_reported
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.json_text import decode_json, decode_tolerant, encode_json
from fasaco_edge.wire.documents.path_documents import PathAttachment
from fasaco_edge.wire.documents.rooms import Rooms
from fasaco_edge.wire.documents.status import Recorder, Status
from fasaco_edge.wire.messages.maps import decode_map_update, decode_occupancy_grid
from fasaco_edge.wire.messages.paths import decode_path
from fasaco_edge.wire.messages.pheromone import decode_pheromone
from fasaco_edge.wire.messages.poses import DEFAULT_FRAMES, PoseDecoder
from fasaco_edge.wire.reasons import SILENT

REPORT_PERIOD_NS = 1_000_000_000
# The daemon publishes a status once a second.
SILENCE_NS = 3_500_000_000
# Time for drawing waiting samples at the end [ns].
LAST_DRAWN_NS = 300_000_000


def run_recorder(config: DaemonConfig, bus_settings: BusSettings, budget: DiskBudget) -> int:
    """Record a robot until SIGTERM or SIGINT; return the exit code. Errors as for ``record``.

    Importing this module raises MissingExtra if Rerun is not installed.
    """
    return record(budget.folder, bus_settings, lambda bus: RobotRecorder(config, bus, budget))


class RobotRecorder(BusRecorder):
    """Connects the bus to the writer: ``step`` takes samples, writes them, and reports."""

    def __init__(self, config: DaemonConfig, bus: Bus, budget: DiskBudget) -> None:
        self._config = config
        self._bus = bus
        self.writer, self._clock = begin_recording(budget, config.robot.name, build_blueprint(None))
        self._inputs = InputLog(self.writer, self._clock.began_ns)
        began = f"{self._clock.began:%Y-%m-%d %H:%M:%S} UTC"
        self._scene = Scene(self.writer, RunDescription(config.robot.name, began))
        capacity = afforded_bytes(memory_limit())
        self._queue = SampleQueue(capacity, self._clock.arrival)
        if capacity < QUEUE_BYTES:
            size = f"{capacity / 1e6:.1f} MB"
            self.note(f"memory is limited: at most {size} of samples wait, others are lost")
        scene = self._scene
        self._drawers: dict[str, Callable[[Sample], None]] = {
            "map": lambda s: scene.add_map(decode_occupancy_grid(s.payload)),
            "floor": lambda s: scene.add_floor(decode_occupancy_grid(s.payload)),
            "map_update": lambda sample: scene.add_map_update(decode_map_update(sample.payload)),
            "pose": self._draw_pose,
            "tf_static": partial(self._draw_pose, is_static=True),
            "command": lambda s: scene.add_command(read_command(decode_json(s.payload))),
            "path": self._draw_path,
            "pheromone": lambda s: scene.add_pheromone(decode_pheromone(s.payload)),
            "rooms": lambda sample: scene.add_rooms(decode_tolerant(sample.payload, Rooms)),
            "status": lambda sample: scene.add_status(decode_tolerant(sample.payload, Status)),
        }
        frames = (ros.frames.map, ros.frames.robot) if (ros := config.ros2) else DEFAULT_FRAMES
        self._poses = PoseDecoder(config.pose.schema, frames)
        self._messages = 0
        self._malformed = 0
        self._last_status_ns: int | None = None
        self._report: Recorder | None = None
        self._next_report_ns = 0
        self._reporter: Publisher = bus.advertise(config.keys(), topics.RECORDER)

    def listen(self) -> None:
        """Subscribe to all recorded topics, and declare the recorder's token."""
        keys = self._config.keys()
        if ros := self._config.ros2:
            for name, source in ros.inputs.items():
                self._subscribe(
                    name, ros.input_key(source), source.latched, source.depth, source.schema
                )
        for topic in topics.RECORDED:
            self._subscribe(topic.name, keys.of(topic), topic.is_latched)
        self._bus.token(keys.of(topics.RECORDER_ALIVE))

    def step(self, timeout_s: float) -> None:
        """Write samples that arrive within ``timeout_s`` [s], check the writer, report."""
        arrivals = deque(self._queue.take(timeout_s))
        newest_ns = arrivals[-1].at_ns if arrivals else time.monotonic_ns()
        while arrivals:  # popleft frees the memory of written samples
            self._write(arrivals.popleft())
            self._sync()
            # Report during a long backlog, too.
            self._report_writing()
        self._inputs.note_lost(self._queue.lost)
        self.writer.at(self._clock.now_ns())
        self._sync()
        self._scene.catch_up()
        self._watch_daemon(newest_ns)
        self._report_writing()

    def end(self) -> bool:
        deadline_ns, undrawn = time.monotonic_ns() + LAST_DRAWN_NS, 0
        for arrival in self._queue.take(0.0):
            is_late = time.monotonic_ns() >= deadline_ns
            self._write(arrival, is_drawn=not is_late)
            undrawn += is_late
        self._inputs.note_lost(self._queue.lost)
        self.writer.at(self._clock.now_ns())
        self._inputs.finish()
        if undrawn:
            self.note(f"the last {undrawn} messages are not drawn: there was no time")
        self._report_state("stopping", "asked to end")
        self._scene.finish()
        return self.writer.close()

    def note(self, line: str) -> None:
        self._scene.add_line(entities.RECORDER_LOG, line, "WARN")

    def _subscribe(
        self, topic: str, key: str, latched: bool = False, depth: int = 1, schema: str = ""
    ) -> None:
        def post(sample: Sample) -> None:
            # ROS sends no type with a sample: it comes from the configuration.
            self._queue.post(topic, sample.as_type(schema) if schema else sample)

        in_order = topic in topics.IN_ORDER
        self._bus.subscribe(key, post, latched, depth, in_order=in_order)

    def _sync(self) -> None:
        now_ns = time.monotonic_ns()
        self._inputs.write_if_due(now_ns)
        self.writer.sync(now_ns)

    def _write(self, arrival: Arrival, *, is_drawn: bool = True) -> None:
        self._messages += 1
        self.writer.message(arrival.wall_ns)
        if arrival.topic == "status" and _is_rival(arrival.sample.payload):
            line = "a second daemon of this robot's name waits: it is not recorded"
            self._scene.add_line(entities.BUS_LOG, line, "WARN")
            return
        if arrival.topic == "status":
            self._last_status_ns = arrival.at_ns
        self._inputs.add(arrival)
        if not is_drawn:
            return
        try:
            # Some topics, such as the turn log, have no drawing.
            if (draw := self._drawers.get(arrival.topic)) is not None:
                draw(arrival.sample)
        except FasacoError as error:
            self._malformed += 1
            # A faulty publisher may send malformed samples at a high rate.
            if is_reported(self._malformed):
                line = f"{self._malformed} malformed, the last on {arrival.sample.key}: {error}"
                self._scene.add_line(entities.BUS_LOG, line, "WARN")

    def _draw_pose(self, sample: Sample, *, is_static: bool = False) -> None:
        pose = self._poses.decode(sample.payload, sample.schema, is_static=is_static)
        if pose is not None:
            self._scene.add_pose(pose)

    def _draw_path(self, sample: Sample) -> None:
        about = decode_tolerant(sample.attachment, PathAttachment)
        self._scene.add_path(decode_path(sample.payload), about)

    def _watch_daemon(self, newest_ns: int) -> None:
        """Report the daemon as silent if its last status is too old at ``newest_ns`` [ns]."""
        last = self._last_status_ns
        if last is not None and newest_ns - last > SILENCE_NS:
            self._scene.enter(entities.MISSION_STATE, "silent", SILENT)

    def _report_writing(self) -> None:
        self._report_state(self.writer.state.value, self.writer.reason)

    def _report_state(self, state: str, reason: str) -> None:
        """Report on the bus and in the recording, on change and once a second."""
        now_ns = time.monotonic_ns()
        last = self._report
        if last is not None and last.state == state and now_ns < self._next_report_ns:
            return
        self._next_report_ns = now_ns + REPORT_PERIOD_NS
        path = self.writer.path
        self._report = Recorder(
            state=state,
            reason=reason,
            file=str(path) if path else "",
            bytes=self.writer.size,
            messages=self._messages,
            lost=self.writer.lost + self._queue.lost.total(),
            malformed=self._malformed,
            rss_mb=resident_mb(),
            cpu_s=round(time.process_time(), 3),
            pid=os.getpid(),
        )
        self._scene.add_report(self._report)
        self._reporter.put(encode_json(self._report))


def _is_rival(payload: bytes) -> bool:
    """Return whether a status comes from a second daemon of the same robot, which does not plan."""
    try:
        return decode_tolerant(payload, Status).claim.stand != "plans"
    except MalformedMessage:
        return False  # the drawer reports it
