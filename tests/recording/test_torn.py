"""Recordings cut anywhere are cut back to whole frames; nothing else is touched."""

from __future__ import annotations

import fcntl
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.recording.read.torn import (
    HEADER_BYTES,
    MOST_ZEROS,
    Scan,
    repair_folder,
    repair_recording,
    scan_recording,
)

HEADER = b"RRF2".ljust(HEADER_BYTES - 2, b"\1") + bytes(2)


def frame(kind: int, body: bytes) -> bytes:
    return struct.pack("<QQ", kind, len(body)) + body


# A frame of unknown kind ends the scan.
NOISE = frame(7, b"noise")
FRAMES = [frame(1, b"store"), frame(2, b"x" * 40), frame(2, b"y"), frame(3, b"blueprint")]
WHOLE = HEADER + b"".join(FRAMES)
ENDS = [HEADER_BYTES + sum(map(len, FRAMES[:count])) for count in range(len(FRAMES) + 1)]


def written(folder: Path, content: bytes, name: str = "a.rrd") -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


@given(st.integers(HEADER_BYTES, len(WHOLE)))
def test_a_cut_leaves_the_frames_before_it(tmp_path_factory, size):
    path = written(tmp_path_factory.mktemp("cut"), WHOLE[:size])
    repair = repair_recording(path)
    kept = max(end for end in ENDS if end <= size)
    assert path.read_bytes() == WHOLE[:kept]
    assert (repair.cut_bytes if repair else 0) == size - kept
    assert repair_recording(path) is None


@given(st.integers(HEADER_BYTES, len(WHOLE)), st.integers(16, 200_000))
def test_trailing_zeros_are_cut_with_the_frame_they_are_in(tmp_path_factory, size, zeros):
    """A power cut leaves zeros; read as a frame, they would be an empty footer."""
    content = WHOLE[:size] + bytes(zeros)
    path = written(tmp_path_factory.mktemp("cut"), content)
    assert repair_recording(path) is not None
    solid = len(WHOLE[:size].rstrip(b"\0")) + MOST_ZEROS
    assert path.read_bytes() == content[: max(end for end in ENDS if end <= solid)]


@pytest.mark.parametrize("kept", [0, 4, 9])
def test_a_footer_that_is_followed_by_zeros_is_cut(tmp_path, kept):
    pointer = b"pointer to the footer"
    content = WHOLE + frame(0, b"footer") + pointer[:kept].ljust(len(pointer) + kept, b"\0")
    path = written(tmp_path, content)
    assert repair_recording(path) is not None
    assert path.read_bytes() == WHOLE


@pytest.mark.parametrize(
    ("content", "is_recording"),
    [(b"", True), (b"RR", True), (b"RRF2", True), (b"RRF2" + bytes(40), True), (bytes(40), True),
     (b"RX", False), (b"hello", False), (b"hello, this is a text of some length", False)],
)  # fmt: skip
def test_what_has_no_whole_header_has_no_frames_and_is_left_alone(tmp_path, content, is_recording):
    path = written(tmp_path, content)
    with path.open("rb") as recording:
        scan = scan_recording(recording)
    assert scan == (Scan(0, 0, len(content), has_footer=False) if is_recording else None)
    assert repair_recording(path) is None
    assert path.read_bytes() == content


def test_an_ended_recording_keeps_what_follows_its_footer(tmp_path):
    content = WHOLE + frame(0, b"footer") + b"pointer to the footer"
    path = written(tmp_path, content)
    assert repair_recording(path) is None
    assert path.read_bytes() == content
    with path.open("rb") as recording:
        scan = scan_recording(recording)
    assert scan is not None
    assert scan.has_footer
    assert scan.frames == len(FRAMES) + 1


def test_a_recording_being_written_is_left_alone(tmp_path):
    path = written(tmp_path, WHOLE + NOISE)
    with path.open("rb") as writer:
        fcntl.flock(writer, fcntl.LOCK_EX)
        assert repair_folder(tmp_path) == []
    assert [repair.cut_bytes for repair in repair_folder(tmp_path)] == [len(NOISE)]


def test_a_folder_is_repaired_in_order_and_may_be_missing(tmp_path):
    for name in ("b.rrd", "a.rrd", "c.txt"):
        written(tmp_path, WHOLE + b"torn", name)
    assert [repair.path.name for repair in repair_folder(tmp_path)] == ["a.rrd", "b.rrd"]
    assert repair_folder(tmp_path / "missing") == []
