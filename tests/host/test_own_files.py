"""A file is written where nobody has put another: no link is followed, no stranger's file taken."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from fasaco_edge.host.durable import write_through
from fasaco_edge.host.files import FileTooLongError, make_own_folder, open_own, read_own

NOBODY = 65534


def test_new_and_own_files_are_written(tmp_path: Path):
    file = tmp_path / "a"
    for payload in (b"first and longer", b"second"):
        write_through(file, payload)
        assert file.read_bytes() == payload


def test_a_link_is_not_followed(tmp_path: Path):
    (tmp_path / "shadow").write_text("root's")
    (tmp_path / "a").symlink_to(tmp_path / "shadow")
    with pytest.raises(OSError, match="symbolic link"):
        write_through(tmp_path / "a", b"x")
    assert (tmp_path / "shadow").read_text() == "root's"


def test_a_file_is_read_whole_or_refused(tmp_path: Path):
    file = tmp_path / "a"
    file.write_bytes(b"123456")
    assert read_own(file, 6) == b"123456"
    with pytest.raises(FileTooLongError, match="6 bytes, at most 5 are read"):
        read_own(file, 5)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a file away")
def test_another_users_file_is_not_taken(tmp_path: Path):
    file = tmp_path / "a"
    file.write_text("theirs")
    os.chown(file, NOBODY, NOBODY)
    with pytest.raises(PermissionError, match="another user"):
        open_own(file, os.O_WRONLY | os.O_TRUNC)
    with pytest.raises(PermissionError, match="another user"):
        read_own(file, 6)
    assert file.read_text() == "theirs"


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a folder away")
def test_another_users_folder_or_link_is_not_taken(tmp_path: Path):
    theirs, link = tmp_path / "theirs", tmp_path / "link"
    make_own_folder(theirs)
    make_own_folder(theirs)
    link.symlink_to(theirs)
    os.chown(link, NOBODY, NOBODY, follow_symlinks=False)
    os.chown(theirs, NOBODY, NOBODY)
    for folder in (theirs, link):
        with pytest.raises(PermissionError, match="another user"):
            make_own_folder(folder)
