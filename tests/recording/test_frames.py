"""Recordings are read as Rerun reads them, and believed no further than they go."""

from __future__ import annotations

import json
import random
import struct
import subprocess
import sys
import warnings
import zlib

import msgspec
import numpy as np
import pytest

pytest.importorskip("rerun")

import pyarrow as pa
from rerun.chunk import RrdReader

from fasaco_edge.errors import UnreadableRecording
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.frames import MOST_CHUNK_BYTES, chunks
from fasaco_edge.recording.read.run import RecordedSamples
from fasaco_edge.recording.read.torn import FRAME, HEADER_BYTES, scan_recording
from fasaco_edge.recording.sdk import rr
from fasaco_edge.recording.write.part import RecordingPart
from fasaco_edge.review.review import read_review
from fasaco_edge.samples import _HEAD, WHOLE, SampleEncoder, _Lane
from tests.samples.test_codec import arrival

RUN_ID = "20260101T000000Z-robot"
BEGAN_NS = 1_767_225_600 * 10**9


def recorded(folder, *batches):
    file = folder / f"{RUN_ID}-part1.rrd"
    part = RecordingPart(file, RUN_ID)
    for number in range(5):
        rr.set_time(
            entities.WALL_CLOCK, timestamp=np.datetime64(BEGAN_NS, "ns"), recording=part.stream
        )
        rr.log(entities.COVERED_FRACTION, rr.Scalars(0.2 * number), recording=part.stream)
        rr.log(entities.MISSION_LOG, rr.TextLog(f"covering: {number}"), recording=part.stream)
    rr.log("world/card", rr.TextDocument("static"), static=True, recording=part.stream)
    for batch in batches or (samples(),):
        part.write_blob(batch, BEGAN_NS)
    part.flush(10.0)
    part.close()
    return file


def samples():
    encoder = SampleEncoder(1)
    for number in range(20):
        encoder.add(arrival(b"pose %3d" % number, "pose"))
    return encoder.take()


def frames_of(content):
    """Return where each frame begins, its kind, and its length."""
    found, at = [], HEADER_BYTES
    while at + FRAME.size <= len(content):
        kind, length = FRAME.unpack_from(content, at)
        found.append((at, kind, length))
        at += FRAME.size + length
        if not kind:
            break
    return found


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return recorded(tmp_path_factory.mktemp("recording"))


def test_they_are_read_as_rerun_reads_them(recording):
    with recording.open("rb") as file:
        mine = [chunk for chunk in chunks(file, scan_recording(file)) if chunk is not None]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        theirs = list(RrdReader(str(recording)).stream())
    assert {chunk.recording_id for chunk in mine} == {RUN_ID}
    told = {(chunk.entity, chunk.is_static, chunk.batch.num_rows) for chunk in mine}
    assert told == {
        (chunk.entity_path.removeprefix("/"), chunk.is_static, chunk.num_rows) for chunk in theirs
    }
    assert len(mine) == len(theirs) > 3
    columns = {chunk.entity: chunk.batch for chunk in mine if not chunk.is_static}
    for chunk in theirs:
        if not chunk.is_static:
            batch = chunk.to_record_batch()
            entity = columns[chunk.entity_path.removeprefix("/")]
            assert [entity.column(name).to_pylist() for name in batch.schema.names] == [
                column.to_pylist() for column in batch.columns
            ]


def lane(**changes):
    """Return a batch with one lane that holds what it claims, but for the changes."""
    told = {
        "topic": "map",
        "key": "k",
        "schema": "s",
        "length": 8,
        "numbers": [0],
        "at_ns": [0],
        "ahead_ns": [0],
        "attachments": [],
        "against": WHOLE,
        "checksum": zlib.crc32(bytes(8)),
        "sparse": True,
        "body": struct.pack("<I", 0),
    }
    content = msgspec.msgpack.encode([_Lane(**(told | changes))])
    return _HEAD.pack(1, 5, 0) + zlib.compress(content)


