"""Content of the parts of a run: samples byte for byte, plots, states, log, places of drawings.

From a file that is torn or still being written, the complete frames are read; no file is changed.
Drawings are large: only their places in the files are kept, and each is read on request.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bus.arrival import Arrival
from fasaco_edge.errors import DifferentRuns, MalformedMessage, UnreadableRecording
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.frames import (
    Chunk,
    chunks,
    chunks_in,
    column,
    is_fleet_recording,
    pa,
    recording_id,
    wall_ns,
)
from fasaco_edge.recording.read.robot_clock import RobotClock
from fasaco_edge.recording.read.torn import DAMAGED_HINT, open_part
from fasaco_edge.samples import BatchPlace, SampleDecoder, place_of

# End of the name of a part without its suffix.
PART_NUMBER = re.compile(r"-part\d+$")
COMPONENT = f"{entities.INPUTS_ARCHETYPE}:{entities.INPUTS_COMPONENT}"


@dataclass(frozen=True, slots=True)
class SampleBatch:
    """A batch of samples, its position and its file."""

    place: BatchPlace
    body: bytes
    path: Path


class RecordedSamples:
    """The samples in the parts of one or more runs, in order of time.

    Args:
        paths: the files, in any order. If the first parts are missing, the samples begin with the
            map in force.
        batches: batches already read from the files, in any order; None to read them here.
        topics: topics to decode, in which case missing samples are not counted; None for all.

    Raises:
        UnreadableRecording: a file is not a recording, or none has samples.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        batches: Sequence[SampleBatch] | None = None,
        topics: Container[str] | None = None,
    ) -> None:
        if batches is None:
            batches = [
                batch
                for path in paths
                for chunk in chunks_in(path)
                if chunk.entity == entities.INPUTS
                for batch in _batches_of(chunk, path)
            ]
            # A single part may have no batches, if its recorder was killed just after the start.
            if not batches:
                raise _no_samples(paths)
        self._topics = topics
        # A run's number is the time of its beginning.
        self._batches = sorted(batches, key=lambda batch: (batch.place.run, batch.place.first))
        self.missing = 0

    def __iter__(self) -> Iterator[Arrival]:
        """Yield all samples in order; ``missing`` counts the samples lost between them.

        Raises:
            UnreadableRecording: a batch is malformed.
        """
        self.missing = 0
        run, following, begun, decoder = -1, 0, False, SampleDecoder(self._topics)
        for batch in self._batches:
            if batch.place.run != run:
                run, following, begun = batch.place.run, 0, False
                decoder = SampleDecoder(self._topics)
            try:
                samples = decoder.samples(batch.body)
            except MalformedMessage as error:
                raise UnreadableRecording(f"{batch.path}: {error}", hint=DAMAGED_HINT) from error
            for numbered in samples:
                # A part repeats the samples in force at its beginning.
                if numbered.number < following:
                    continue
                # Samples from before the first given part do not count as missing.
                if self._topics is None and begun:
                    self.missing += numbered.number - following
                begun = begun or numbered.number >= batch.place.first
                following = numbered.number + 1
                yield numbered.arrival


def _batches_of(chunk: Chunk, path: Path) -> list[SampleBatch]:
    """Return the batches of samples in a chunk of the entity ``inputs`` of the file ``path``.

    Raises:
        ValueError: the chunk holds something else.
        MalformedMessage: a batch is malformed.
    """
    found = column(chunk.batch, COMPONENT, pa.list_(pa.uint8()))
    bodies = [np.asarray(blob.values, np.uint8).tobytes() for blob in found or ()]
    return [SampleBatch(place_of(body), body, path) for body in bodies]


def _no_samples(paths: Sequence[Path]) -> UnreadableRecording:
    files = ", ".join(str(path) for path in paths)
    if any(map(is_fleet_recording, paths)):
        return UnreadableRecording(
            f"{files}: this is the recording of a fleet",
            hint="name the recording of one of its robots",
        )
    return UnreadableRecording(
        f"{files}: holds no samples",
        hint="no message came while it was recorded: check the robot's name, and the endpoint",
    )


