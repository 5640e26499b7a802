"""Codec of recorded samples: lossless batches of many samples.

Successive payloads of a key are similar. So a payload is stored as its difference from the previous
payload of the same key and length, and a batch is deflated. The first payload of a key is stored as
a whole, also after ``SampleEncoder.restart``.

A batch is ``_HEAD`` and the deflated MessagePack of a list of lanes. The samples of a lane have the
same topic, key, schema and length. Each large payload has a lane of its own.

The difference, or residual, is the exclusive or: zero where nothing changed. The residual of
several payloads has all their first bytes, then all second bytes, so that bytes that rarely change
give long runs of zeros. If nearly all bytes are zero, only the lengths of the runs and the other
bytes are stored: some hundred bytes for some hundred changed pixels in a map of a million.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bus.arrival import Arrival, Sample
from fasaco_edge.errors import MalformedMessage
from fasaco_edge.wire.limits import MAX_MESSAGE_BYTES

FORMAT = 1
# Format, run, and number of the batch's first new sample.
_HEAD = struct.Struct("<BQQ")
LARGE_BYTES = 16_384
DEFLATE_LEVEL = 6
# Limit on the content of a batch, checked before it is inflated: the map in force, a new map, and
# the samples that arrive meanwhile (``recording.write.input_log``).
MOST_BATCH_BYTES = 3 * MAX_MESSAGE_BYTES
MOST_SAMPLES = 200_000
# Value of ``_Lane.against`` if the first payload is stored as a whole.
WHOLE = -1

# Runs of zeros are stored if, of this many bytes, at most one is not zero on average.
SPARSE = 8
_COUNT = struct.Struct("<I")

_MANY = msgspec.Meta(max_length=MOST_SAMPLES)


@dataclass(frozen=True, slots=True)
class Numbered:
    """A sample and its number in the run, from 0."""

    number: int
    arrival: Arrival


@dataclass(frozen=True, slots=True)
class BatchPlace:
    """Position of a batch: its run, and the number of its first new sample."""

    run: int
    first: int


class _Lane(msgspec.Struct, array_like=True):
    """Samples that share topic, key, schema and length.

    Attributes:
        numbers, at_ns, ahead_ns: for each sample its number, its time, and the wall clock minus
            its time; after the first sample, as differences from the previous sample.
        attachments: attachments of each sample; empty if all are empty.
        against: number of the sample from which the first payload's difference is taken.
        checksum: CRC-32 of all payloads in order.
        sparse, body: the residual.
    """

    topic: str
    key: str
    schema: str
    length: Annotated[int, msgspec.Meta(ge=0, le=MAX_MESSAGE_BYTES)]
    numbers: Annotated[list[int], _MANY]
    at_ns: Annotated[list[int], _MANY]
    ahead_ns: Annotated[list[int], _MANY]
    attachments: Annotated[list[bytes], _MANY]
    against: int
    checksum: int
    sparse: bool
    body: bytes


class SampleEncoder:
    """Encodes samples into batches; decoding a batch needs all batches since the last restart.

    Args:
        run: identifies the run, for example its start [ns].
    """

    def __init__(self, run: int) -> None:
        self.waiting_bytes = 0
        self._run = run
        self._next = 0
        self._waiting: list[Numbered] = []
        self._again: list[Numbered] = []
        self._last: dict[str, Numbered] = {}

    def add(self, arrival: Arrival) -> Numbered:
        """Take a sample into the next batch; return it with its number."""
        numbered = Numbered(self._next, arrival)
        self._next += 1
        self._waiting.append(numbered)
        self.waiting_bytes += len(arrival.sample.payload)
        return numbered

    def skip(self, count: int) -> None:
        """Skip the numbers of lost samples, so that a reader sees the gap."""
        self._next += count

    def restart(self, again: Sequence[Numbered] = ()) -> None:
        """Make the next batch need no earlier batch; it begins with earlier samples, ``again``."""
        self._last.clear()
        first = self._waiting[0].number if self._waiting else self._next
        self._again = [numbered for numbered in again if numbered.number < first]

    def take(self, *, in_any_case: bool = False) -> bytes:
        """Return a batch of all samples added since the last batch; b"" without new samples.

        ``in_any_case``: return a batch without new samples, too; it must be the last.
        """
        if not self._waiting and not in_any_case:
            return b""
        first = self._waiting[0].number if self._waiting else self._next
        lanes = [self._lane(samples) for samples in _by_lane(self._again + self._waiting)]
        self._again, self._waiting, self.waiting_bytes = [], [], 0
        body = zlib.compress(msgspec.msgpack.encode(lanes), DEFLATE_LEVEL)
        return _HEAD.pack(FORMAT, self._run, first) + body

    def _lane(self, samples: list[Numbered]) -> _Lane:
        arrivals = [numbered.arrival for numbered in samples]
        first, last = arrivals[0], self._last.get(arrivals[0].topic)
        if last is not None and _kind(last.arrival) != _kind(first):
            last = None
        self._last[first.topic] = samples[-1]
        payloads = [arrival.sample.payload for arrival in arrivals]
        sparse, body = _residual(payloads, last.arrival.sample.payload if last else b"")
        attachments = [arrival.sample.attachment for arrival in arrivals]
        return _Lane(
            topic=first.topic,
            key=first.sample.key,
            schema=first.sample.schema,
            length=len(payloads[0]),
            numbers=_differences([numbered.number for numbered in samples]),
            at_ns=_differences([arrival.at_ns for arrival in arrivals]),
            ahead_ns=_differences([arrival.wall_ns - arrival.at_ns for arrival in arrivals]),
            attachments=attachments if any(attachments) else [],
            against=last.number if last else WHOLE,
            checksum=zlib.crc32(b"".join(payloads)),
            sparse=sparse,
            body=body,
        )


class SampleDecoder:
    """Decodes the batches of one run, in order.

    Args:
        topics: topics to decode; None for all.
    """

    def __init__(self, topics: Container[str] | None = None) -> None:
        self._topics = topics
        self._last: dict[str, Numbered] = {}

    def samples(self, batch: bytes) -> list[Numbered]:
        """Return the samples of ``batch`` in order of their numbers.

        Raises:
            MalformedMessage: it is no batch, or an earlier batch that it needs is missing.
        """
        place_of(batch)
        try:
            samples = [
                numbered
                for lane in _lanes(_inflated(batch[_HEAD.size :]))
                if self._topics is None or lane.topic in self._topics
                for numbered in self._samples(lane)
            ]
        except (zlib.error, struct.error, msgspec.DecodeError, ValueError, IndexError) as error:
            raise MalformedMessage(f"batch of samples: {error}") from error
        return sorted(samples, key=lambda numbered: numbered.number)

    def _samples(self, lane: _Lane) -> list[Numbered]:
        numbers, before = list(accumulate(lane.numbers)), b""
        if lane.against != WHOLE:
            last = self._last.get(lane.topic)
            if last is None or last.number != lane.against:
                raise MalformedMessage(
                    f"sample {numbers[0]} is stored as its difference from sample {lane.against}, "
                    "which is missing"
                )
            before = last.arrival.sample.payload
        payloads = _payloads(lane, before)
        if zlib.crc32(b"".join(payloads)) != lane.checksum:
            raise MalformedMessage(f"sample {numbers[0]}, or a later one, has a wrong checksum")
        attachments = lane.attachments or [b""] * len(numbers)
        times = accumulate(lane.at_ns), accumulate(lane.ahead_ns)
        samples = []
        for number, payload, attachment, at_ns, ahead_ns in zip(
            numbers, payloads, attachments, *times, strict=True
        ):
            sample = Sample(lane.key, payload, lane.schema, attachment)
            arrival = Arrival(lane.topic, sample, at_ns, at_ns + ahead_ns)
            samples.append(Numbered(number, arrival))
        self._last[lane.topic] = samples[-1]
        if sum(len(kept.arrival.sample.payload) for kept in self._last.values()) > MOST_BATCH_BYTES:
            raise MalformedMessage(f"last samples of all topics exceed {MOST_BATCH_BYTES} bytes")
        return samples


def place_of(batch: bytes) -> BatchPlace:
    """Return the position of a batch.

    Raises:
        MalformedMessage: it is no batch, or of another release.
    """
    if len(batch) < _HEAD.size:
        raise MalformedMessage(f"batch of samples: {len(batch)} bytes are too few")
    kind, run, first = _HEAD.unpack_from(batch)
    if kind != FORMAT:
        raise MalformedMessage(
            f"batch of samples: format must be {FORMAT}, got {kind}",
            hint="use the same release for daemon and recorder",
        )
    return BatchPlace(run, first)


def _inflated(body: bytes) -> bytes:
    inflater = zlib.decompressobj()
    content = inflater.decompress(body, MOST_BATCH_BYTES)
    if inflater.unconsumed_tail or not inflater.eof:
        raise MalformedMessage(f"batch of samples: cut off, or over {MOST_BATCH_BYTES} bytes")
    return content


def _lanes(content: bytes) -> Iterator[_Lane]:
    """Yield lanes one by one; raise MalformedMessage if their content exceeds the limits."""
    samples = claimed = 0
    for raw in msgspec.msgpack.decode(content, type=Annotated[list[msgspec.Raw], _MANY]):
        lane = msgspec.msgpack.decode(raw, type=_Lane)
        samples += len(lane.numbers)
        claimed += len(lane.numbers) * lane.length
        if samples > MOST_SAMPLES or claimed > MOST_BATCH_BYTES:
            raise MalformedMessage(
                f"batch of samples: has {samples} samples of {claimed} bytes, at most "
                f"{MOST_SAMPLES} of {MOST_BATCH_BYTES} are allowed"
            )
        yield lane


def _kind(arrival: Arrival) -> tuple[str, str, str, int]:
    sample = arrival.sample
    return arrival.topic, sample.key, sample.schema, len(sample.payload)


def _by_lane(samples: Sequence[Numbered]) -> list[list[Numbered]]:
    lanes: dict[tuple[object, ...], list[Numbered]] = {}
    for numbered in samples:
        large = len(numbered.arrival.sample.payload) > LARGE_BYTES
        lane = (*_kind(numbered.arrival), numbered.number if large else WHOLE)
        lanes.setdefault(lane, []).append(numbered)
    return list(lanes.values())


def _differences(values: Sequence[int]) -> list[int]:
    return [after - before for before, after in pairwise((0, *values))]


def _residual(payloads: Sequence[bytes], before: bytes) -> tuple[bool, bytes]:
    """Return the differences of payloads, and whether they are stored as runs.

    Args:
        payloads: in order.
        before: the payload before the first, of the same length; b"" for none.
    """
    if len(payloads) == 1:
        # A single payload is usually large: save memory.
        flat = np.frombuffer(payloads[0], np.uint8)
        flat = flat ^ np.frombuffer(before, np.uint8) if before else flat
    else:
        rows = np.frombuffer(b"".join(payloads), np.uint8).reshape(len(payloads), len(payloads[0]))
        differences = rows.copy()
        differences[1:] ^= rows[:-1]
        if before:
            differences[0] ^= np.frombuffer(before, np.uint8)
        flat = differences.T.ravel()
    changed = flat != 0
    if SPARSE * np.count_nonzero(changed) > flat.size:
        return False, flat.tobytes()
    edges = np.flatnonzero(changed[1:] != changed[:-1]) + 1
    ends = [0] * int(changed[:1].any()), [flat.size] * int(changed[-1:].any())
    edges = np.concatenate((ends[0], edges, ends[1])).astype(np.int64)
    # Numbers of zeros, of other bytes, of zeros ...; first the low bytes of all numbers.
    runs = np.diff(edges, prepend=0).astype("<u4").view(np.uint8).reshape(-1, 4).T
    return True, _COUNT.pack(len(edges)) + runs.tobytes() + flat[changed].tobytes()


def _payloads(lane: _Lane, before: bytes) -> list[bytes]:
    """Return the payloads of a lane; ``before``: see ``_residual``.

    Raises:
        ValueError, IndexError, struct.error: its residual is malformed.
    """
    count = len(lane.numbers)
    flat = _flat(lane, count * lane.length)
    rows = np.ascontiguousarray(flat.reshape(lane.length, count).T)
    if before:
        rows[0] ^= np.frombuffer(before, np.uint8)
    for index in range(1, count):
        rows[index] ^= rows[index - 1]
    return [row.tobytes() for row in rows]


def _flat(lane: _Lane, size: int) -> NDArray[np.uint8]:
    body = np.frombuffer(lane.body, np.uint8)
    if not lane.sparse:
        return body.copy()
    end = _COUNT.size + 4 * _COUNT.unpack_from(lane.body)[0]
    runs = np.ascontiguousarray(body[_COUNT.size : end].reshape(4, -1).T).view("<u4").ravel()
    edges = np.cumsum(runs, dtype=np.int64)
    starts, lengths = edges[0::2], runs[1::2]
    if int(lengths.sum(dtype=np.int64)) != body.size - end:
        raise ValueError(f"runs of {lengths.sum(dtype=np.int64)} bytes, {body.size - end} follow")
    # Place of each byte that is not zero: its index among such bytes plus the zeros before it.
    places = np.arange(body.size - end)
    places += np.repeat(starts - (np.cumsum(lengths, dtype=np.int64) - lengths), lengths)
    flat = np.zeros(size, np.uint8)
    flat[places] = body[end:]
    return flat
