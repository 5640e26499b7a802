"""The chunks of a recording, read without Rerun, whose import takes 0.3 s of processor time.

A chunk is a compressed Arrow message in a Protobuf message in a frame (``recording.read.torn``).
Each message states the size of the message inside. This reader checks the size before it allocates
memory; Rerun's allocates first, and aborts the process if memory is short or a message is
malformed. The footer, an index, is not read.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from fasaco_edge.errors import MissingExtra
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.torn import FOOTER_KIND, FRAME, HEADER_BYTES, Scan, open_part


def missing_rerun(error: ImportError) -> MissingExtra:
    """Return the error of an installation without recordings."""
    return MissingExtra(f"recordings need rerun, which is not installed: {error}")


try:
    import pyarrow as pa
except ImportError as error:
    raise missing_rerun(error) from error

# Other modules import pyarrow from here.
__all__ = ["pa"]

# Arrow's own pool keeps about ten megabytes of freed memory.
pa.set_memory_pool(pa.system_memory_pool())

CHUNK_KIND = 2
# Limit of an uncompressed chunk. The largest chunk of a recorder is a map of 64 million pixels.
MOST_CHUNK_BYTES = 128 * 1024 * 1024
# Largest ratio of LZ4 compression.
LZ4_RATIO = 255

# Field numbers of a chunk's Protobuf message, and of its store.
STORE, PACKING, UNPACKED, ARROW, IS_STATIC = 1, 2, 3, 5, 7
STORE_KIND, STORE_ID = 1, 2
RECORDING = 1
NOT_PACKED, LZ4 = 1, 2
ENTITY_PATH = b"rerun:entity_path"
# Protobuf's wire types, and slots of Arrow's Flatbuffers.
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
_HEADER, _COMPRESSION = 2, 3

# Exceptions raised for a malformed message.
BROKEN = (ValueError, LookupError, struct.error, OSError, StopIteration)

Fields = dict[int, int | bytes]


@dataclass(frozen=True, slots=True)
class Chunk:
    """Some rows of an entity.

    Attributes:
        recording_id: id of the recording.
        entity: name without the leading slash.
        is_static: whether the rows have no times.
        batch: the rows, validated.
        bytes: uncompressed size.
        offset: position of its frame in the file, for ``chunk_at`` [bytes].
    """

    recording_id: str
    entity: str
    is_static: bool
    batch: pa.RecordBatch
    bytes: int
    offset: int


def chunks_in(path: Path) -> Iterator[Chunk]:
    """Yield the chunks in the complete frames of a part.

    Raises:
        UnreadableRecording: the file is missing or damaged, or is not a recording.
    """
    with open_part(path) as (recording, scan):
        yield from chunks(recording, scan)


def chunks(recording: BinaryIO, scan: Scan) -> Iterator[Chunk]:
    """Yield the chunks in the complete frames of an open part.

    Raises:
        ValueError: a frame is malformed.
        OSError: the file cannot be read.
    """
    offset = HEADER_BYTES
    recording.seek(offset)
    for number in range(1, scan.frames + 1):
        kind, length = FRAME.unpack(recording.read(FRAME.size))
        if kind == FOOTER_KIND:
            return
        body = recording.read(length)
        try:
            chunk = _chunk(body, offset) if kind == CHUNK_KIND else None
        # Arrow raises StopIteration if a message is missing.
        except (*BROKEN, pa.ArrowException) as error:
            raise ValueError(f"frame {number} of {scan.frames}: {error or 'torn'}") from error
        if chunk is not None:
            yield chunk
        offset += FRAME.size + length


def chunk_at(descriptor: int, offset: int) -> Chunk:
    """Return a chunk of an open file that was read before.

    Raises:
        ValueError: it is no longer there.
        OSError: the file cannot be read.
    """
    try:
        _, length = FRAME.unpack(os.pread(descriptor, FRAME.size, offset))
        chunk = _chunk(os.pread(descriptor, length, offset + FRAME.size), offset)
    except (*BROKEN, pa.ArrowException) as error:
        raise ValueError(f"the frame at byte {offset}: {error or 'torn'}") from error
    if chunk is None:
        raise ValueError(f"the frame at byte {offset} has changed")
    return chunk


def column(batch: pa.RecordBatch, name: str, kind: pa.DataType) -> pa.Array | None:
    """Return a column of a batch; None if there is none.

    Raises:
        ValueError: its type is not ``kind``, or it has nulls.
    """
    if name not in batch.schema.names:
        return None
    found = batch.column(name)
    if found.type != kind or found.null_count:
        raise ValueError(f"{name} has to be {kind} without nulls, got {found.type}")
    return found


def wall_ns(batch: pa.RecordBatch) -> list[int]:
    """Return the times at which the rows of a batch were logged [ns].

    Raises:
        ValueError: they have no times.
    """
    found = column(batch, entities.WALL_CLOCK, pa.timestamp("ns"))
    if found is None:
        raise ValueError(f"rows without the timeline {entities.WALL_CLOCK}")
    times: list[int] = found.cast(pa.int64()).to_pylist()
    return times


def _chunk(body: bytes, offset: int) -> Chunk | None:
    message = _fields(body)
    store = _fields(_bytes(message, STORE))
    if store.get(STORE_KIND) != RECORDING:
        return None
    content = _unpacked(message)
    batch = _batch(content)
    entity = (batch.schema.metadata or {})[ENTITY_PATH].decode().removeprefix("/")
    identifier = _bytes(store, STORE_ID).decode()
    is_static = bool(_number(message, IS_STATIC, 0))
    return Chunk(identifier, entity, is_static, batch, len(content), offset)


def _unpacked(message: Fields) -> pa.Buffer:
    packing, packed = _number(message, PACKING, NOT_PACKED), _bytes(message, ARROW)
    if packing == NOT_PACKED:
        return pa.py_buffer(packed)
    if packing != LZ4:
        raise ValueError(f"packed in an unknown way, {packing}")
    claimed, most = _number(message, UNPACKED, 0), min(len(packed) * LZ4_RATIO, MOST_CHUNK_BYTES)
    if claimed > most:
        raise ValueError(f"claims {claimed} bytes; {len(packed)} packed bytes hold at most {most}")
    return pa.decompress(packed, decompressed_size=claimed, codec="lz4_raw")


def _batch(content: pa.Buffer) -> pa.RecordBatch:
    messages = pa.ipc.MessageReader.open_stream(content)
    schema = pa.ipc.read_schema(messages.read_next_message())
    rows = messages.read_next_message()
    if rows.type != "record batch":
        raise ValueError(f"rows have to follow the schema, got a {rows.type}")
    _check_not_compressed(rows.metadata.to_pybytes())
    batch = pa.ipc.read_record_batch(rows, schema)
    batch.validate(full=True)
    return batch


def _check_not_compressed(flat: bytes) -> None:
    """Raise ValueError for compressed columns: their uncompressed size has no limit."""
    message = struct.unpack_from("<I", flat)[0]
    header = _slot(flat, message, _HEADER)
    rows = header + struct.unpack_from("<I", flat, header)[0]
    if _slot(flat, rows, _COMPRESSION):
        raise ValueError("compressed columns, which no recorder writes")


def _slot(flat: bytes, table: int, number: int) -> int:
    """Return the offset of a field of a Flatbuffers table; 0 if the field is missing."""
    about = table - struct.unpack_from("<i", flat, table)[0]
    size = struct.unpack_from("<H", flat, about)[0]
    place = 4 + 2 * number
    offset = struct.unpack_from("<H", flat, about + place)[0] if place < size else 0
    return table + offset if offset else 0


def _bytes(message: Fields, number: int) -> bytes:
    value = message[number]
    if not isinstance(value, bytes):
        raise ValueError(f"field {number} has to be bytes")
    return value


def _number(message: Fields, number: int, unless: int) -> int:
    value = message.get(number, unless)
    if not isinstance(value, int):
        raise ValueError(f"field {number} has to be a number")
    return value


def _fields(message: bytes) -> Fields:
    """Return the fields of a Protobuf message, integers and bytes, by their numbers."""
    found: Fields = {}
    at = 0
    while at < len(message):
        key, at = _varint(message, at)
        kind = key & 7
        if kind == _VARINT:
            found[key >> 3], at = _varint(message, at)
            continue
        if kind == _BYTES:
            length, at = _varint(message, at)
        elif kind in (_FIXED64, _FIXED32):
            length = 8 if kind == _FIXED64 else 4
        else:
            raise ValueError("no Protobuf message")
        if at + length > len(message):
            raise ValueError("it breaks off")
        found[key >> 3] = message[at : at + length]
        at += length
    return found


def _varint(message: bytes, at: int) -> tuple[int, int]:
    value = 0
    for place in range(10):
        byte = message[at + place]
        value |= (byte & 0x7F) << (7 * place)
        if byte < 0x80:
            return value, at + place + 1
    raise ValueError("a number of more than ten bytes")


def recording_id(path: Path) -> str:
    """Return the id of the run that a file belongs to; "" if the file has no complete frame.

    Raises:
        UnreadableRecording: the file is missing, or is not a recording.
    """
    return next((chunk.recording_id for chunk in chunks_in(path)), "")


def is_fleet_recording(path: Path) -> bool:
    """Return whether a file is the recording of a fleet.

    Raises:
        UnreadableRecording: the file is missing, or is not a recording.
    """
    roots = (chunk.entity.partition("/")[0] for chunk in chunks_in(path))
    known = (root for root in roots if root in (entities.FLEET, entities.WORLD, entities.INPUTS))
    return next(known, "") == entities.FLEET