SCALAR, STATE, TEXT = "Scalars:scalars", "StateChange:state", "TextLog:text"
PLOTTED = "metrics/"
READ = (PLOTTED, "state/", "log/")
DRAWN = (entities.MAP, entities.FLOOR, entities.PHEROMONE, entities.PATH)
STATUSES, POSES = ("status",), ("pose", "tf_static")
# Limit on the uncompressed data kept of a file: this many times its size, plus this many bytes.
MOST_RATIO, LEAST_BYTES = 16, 16_000_000
# Memory for the place of a drawing [bytes].
PLACE_BYTES = 200

# Types of a place in a drawing.
POINT = pa.list_(pa.field("item", pa.float32(), nullable=False), 3)
PLACE = pa.list_(POINT)


@dataclass(frozen=True, slots=True)
class DrawingPlace:
    """Place of a drawing: its time [ns], file, offset of the frame [bytes], row."""

    at_ns: int
    path: Path
    offset: int
    row: int


TimedText = tuple[int, str]
"""Time [ns] and text."""
Row = tuple[int, float | str]


class PartFile(msgspec.Struct, frozen=True):
    """A file of a recording: its size, torn bytes, and whether it was closed properly."""

    path: str
    bytes: int
    torn_bytes: int
    ended: bool


@dataclass(frozen=True, slots=True, eq=False)
class RunRecord:
    """Content of the parts of one run.

    Attributes:
        parts: the files, by name.
        began_ns, ended_ns: first and last time on the timeline ``wall`` [ns].
        clock: converts times on that timeline to the robot's.
        plots: points of each plotted entity, float64 (n, 2): the robot's time since the beginning
            [s], and value.
        texts: times and texts of each entity of states, or log.
        drawn: places of the drawings of each entity of DRAWN, in order of time. Each part repeats
            the drawings in force at its beginning.
        anchor: origin of drawings (x, y) [m], float64 (2,).
        batches: the samples, for ``RecordedSamples``.
    """

    parts: tuple[PartFile, ...]
    began_ns: int
    ended_ns: int
    clock: RobotClock
    plots: Mapping[str, NDArray[np.float64]]
    texts: Mapping[str, Sequence[TimedText]]
    drawn: Mapping[str, Sequence[DrawingPlace]]
    anchor: NDArray[np.float64]
    batches: Sequence[SampleBatch]

    @property
    def name(self) -> str:
        """Name of the recording: that of its first file, without the number of the part."""
        return PART_NUMBER.sub("", Path(self.parts[0].path).stem)


Progress = Callable[[int, int], None]
"""Called with the amount done and the whole amount."""


def read_run_record(paths: Sequence[Path], progress: Progress = lambda *_: None) -> RunRecord:
    """Read the parts of one run, in any order.

    Args:
        paths: the files; a torn file is read up to its last complete frame, and not changed.
        progress: called with each chunk, with amounts in bytes.

    Raises:
        UnreadableRecording: a file is missing or no recording, or there are no samples.
        DifferentRuns: the parts are not of one run.
    """
    reader, done = _RunReader(), 0
    total = sum(path.stat().st_size for path in paths if path.is_file())
    for path in sorted(set(paths)):
        for offset in reader.read(path):
            progress(done + offset, total)
        done += reader.parts[-1].bytes
    return reader.record()


def read_clock(paths: Sequence[Path]) -> RobotClock:
    """Return the clock of the first run in ``paths``; errors as for ``read_run_record``."""
    ids = {path: recording_id(path) for path in paths}
    first = min(filter(None, ids.values()), default="")
    return read_run_record([path for path in paths if ids[path] == first]).clock