def deflated_zeros(megabytes):
    """Return so many zeros as zlib packs them: a block of a megabyte, repeated."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    block = packer.compress(bytes(10**6)) + packer.flush(zlib.Z_FULL_FLUSH)
    checksum = (megabytes * 10**6 % 65521 << 16 | 1).to_bytes(4, "big")
    return b"\x78\xda" + megabytes * block + packer.flush() + checksum


# Made where they are read: each process of the suite collects this file.
LIES = {
    "a payload of 2 GB": lambda: lane(length=2 * 10**9),
    "many payloads of 60 MB": lambda: lane(length=60_000_000, numbers=[1] * 9, at_ns=[1] * 9),
    "a million samples": lambda: lane(numbers=[1] * 10**6, at_ns=[1] * 10**6, ahead_ns=[1] * 10**6),
    "runs of 4 GB": lambda: lane(
        body=struct.pack("<I", 2)
        + np.array([0, 2**32 - 1], "<u4").view("u1").reshape(2, 4).T.tobytes()
    ),
    "a gigabyte of zeros, deflated": lambda: _HEAD.pack(1, 5, 0) + deflated_zeros(1000),
}


def repacked(recording, folder, body):
    content = bytearray(recording.read_bytes())
    at, _, length = next(frame for frame in frames_of(content) if frame[1] == 2)
    content[at : at + FRAME.size + length] = FRAME.pack(2, len(body)) + body
    file = folder / recording.name
    file.write_bytes(content)
    return file


def varint(value):
    parts = []
    while value > 0x7F:
        parts.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*parts, value])


def chunk_of(batch, *, claimed=None, options=None):
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, batch.schema, options=options) as writer:
        writer.write_batch(batch)
    content = sink.getvalue().to_pybytes()
    packed = pa.compress(content, codec="lz4_raw", asbytes=True)
    store = b"\x08\x01\x12" + varint(len(RUN_ID)) + RUN_ID.encode()
    return b"".join(
        (
            b"\x0a" + varint(len(store)) + store,
            b"\x10\x02\x18" + varint(len(content) if claimed is None else claimed),
            b"\x2a" + varint(len(packed)) + packed,
        )
    )


def batch_of(entity, **columns):
    table = pa.table(columns).replace_schema_metadata({"rerun:entity_path": f"/{entity}"})
    return table.to_batches()[0]


WALL = pa.array([BEGAN_NS], pa.timestamp("ns"))
ZEROS = batch_of("log/x", wall=WALL, x=pa.array([bytes(10**6)]))


def of_nothings():
    """Return a chunk of a list of two thousand million nothings."""
    nothings = pa.ListArray.from_arrays(pa.array([0, 2**31 - 1], pa.int32()), pa.nulls(2**31 - 1))
    return chunk_of(batch_of(entities.MISSION_LOG, wall=WALL, **{"TextLog:text": nothings}))


LYING_CHUNKS = {
    "unpacks to 60 GB": (lambda: chunk_of(ZEROS, claimed=60 * 10**9), "hold at most"),
    "unpacks to more than there is": (
        lambda: chunk_of(ZEROS, claimed=MOST_CHUNK_BYTES),
        "hold at most",
    ),
    "columns that are packed, too": (
        lambda: chunk_of(ZEROS, options=pa.ipc.IpcWriteOptions(compression="zstd")),
        "compressed columns",
    ),
    "a list of two thousand million nothings": (
        of_nothings,
        "has to be list<item: string> without nulls",
    ),
    "no times": (lambda: chunk_of(batch_of("metrics/x", y=WALL)), "without the timeline wall"),
    "no Protobuf": (lambda: b"\xff" * 40, "frame 3"),
}


@pytest.fixture(scope="module")
def refused(recording, tmp_path_factory):
    """Read all lies in a process that may take 700 MB more than it has; return what it says."""
    folder = tmp_path_factory.mktemp
    files = {lie: recorded(folder("lie"), batch()) for lie, batch in LIES.items()} | {
        lie: repacked(recording, folder("chunk"), body()) for lie, (body, _) in LYING_CHUNKS.items()
    }
    code = (
        "import json, resource, sys, pathlib\n"
        "from fasaco_edge.review.review import read_review\n"
        "from fasaco_edge.errors import FasacoError\n"
        "pages = int(open('/proc/self/statm').read().split()[0])\n"
        "resource.setrlimit(resource.RLIMIT_AS, (4096 * pages + 700_000_000,) * 2)\n"
        "for name, file in json.loads(sys.argv[1]).items():\n"
        "    told = ''\n"
        "    try:\n        read_review([pathlib.Path(file)])\n"
        "    except FasacoError as error:\n"
        "        told = f'{type(error).__name__} {error} {error.hint}'\n"
        "    print(json.dumps([name, told]), flush=True)\n"
    )
    words = [
        sys.executable,
        "-c",
        code,
        json.dumps({lie: str(file) for lie, file in files.items()}),
    ]
    ended = subprocess.run(words, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return dict(map(json.loads, ended.stdout.splitlines()))


@pytest.mark.parametrize("lie", [*LIES, *LYING_CHUNKS])
def test_a_false_claim_is_refused_in_little_memory(refused, lie):
    assert refused[lie].startswith("UnreadableRecording")
    assert LYING_CHUNKS.get(lie, ("", ""))[1] in refused[lie]
    assert "the file is damaged" in refused[lie]


@pytest.mark.parametrize("seed", range(4))
def test_a_recording_with_wrong_bytes_is_read_or_named(recording, tmp_path, seed):
    """Never a traceback, never the end of the process, as with Rerun's own reader."""
    dice, content = random.Random(seed), recording.read_bytes()
    frames = frames_of(content)
    file, read = tmp_path / recording.name, 0
    for _ in range(60):
        wrong = bytearray(content)
        for _ in range(dice.choice((1, 1, 3))):
            at, _, length = dice.choice(frames)
            place = at + dice.choice((dice.randrange(16), 16 + dice.randrange(max(length, 1))))
            wrong[place % len(wrong)] = dice.choice((0, 0x7F, 0x80, 0xFF, dice.randrange(256)))
        file.write_bytes(wrong)
        try:
            read_review([file])
            list(RecordedSamples([file]))
            read += 1
        except UnreadableRecording as error:
            told = str(error)
    assert 0 < read < 60
    assert str(file) in told
