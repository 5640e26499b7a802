"""Grids as marks: against slow ones; and who may do what."""

from __future__ import annotations

import errno
import json
import stat
import struct
import zlib

import numpy as np
import pytest

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.serve import messages
from fasaco_edge.serve.guard import Guard, is_same_origin, read_tokens
from fasaco_edge.serve.messages import message_text
from fasaco_edge.wire.documents.settings import MapSettings
from fasaco_edge.wire.messages.grids import GridOctets
from fasaco_edge.wire.messages.maps import CoverageValue


@pytest.mark.parametrize("step", [1, 2, 3, 7])
@pytest.mark.parametrize("shape", [(1, 1), (5, 7), (12, 6), (3, 40)])
def test_merged_marks_have_all_bits_of_theirs(shape, step):
    rows, cols = shape
    pixels = np.random.default_rng(rows * cols).integers(0, 8, shape, np.uint8)
    expected = [
        [np.bitwise_or.reduce(pixels[r : r + step, c : c + step], axis=None) for c in starts]
        for starts in [range(0, cols, step)]
        for r in range(0, rows, step)
    ]
    assert messages.merged(pixels.tobytes(), cols, step) == np.array(expected, np.uint8).tobytes()


def test_levels_hold_all_lower_ones():
    assert [messages.FLOOR_MARKS[value] for value in (0, 1, 14, 15, 86, 100)] == [
        0,
        1,
        1,
        3,
        127,
        127,
    ]
    assert messages.FIELD_MARKS[255] == 127
    assert messages.FIELD_MARKS[1] == 1


def test_free_pixels_follow_the_daemons_thresholds():
    table = messages.map_marks(MapSettings(free_at_most=10, occupied_at_least=90))
    assert [table[value] for value in (0, 10, 11, 89, 90, 100, 101, 255)] == [
        1,
        1,
        0,
        0,
        2,
        2,
        0,
        0,
    ]
    assert messages.map_marks(MapSettings())[25] == 1


def test_a_coverage_grid_stands_in_for_a_map():
    names = ("UNKNOWN", "TO_COVER", "COVERED", "RECOVERED", "BLOCKED")
    found = [messages.COVERAGE_MARKS[CoverageValue[name] & 255] for name in names]
    assert found == [0, 1, 1, 1, 2]


def test_a_map_too_large_for_a_phone_keeps_its_walls(monkeypatch):
    monkeypatch.setattr(messages, "MOST_PIXELS", 1000)
    pixels = np.zeros((100, 90), np.int8)
    pixels[:, 41] = 100
    geometry = GridGeometry(100, 90, 0.05, Pose2D(1.0, 2.0, 0.5))
    grid = GridOctets(geometry, memoryview(pixels.tobytes()), "map")
    message = messages.grid_message("map", grid, messages.map_marks(MapSettings()))
    (length,) = struct.unpack_from("<I", message)
    head = json.loads(message[4 : 4 + length])
    body = np.frombuffer(zlib.decompress(message[4 + length :]), np.uint8)
    assert head["rows"] * head["cols"] == body.size <= 1000
    step = round(head["pixel"] / 0.05)
    assert (head["x"], head["y"], head["yaw"]) == (1.0, 2.0, 0.5)
    assert (body.reshape(head["rows"], -1)[:, 41 // step] & 2).all()


def test_a_guard_knows_its_names_and_tokens():
    guard = Guard(frozenset({"hall.local"}), (("viewer", "a" * 20), ("operator", "b" * 20)))
    assert guard.is_ours("HALL.local:8465")
    assert not guard.is_ours("hall.local.evil.example")
    assert not guard.is_ours("")
    assert guard.role_of("b" * 20) == "operator"
    assert guard.role_of("b" * 19) is None
    assert Guard(frozenset()).role_of("anything") == "viewer"
    assert is_same_origin(["https://hall.local:8465"], "hall.local:8465")
    assert not is_same_origin(["http://hall.local"], "hall.local:8465")
    assert not is_same_origin(["null"], "hall.local")
    assert not is_same_origin(["evil://hall.local"], "hall.local")
    assert not is_same_origin(["http://hall.local", "http://evil.example"], "hall.local")


def test_tokens_that_cannot_be_written_leave_no_file(tmp_path, monkeypatch):
    """An empty one would be refused at the next start."""

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(BadConfiguration, match="tokens: No space left on device"):
        read_tokens(tmp_path / "tokens")
    assert list(tmp_path.iterdir()) == []
    monkeypatch.undo()
    assert [role for role, _ in read_tokens(tmp_path / "tokens")] == ["viewer", "operator"]
    assert stat.S_IMODE((tmp_path / "tokens").stat().st_mode) == 0o600


def test_all_text_in_a_message_is_cleaned():
    message = message_text("state", name="\x1b[2J\u202e", inner=[{"\x07": "a\nb"}])
    assert json.loads(message) == {
        "kind": "state",
        "name": "\\x1b[2J\\u202e",
        "inner": [{"\\x07": "a\\nb"}],
    }
