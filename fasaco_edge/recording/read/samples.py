"""The samples that the mission took, read back from a recording: byte for byte, in order.

The files are not changed: of one that is torn, or still being written, the whole frames are read.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from fasaco_edge.bus.arrival import Arrival
from fasaco_edge.errors import MalformedMessage, UnreadableRecording
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.frames import HINT, Chunk, chunks, column, open_part
from fasaco_edge.recording.sdk import pa
from fasaco_edge.samples.codec import Place, SampleDecoder, place_of

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
            raise no_samples(paths)
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
                # A part begins with samples in force that the one before it may hold already.
                if numbered.number < following:
                    continue
                # What came before the first part that is given is not missed.
                self.missing += numbered.number - following if begun else 0
                begun = begun or numbered.number >= batch.place.first
                following = numbered.number + 1
                yield numbered.arrival


def batches_of(chunk: Chunk, path: Path) -> list[Batch]:
    """Return the batches of samples in a chunk of the entity ``inputs`` of the file ``path``.

    Raises:
        ValueError: the chunk holds something else.
        MalformedMessage: a batch is broken.
    """
    found = column(chunk.batch, COMPONENT, pa.list_(pa.uint8()))
    bodies = [np.asarray(blob.values, np.uint8).tobytes() for blob in found or ()]
    return [Batch(place_of(body), body, path) for body in bodies]


def no_samples(paths: Iterable[Path]) -> UnreadableRecording:
    """Return the error of files that hold no samples."""
    files = ", ".join(str(path) for path in paths)
    return UnreadableRecording(
        f"{files}: holds no samples", hint="recordings of this release and later ones do"
    )


def _batches(path: Path) -> list[Batch]:
    with open_part(path) as (recording, scan):
        return [
            batch
            for chunk in chunks(recording, scan)
            if chunk is not None and chunk.entity == entities.INPUTS
            for batch in batches_of(chunk, path)
        ]
