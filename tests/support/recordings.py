"""Recorder processes; recordings read without a viewer, also incomplete files."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.errors import UnreadableRecording
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.torn import scan_recording
from fasaco_edge.recording.scene.blueprint import build_blueprint
from fasaco_edge.recording.write.quota import DiskBudget
from fasaco_edge.recording.write.writer import RecordingWriter
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.keys import Keys
from tests.support.senders import Sender

RUN = """
import json, pathlib, sys
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.recording.write.quota import DiskBudget
from fasaco_edge.recording.write.recorder import run_recorder
told = json.loads(sys.argv[1])
bus = BusSettings(connect=(told.pop("endpoint"),))
out = pathlib.Path(told.pop("out"))
budget = DiskBudget(out, **{"part_bytes": 64_000_000, "least_free_bytes": 50_000_000} | told)
sys.exit(run_recorder(DaemonConfig(), bus, budget))
"""
TIMEOUT_S = 120.0


@dataclass
class Recorder:
    """A recorder process, and its reports."""

    process: subprocess.Popen[str]
    reports: list[dict[str, Any]] = field(default_factory=list)

    def hear(self, sample: Sample) -> None:
        """Take in a report, on a Zenoh thread."""
        self.reports.append(json.loads(sample.payload))

    def wait_until(self, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """Return the first report from now on for which ``holds``."""
        deadline = time.monotonic() + TIMEOUT_S
        seen = max(len(self.reports) - 1, 0)
        while time.monotonic() < deadline:
            for report in self.reports[seen:]:
                if holds(report):
                    return report
            assert self.process.poll() is None, self.process.stderr and self.process.stderr.read()
            time.sleep(0.02)
        raise AssertionError(f"not reported; last report: {self.reports[-1:]}")

    def written(self, messages: int) -> dict[str, Any]:
        """Wait until the recorder has taken this number of messages; return the report."""
        return self.wait_until(lambda report: report["messages"] >= messages)


@contextmanager
def bus_on_free_port() -> Iterator[tuple[Bus, str]]:
    """Open a bus as the daemon does; yield it with its endpoint."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    with open_bus(BusSettings(mode="router", connect=(), listen=(endpoint,))) as bus:
        yield bus, endpoint


@contextmanager
def recorder_process(bus: Bus, endpoint: str, out: Path, **settings: Any) -> Iterator[Recorder]:
    """Run a recorder until the end of the block, or until the test ends it."""
    told = json.dumps({"endpoint": endpoint, "out": str(out)} | settings)
    process = subprocess.Popen([sys.executable, "-c", RUN, told], stderr=subprocess.PIPE, text=True)
    recorder = Recorder(process)
    try:
        bus.listen(Keys(), topics.RECORDER, recorder.hear)
        recorder.wait_until(lambda report: report["pid"] == process.pid)
        yield recorder
    finally:
        process.kill()
        process.communicate()


def writer_in(folder: Path, part_bytes: int = 10**9, least_free_bytes: int = 0) -> RecordingWriter:
    """Begin a recording of a run ``run`` in ``folder``; without limits unless given."""
    budget = DiskBudget(folder, part_bytes, least_free_bytes)
    return RecordingWriter("run", budget, build_blueprint(None))


@dataclass
class ToldRecorder:
    """A recorder process, and publishers of what it records."""

    recorder: Recorder
    senders: dict[str, Sender]
    pause_s: float

    @property
    def sent(self) -> int:
        """Number of samples sent."""
        return sum(sender.sent for sender in self.senders.values())

    def tell(self, topic: str, payload: bytes, note: dict[str, Any] | None = None) -> None:
        """Publish a sample; each comes at a time of its own, and in this order."""
        self.senders[topic].put(payload, encode_json(note) if note else b"")
        time.sleep(self.pause_s)

    def end(self) -> None:
        """Wait until all samples are recorded, and end the recorder."""
        self.recorder.written(self.sent)
        self.recorder.process.terminate()
        self.recorder.process.wait(TIMEOUT_S)


@contextmanager
def told_recorder(folder: Path, pause_s: float = 0.03, **settings: Any) -> Iterator[ToldRecorder]:
    """Run a recorder on a bus of its own; it writes into ``folder``, which is made."""
    folder.mkdir()
    told = topics.MAP, topics.POSE, topics.PATH, topics.STATUS, topics.COMMAND
    with bus_on_free_port() as (bus, endpoint):
        senders = {topic.name: Sender(bus, topic) for topic in told}
        with recorder_process(bus, endpoint, folder, **settings) as recorder:
            yield ToldRecorder(recorder, senders, pause_s)


SCALAR = "Scalars:scalars"
STATE = "StateChange:state"
TEXT = "TextLog:text"
# Prefix of entities that rerun adds to a recording.
RESERVED_PREFIX = "/__"


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """One component of one entity over time.

    Attributes:
        wall_ns: int64 (n,), ascending: times of logging [ns].
        values: logged values, n lists of instances.
    """

    wall_ns: NDArray[np.int64]
    values: list[list[Any]]


