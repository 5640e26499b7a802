"""Only what root or the user alone could have put in place is trusted."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest

from fasaco_edge.host.files import UntrustedFileError, read_trusted, why_not_trusted
from tests.kernels.harm import NOBODY, needs_root


@pytest.fixture
def folder(tmp_path):
    made = tmp_path / "above" / "folder"
    made.mkdir(parents=True, mode=0o700)
    made.parent.chmod(0o700)
    return made


def test_an_own_folder_without_other_writers_is_trusted(folder):
    assert why_not_trusted(folder) == ""
    folder.chmod(0o755)
    assert why_not_trusted(folder) == ""


def test_a_missing_folder_is_judged_by_its_parents(folder):
    assert why_not_trusted(folder / "later" / "still") == ""
    folder.chmod(0o777)
    assert why_not_trusted(folder / "later") == f"{folder} may be written by all users"


@pytest.mark.parametrize(("mode", "who"), [(0o770, "its group"), (0o702, "all users")])
def test_a_folder_that_others_may_write_is_not(folder, mode, who):
    folder.chmod(mode)
    assert why_not_trusted(folder) == f"{folder} may be written by {who}"
    folder.chmod(0o700)
    # Who may write above it could put another one in its place.
    folder.parent.chmod(mode)
    assert why_not_trusted(folder) == f"{folder.parent} may be written by {who}"


def test_a_sticky_folder_protects_its_subfolders_but_not_itself(folder):
    folder.parent.chmod(0o1777)
    assert why_not_trusted(folder) == ""
    assert why_not_trusted(folder.parent) == f"{folder.parent} may be written by all users"


def test_folders_of_root_are_trusted():
    assert why_not_trusted(Path("/usr"), os.geteuid() + 1) == ""


@needs_root
def test_a_parent_of_another_user_is_not_trusted(folder):
    os.chown(folder.parent, NOBODY, NOBODY)
    assert why_not_trusted(folder).startswith(f"{folder.parent} belongs to user ")
    # Of a service's user all is as it should be.
    assert why_not_trusted(folder, NOBODY) == ""
    assert why_not_trusted(folder, NOBODY + 1) != ""


@needs_root
def test_a_link_is_judged_by_its_owner_and_its_target(folder):
    link = folder / "link"
    real = folder / "real"
    real.mkdir(0o700)
    for target in ("real", str(real), "../folder/real", f"{folder}/../folder/real/."):
        link.unlink(missing_ok=True)
        link.symlink_to(target)
        assert why_not_trusted(link) == "", target
        os.chown(link, NOBODY, NOBODY, follow_symlinks=False)
        assert why_not_trusted(link / "more").startswith(f"{link} is a link of user "), target
    link.unlink()
    link.symlink_to(real)
    real.chmod(0o777)
    assert why_not_trusted(link) == f"{real} may be written by all users"


def test_loops_of_links_and_files_in_the_way_are_named(folder):
    (folder / "circle").symlink_to("circle")
    assert "too many links" in why_not_trusted(folder / "circle" / "x")
    (folder / "file").touch()
    for below in ("file", "file/x"):
        assert why_not_trusted(folder / below) == f"{folder / 'file'} is no folder"


def test_our_folder_in_the_real_temporary_folder_is_trusted():
    with tempfile.TemporaryDirectory(dir="/tmp") as made:
        assert why_not_trusted(Path(made)) == ""


@pytest.mark.parametrize("mode", [0o400, 0o600, 0o644])
def test_a_file_that_others_may_only_read_is_read(folder, mode):
    file = folder / "file"
    file.write_bytes(b"content")
    file.chmod(mode)
    assert read_trusted(file) == b"content"


def test_a_file_that_others_may_write_is_not_read(folder):
    file = folder / "file"
    file.write_bytes(b"content")
    for mode, who in ((0o620, "its group"), (0o602, "all users")):
        file.chmod(mode)
        with pytest.raises(UntrustedFileError, match=f"may be written by {who}"):
            read_trusted(file)


def test_pipes_folders_and_links_are_refused_at_once(folder):
    os.mkfifo(folder / "pipe", 0o600)
    (folder / "folder").mkdir()
    for name in ("pipe", "folder"):
        with pytest.raises(UntrustedFileError, match="no plain file"):
            read_trusted(folder / name)
    (folder / "link").symlink_to("/etc/hostname")
    with pytest.raises(OSError, match="symbolic links"):
        read_trusted(folder / "link")
