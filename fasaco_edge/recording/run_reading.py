"""The parts of one run, read once: what was plotted, its states, its log, its samples.

Pictures are passed over chunk by chunk, so that memory does not grow with them.
"""

from __future__ import annotations

import warnings
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bus.sample_codec import place_of
from fasaco_edge.errors import DifferentRuns, MalformedMessage, UnreadableRecording
from fasaco_edge.recording import entities
from fasaco_edge.recording.repair import Scan, scan_recording
from fasaco_edge.recording.samples import HINT, Batch, blobs
from fasaco_edge.recording.sdk import RrdReader
from fasaco_edge.recording.whole import whole_part

SCALAR, STATE, TEXT = "Scalars:scalars", "StateChange:state", "TextLog:text"
READ = ("/metrics/", "/state/", "/log/")

Told = tuple[int, str]
"""When [ns], and what."""


@dataclass(frozen=True, slots=True)
class PartFile:
    """A file of a recording: its size, what a crash tore off, whether it was ended in order."""

    path: Path
    bytes: int
    torn_bytes: int
    has_footer: bool


@dataclass(frozen=True, slots=True, eq=False)
class RunRecord:
    """What the parts of one run hold.

    Attributes:
        recording_id: what all parts share.
        parts: the files, by name.
        began_ns, ended_ns: first and last time on the timeline ``wall`` [ns].
        plots: float64 (n, 2) of each plotted entity: when, since ``began_ns`` [s], and its value.
        states: of each state entity when it was entered, and what it was.
        log: of each log entity when, and what was said.
        batches: samples, for ``RecordedSamples.of``.
    """

    recording_id: str
    parts: tuple[PartFile, ...]
    began_ns: int
    ended_ns: int
    plots: Mapping[str, NDArray[np.float64]]
    states: Mapping[str, tuple[Told, ...]]
    log: Mapping[str, tuple[Told, ...]]
    batches: tuple[Batch, ...]


def count_frames(paths: Sequence[Path]) -> int:
    """Return how many frames there are to be read.

    Raises:
        UnreadableRecording: a file is missing, or is no recording.
    """
    return sum(_scan(path).frames for path in paths)


def read_run_record(paths: Sequence[Path], advance: Callable[[], None]) -> RunRecord:
    """Read the parts of one run, in any order.

    Args:
        paths: the files; a torn one is read as far as it is whole, and left as it is.
        advance: called with each frame.

    Raises:
        UnreadableRecording: a file is missing or no recording, or there are no samples.
        DifferentRuns: the parts are not of one run.
    """
    gathering = _Gathering(advance)
    for path in sorted(set(paths)):
        gathering.read(path)
    return gathering.record()


@dataclass(slots=True)
class _Gathering:
    """What was read so far."""

    advance: Callable[[], None]
    ids: dict[str, Path] = field(default_factory=dict)
    parts: list[PartFile] = field(default_factory=list)
    span: list[int] = field(default_factory=list)
    rows: dict[str, list[tuple[int, Any]]] = field(default_factory=lambda: defaultdict(list))
    batches: list[Batch] = field(default_factory=list)

    def read(self, path: Path) -> None:
        try:
            with whole_part(path) as (whole, scan), warnings.catch_warnings():
                # Of a file without its footer: slower to open, and all there.
                warnings.filterwarnings("ignore", message="RRD file has no footer")
                reader = RrdReader(str(whole))
                self._note_part(path, scan, [entry.recording_id for entry in reader.recordings()])
                for chunk in reader.stream() if scan.frames else ():
                    self.advance()
                    self._take(chunk, path)
        except OSError as error:
            raise UnreadableRecording(f"{path}: {error.strerror or error}", hint=HINT) from error
        except (RuntimeError, ValueError, MalformedMessage) as error:
            raise UnreadableRecording(f"{path}: {error}", hint=HINT) from error

    def _note_part(self, path: Path, scan: Scan, ids: list[str]) -> None:
        for name in ids:
            self.ids.setdefault(name, path)
        torn = 0 if scan.has_footer else scan.torn_bytes
        self.parts.append(PartFile(path, scan.total_bytes, torn, scan.has_footer))

    def _take(self, chunk: Any, path: Path) -> None:  # noqa: ANN401 - rerun has no types
        entity = chunk.entity_path
        if entity == f"/{entities.INPUTS}":
            bodies = blobs(chunk.to_record_batch())
            self.batches += [Batch(place_of(body), body, path) for body in bodies]
        elif entity.startswith(READ) and not chunk.is_static:
            batch = chunk.to_record_batch()
            times = batch.column(entities.WALL).to_numpy(False).astype(np.int64).tolist()
            self.span += [min(times), max(times)]
            values = [value[0] if value else None for value in _values(batch)]
            rows = [row for row in zip(times, values, strict=False) if row[1] is not None]
            self.rows[entity[1:]] += rows

    def record(self) -> RunRecord:
        """Return all of it, in order of time."""
        if len(self.ids) > 1:
            raise DifferentRuns(
                "these are parts of different runs: "
                + ", ".join(f"{path} of {name}" for name, path in sorted(self.ids.items()))
            )
        if not self.batches:
            where = ", ".join(str(part.path) for part in self.parts)
            raise UnreadableRecording(
                f"{where}: holds no samples", hint="recordings of this release and later ones do"
            )
        began = min(self.span, default=0)
        for rows in self.rows.values():
            rows.sort(key=lambda row: row[0])
        return RunRecord(
            recording_id=next(iter(self.ids), ""),
            parts=tuple(self.parts),
            began_ns=began,
            ended_ns=max(self.span, default=0),
            plots=dict(self._plots(began)),
            states=self._texts("state/"),
            log=self._texts("log/"),
            batches=tuple(self.batches),
        )

    def _plots(self, began: int) -> Iterator[tuple[str, NDArray[np.float64]]]:
        for entity, rows in self.rows.items():
            if entity.startswith("metrics/"):
                seconds = [(1e-9 * (at - began), float(value)) for at, value in rows]
                yield entity, np.array(seconds, np.float64).reshape(-1, 2)

    def _texts(self, prefix: str) -> dict[str, tuple[Told, ...]]:
        return {
            entity: tuple((at, str(value)) for at, value in rows)
            for entity, rows in self.rows.items()
            if entity.startswith(prefix)
        }


def _values(batch: Any) -> list[Any]:  # noqa: ANN401 - pyarrow has no types
    for component in (SCALAR, STATE, TEXT):
        if component in batch.schema.names:
            values: list[Any] = batch.column(component).to_pylist()
            return values
    return []


def _scan(path: Path) -> Scan:
    try:
        with path.open("rb") as recording:
            scan = scan_recording(recording)
    except OSError as error:
        raise UnreadableRecording(f"{path}: {error.strerror or error}", hint=HINT) from error
    if scan is None:
        raise UnreadableRecording(f"{path}: this is no recording", hint=HINT)
    return scan