@dataclass(slots=True)
class _RunReader:
    ids: dict[str, Path] = field(default_factory=dict)
    parts: list[PartFile] = field(default_factory=list)
    span: list[int] = field(default_factory=list)
    rows: dict[str, list[Row]] = field(default_factory=lambda: defaultdict(list))
    batches: list[SampleBatch] = field(default_factory=list)
    drawn: dict[str, list[DrawingPlace]] = field(default_factory=lambda: defaultdict(list))
    anchor: NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))

    def read(self, path: Path) -> Iterator[int]:
        """Read a file; yield the offset of each chunk."""
        with open_part(path) as (recording, scan):
            torn = 0 if scan.has_footer else scan.torn_bytes
            self.parts.append(PartFile(str(path), scan.total_bytes, torn, scan.has_footer))
            left_bytes = MOST_RATIO * scan.total_bytes + LEAST_BYTES
            for chunk in chunks(recording, scan):
                yield chunk.offset
                self.ids.setdefault(chunk.recording_id, path)
                left_bytes -= self._take(chunk, path)
                if left_bytes < 0:
                    raise ValueError(f"unpacks to more than {MOST_RATIO} times its size")

    def _take(self, chunk: Chunk, path: Path) -> int:
        """Take a chunk; return the number of bytes kept."""
        entity, batch = chunk.entity, chunk.batch
        if entity == entities.INPUTS:
            self.batches += _batches_of(chunk, path)
        elif chunk.is_static or not batch.num_rows:
            if entity == entities.WORLD:
                place = column(batch, "Transform3D:translation", PLACE)
                self.anchor = self.anchor if place is None else np.array(place[0].as_py()[0][:2])
            return 0
        elif entity in DRAWN:
            times = wall_ns(batch)
            self.drawn[entity] += [
                DrawingPlace(at, path, chunk.offset, row) for row, at in enumerate(times)
            ]
            return PLACE_BYTES * len(times)
        elif entity.startswith(READ):
            times = wall_ns(batch)
            self.span += [min(times), max(times)]
            self.rows[entity] += [
                (at, value[0])
                for at, value in zip(times, _values(batch), strict=False)
                if value and value[0] is not None
            ]
        else:
            return 0
        return chunk.bytes

    def record(self) -> RunRecord:
        if len(self.ids) > 1:
            raise DifferentRuns(
                "these are parts of different runs: "
                + ", ".join(f"{path} of {name}" for name, path in sorted(self.ids.items()))
            )
        if not self.batches:
            raise _no_samples([Path(part.path) for part in self.parts])
        began_ns = min(self.span, default=0)
        for places in self.drawn.values():
            places.sort(key=lambda place: place.at_ns)
        statuses, poses = (
            RecordedSamples((), self.batches, topics) for topics in (STATUSES, POSES)
        )
        clock = RobotClock.of(statuses, poses, began_ns)
        plots: dict[str, NDArray[np.float64]] = {}
        texts: dict[str, list[TimedText]] = {}
        for entity, rows in self.rows.items():
            rows.sort(key=lambda row: row[0])
            if entity.startswith(PLOTTED):
                at_ns = np.array([at for at, _ in rows], np.int64)
                values = np.array([value for _, value in rows], np.float64)
                plots[entity] = np.column_stack((clock.all_seconds(at_ns), values))
            else:
                texts[entity] = [(at, str(value)) for at, value in rows]
        return RunRecord(
            parts=tuple(self.parts),
            began_ns=began_ns,
            ended_ns=max(self.span, default=0),
            clock=clock,
            plots=plots,
            texts=texts,
            drawn=self.drawn,
            anchor=self.anchor,
            batches=self.batches,
        )


def _values(batch: pa.RecordBatch) -> list[list[float | str] | None]:
    for component, kind in ((SCALAR, pa.float64()), (STATE, pa.string()), (TEXT, pa.string())):
        found = column(batch, component, pa.list_(kind))
        if found is not None:
            values: list[list[float | str] | None] = found.to_pylist()
            return values
    return []
