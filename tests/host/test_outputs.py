"""Outputs: an older one stays until the new one is whole."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from fasaco_edge.host.durable import whole


def break_off(file: Path, error: BaseException) -> None:
    with whole(file) as new:
        new.write_text("half of")
        raise error


def test_a_file_that_cannot_be_written_leaves_the_one_before(tmp_path):
    file = tmp_path / "line.csv"
    file.write_text("good")
    with pytest.raises(OSError, match="full"):
        break_off(file, OSError("full"))
    assert file.read_text() == "good"
    assert os.listdir(tmp_path) == ["line.csv"]


def test_an_interrupted_first_file_leaves_nothing(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        break_off(tmp_path / "line.csv", KeyboardInterrupt())
    assert os.listdir(tmp_path) == []


def test_a_new_file_has_the_rights_of_the_one_before(tmp_path):
    file = tmp_path / "line.csv"
    for mode in (0o600, 0o664):
        file.write_text("old")
        file.chmod(mode)
        with whole(file) as new:
            new.write_text("new")
        assert file.read_text() == "new"
        assert stat.S_IMODE(file.stat().st_mode) == mode


def test_a_link_stays_one(tmp_path):
    file, link = tmp_path / "there" / "line.csv", tmp_path / "line.csv"
    file.parent.mkdir()
    link.symlink_to(file)
    for text in ("first", "second"):
        with whole(link) as new:
            assert new.suffix == ".csv"
            new.write_text(text)
        assert link.is_symlink()
        assert file.read_text() == text
    assert os.listdir(file.parent) == ["line.csv"]


def test_a_pipe_is_written_to(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        with whole(pipe) as new:
            new.write_text("said")
        assert os.read(reader, 10) == b"said"
        assert stat.S_ISFIFO(pipe.stat().st_mode)
    finally:
        os.close(reader)