@dataclass(frozen=True, slots=True)
class RecordingSummary:
    """Content of a recording.

    Attributes:
        rows: number of times that each entity was logged with a time, by name.
        timelines: names of the timelines, sorted.
        began_ns, ended_ns: first and last time on the timeline ``wall`` [ns]; 0 if empty.
        complete: whether the recorder ended the file itself.
        covered: last covered fraction of the coverable cells; None if not logged.
        recovered: last revisited fraction of these cells; None if not logged.
        paths: log lines about new paths, in order.
        states: states of the mission, in order.
    """

    rows: dict[str, int]
    timelines: tuple[str, ...]
    began_ns: int
    ended_ns: int
    complete: bool
    covered: float | None
    recovered: float | None
    paths: tuple[str, ...]
    states: tuple[str, ...]

    @property
    def duration_s(self) -> float:
        """Time from the first to the last [s]."""
        return (self.ended_ns - self.began_ns) / 1e9


def begun_parts(folder: Path) -> list[Path]:
    """Return the parts in ``folder`` with a frame; other parts have no data on the disk yet."""
    begun = []
    for part in sorted(folder.glob("*.rrd")):
        with part.open("rb") as file:
            scan = scan_recording(file)
        if scan is None or scan.frames:
            begun.append(part)
    return begun


def read_column(path: Path, entity: str, component: str) -> Column:
    """Return the values of ``component`` of ``entity`` over time, for example "Scalars:scalars".

    Raises:
        UnreadableRecording: ``path`` is no recording, or is torn.
    """
    rows: list[tuple[int, list[Any]]] = []
    for chunk in _chunks(path, f"/{entity}"):
        batch = chunk.to_record_batch()
        if not chunk.is_static and component in batch.schema.names:
            rows += zip(_wall_ns(batch).tolist(), batch.column(component).to_pylist(), strict=True)
    # Chunks are not ordered by time.
    rows.sort(key=lambda row: row[0])
    return Column(np.array([time for time, _ in rows], np.int64), [value for _, value in rows])


def read_static(path: Path, entity: str, component: str) -> list[Any]:
    """Return the values of ``component`` of ``entity`` that hold for all times, in order.

    Raises:
        UnreadableRecording: ``path`` is no recording, or is torn.
    """
    return [
        value
        for chunk in _chunks(path, f"/{entity}")
        if chunk.is_static and component in (batch := chunk.to_record_batch()).schema.names
        for value in batch.column(component).to_pylist()
    ]


def read_summary(path: Path) -> RecordingSummary:
    """Return the content of the recording ``path``.

    Raises:
        UnreadableRecording: ``path`` is no recording, or is torn.
    """
    rows: Counter[str] = Counter()
    timelines: set[str] = set()
    spans: list[NDArray[np.int64]] = []
    for chunk in _chunks(path, "/**"):
        if not chunk.is_static and not chunk.entity_path.startswith(RESERVED_PREFIX):
            rows[chunk.entity_path.removeprefix("/")] += chunk.num_rows
            timelines.update(chunk.timeline_names)
            wall_ns = _wall_ns(chunk.to_record_batch())
            spans.append(np.array([wall_ns.min(), wall_ns.max()]))
    with path.open("rb") as recording:
        scan = scan_recording(recording)
    return RecordingSummary(
        rows=dict(rows),
        timelines=tuple(sorted(timelines)),
        began_ns=int(np.min(spans)) if spans else 0,
        ended_ns=int(np.max(spans)) if spans else 0,
        complete=scan is not None and scan.has_footer,
        covered=_last_scalar(path, entities.COVERED_FRACTION),
        recovered=_last_scalar(path, "metrics/coverage/recovered"),
        paths=_texts(path, entities.PATH_LOG, TEXT),
        states=_texts(path, entities.MISSION_STATE, STATE),
    )


def _last_scalar(path: Path, entity: str) -> float | None:
    values = read_column(path, entity, SCALAR).values
    return float(values[-1][0]) if values else None


def _texts(path: Path, entity: str, component: str) -> tuple[str, ...]:
    return tuple(str(value[0]) for value in read_column(path, entity, component).values)


def _wall_ns(batch: Any) -> NDArray[np.int64]:
    wall: NDArray[np.int64] = batch.column(entities.WALL_CLOCK).to_numpy(False).astype(np.int64)
    return wall


def _chunks(path: Path, content: str) -> Iterator[Any]:
    try:
        with warnings.catch_warnings():
            # A file without its footer opens more slowly, but is complete.
            warnings.filterwarnings("ignore", message="RRD file has no footer")
            reader = RrdReader(str(path))
        yield from reader.stream().filter(content=content)
    except (OSError, RuntimeError, ValueError) as error:
        raise UnreadableRecording(f"{path}: {error}") from error
