"""What the mission heard, read back from a recording: byte for byte, in order, part by part.

The files are not touched, whoever wrote them and however that ended: of a torn one, or one
that is still being written, the whole frames are read.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from fasaco_edge.bus.arrival import Arrival
from fasaco_edge.errors import MalformedMessage, UnreadableRecording
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.frames import chunks, column
from fasaco_edge.recording.read.repair import scan_recording
from fasaco_edge.recording.sdk import pa
from fasaco_edge.samples.codec import Place, SampleDecoder, place_of

HINT = "name the .rrd files that a recorder has written"
COMPONENT = f"{entities.INPUTS_ARCHETYPE}:{entities.INPUTS_COMPONENT}"


@dataclass(frozen=True, slots=True)
class Batch:
    """A batch of samples, where it belongs, and the file it is from."""

    place: Place
    body: bytes
    path: Path


class RecordedSamples:
    """The samples in the parts of a recording, and in those of the recordings after it.

    Args:
        paths: the files, in any order. Where parts are missing at the beginning, the samples
            begin with the map that was in force.

    Raises:
        UnreadableRecording: a file is none, or all hold no samples.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        batches = [batch for path in paths for batch in _batches(path)]
        # One part alone may have none: its recorder was killed when it had just begun.
        if paths and not batches:
            files = ", ".join(str(path) for path in paths)
            raise UnreadableRecording(
                f"{files}: holds no samples", hint="recordings of this release and later ones do"
            )
        self._take(batches)

    @classmethod
    def of(cls, batches: Sequence[Batch]) -> Self:
        """Return the samples in batches that were read already, in any order."""
        samples = cls(())
        samples._take(batches)
        return samples

    def _take(self, batches: Sequence[Batch]) -> None:
        # Runs are numbered by their beginning, so later ones follow.
        self._batches = sorted(batches, key=lambda batch: (batch.place.run, batch.place.first))
        self.missing = 0

    def __iter__(self) -> Iterator[Arrival]:
        """Yield all samples in order; ``missing`` counts those that were lost in between.

        Raises:
            UnreadableRecording: a batch is broken.
        """
        self.missing = 0
        run, following, begun, decoder = -1, 0, False, SampleDecoder()
        for batch in self._batches:
            if batch.place.run != run:
                run, following, begun, decoder = batch.place.run, 0, False, SampleDecoder()
            try:
                samples = decoder.samples(batch.body)
            except MalformedMessage as error:
                raise UnreadableRecording(f"{batch.path}: {error}", hint=HINT) from error
            for numbered in samples:
                # A part begins with samples that the one before it may have told already.
                if numbered.number < following:
                    continue
                # What came before the first part that is given is not missed.
                self.missing += numbered.number - following if begun else 0
                begun = begun or numbered.number >= batch.place.first
                following = numbered.number + 1
                yield numbered.arrival


def _batches(path: Path) -> list[Batch]:
    try:
        with path.open("rb") as recording:
            scan = scan_recording(recording)
            if scan is None:
                raise ValueError("this is no recording")
            bodies = [
                body
                for chunk in chunks(recording, scan)
                if chunk is not None and chunk.entity == entities.INPUTS
                for body in blobs(chunk.batch)
            ]
        return [Batch(place_of(body), body, path) for body in bodies]
    except OSError as error:
        raise UnreadableRecording(f"{path}: {error.strerror or error}", hint=HINT) from error
    except (ValueError, MalformedMessage) as error:
        raise UnreadableRecording(f"{path}: {error}", hint=HINT) from error


def blobs(batch: Any) -> Iterator[bytes]:  # noqa: ANN401 - pyarrow has no types
    """Yield the batches of samples in a record batch of the entity ``inputs``."""
    found = column(batch, COMPONENT, pa.list_(pa.uint8()))
    for blob in found if found is not None else ():
        yield np.asarray(blob.values, np.uint8).tobytes()


def wall_ns(batch: Any) -> list[int]:  # noqa: ANN401 - pyarrow has no types
    """Return when the rows of a record batch were logged [ns].

    Raises:
        ValueError: they have no such times.
    """
    found = column(batch, entities.WALL, pa.timestamp("ns"))
    if found is None:
        raise ValueError(f"rows without the timeline {entities.WALL}")
    times: list[int] = found.cast(pa.int64()).to_pylist()
    return times
