"""Two generations on disk: whatever breaks, one of them is whole, and nothing is thrown away."""

from __future__ import annotations

import errno
import fcntl
import os
import re
import shutil
import time
from dataclasses import replace
from pathlib import Path

import pytest

from fasaco_edge.daemon.ledger.codec import MOST_BYTES, decode_ledger, encode_ledger
from fasaco_edge.daemon.ledger.file import KEPT_ASIDE, LedgerFile
from fasaco_edge.errors import LedgerFileError, LedgerMismatchError
from fasaco_edge.mission.coverage.floor_tiles import NO_FLOOR
from tests.daemon.test_ledger_codec import enveloped
from tests.support.ledgers import CELL_M, NAMES, contents, driven, lane, load, names, visits_of


def test_an_absent_folder_holds_no_ledger(tmp_path):
    found = load(tmp_path / "not yet")
    assert (found.ledger, found.fault) == (None, None)
    assert not (tmp_path / "not yet").exists()


def test_the_newest_is_found_and_the_one_before_kept(written):
    assert names(written) == list(NAMES)
    assert contents(load(written).ledger) == contents(lane(4))
    assert load(written).fault is None
    assert (written / NAMES[1]).read_bytes() == encode_ledger(lane(3))


def test_a_file_cut_at_any_byte_falls_back_to_the_one_before(written):
    newest = written / NAMES[0]
    whole, before = newest.read_bytes(), (written / NAMES[1]).read_bytes()
    for length in range(len(whole)):
        newest.write_bytes(whole[:length])
        found = load(written)
        assert contents(found.ledger) == contents(lane(3))
        assert isinstance(found.fault, LedgerFileError)
        assert str(found.fault).startswith("resumed from the previous ledger (robot.led")
        assert "check the disk" in found.fault.hint
        (aside,) = set(names(written)) - set(NAMES)
        assert aside.startswith("robot.ledger.broken-")
        assert aside in str(found.fault)
        assert (written / aside).read_bytes() == whole[:length]
        assert (written / NAMES[1]).read_bytes() == before
        (written / aside).unlink()


def test_after_a_fall_back_the_old_ledger_stays_until_the_next(written):
    (written / NAMES[0]).write_bytes(b"torn")
    file = LedgerFile(written, "robot")
    file.load(CELL_M)
    file.write(lane(5))
    assert contents(load(written).ledger) == contents(lane(5))
    assert (written / NAMES[1]).read_bytes() == encode_ledger(lane(3))


def test_a_missing_newest_ledger_is_reported(written):
    (written / NAMES[0]).unlink()
    found = load(written)
    assert contents(found.ledger) == contents(lane(3))
    assert "no robot.ledger" in str(found.fault)


def test_two_broken_ledgers_are_reported_and_kept(written):
    for name in NAMES:
        (written / name).write_bytes(b"torn " + name.encode())
    found = load(written)
    assert found.ledger is None
    assert isinstance(found.fault, LedgerFileError)
    for said in (
        "robot.ledger: torn",
        "robot.ledger.previous: not a ledger",
        "a new one was started",
        "kept as",
    ):
        assert said in str(found.fault)
    kept = {path.read_bytes() for path in written.iterdir()}
    assert kept == {b"torn robot.ledger", b"torn robot.ledger.previous"}
    assert not set(names(written)) & set(NAMES)
    assert load(written).fault is None


def test_a_folder_in_place_of_the_ledger_is_kept_aside(written):
    (written / NAMES[0]).unlink()
    (written / NAMES[0]).mkdir()
    file = LedgerFile(written, "robot")
    found = file.load(CELL_M)
    assert contents(found.ledger) == contents(lane(3))
    assert "no plain file" in str(found.fault)
    file.write(lane(6))
    assert contents(load(written).ledger) == contents(lane(6))


@pytest.mark.parametrize("make", [Path.mkdir, os.mkfifo])
def test_a_non_file_in_place_of_a_new_ledger_is_replaced(written, make):
    make(written / "robot.ledger.new")
    found = load(written)
    assert contents(found.ledger) == contents(lane(4))
    assert "robot.ledger.new: no plain file" in str(found.fault)
    LedgerFile(written, "robot").write(lane(6))
    assert contents(load(written).ledger) == contents(lane(6))


def test_a_pipe_in_place_of_the_lock_does_not_block(tmp_path):
    os.mkfifo(tmp_path / "robot.ledger.lock")
    first, second = LedgerFile(tmp_path, "robot"), LedgerFile(tmp_path, "robot")
    first.lock()
    with pytest.raises(LedgerFileError, match="another daemon"):
        second.lock()


@pytest.mark.parametrize(
    ("make", "kind"),
    [(Path.mkdir, "a folder"), (lambda path: path.symlink_to("nowhere"), "a link")],
)
def test_a_non_file_in_place_of_the_lock_is_reported(tmp_path, make, kind):
    """That the ledger could not be opened was said, not what lay there."""
    lock = tmp_path / "robot.ledger.lock"
    make(lock)
    file = LedgerFile(tmp_path, "robot")
    file.lock()
    with pytest.raises(OSError, match=f"{kind} lies in place of {lock}: remove it"):
        file.write(lane(4))
    assert os.path.lexists(lock)
    lock.rmdir() if kind == "a folder" else lock.unlink()
    file.write(lane(4))
    assert contents(load(tmp_path).ledger) == contents(lane(4))


def test_a_lock_that_was_deleted_is_taken_again(tmp_path):
    folder = tmp_path / "state"
    first, second = LedgerFile(folder, "robot"), LedgerFile(folder, "robot")
    first.lock()
    first.write(lane(3))
    shutil.rmtree(folder)
    first.write(lane(4))
    with pytest.raises(LedgerFileError, match="another daemon"):
        second.lock()


def test_nothing_kept_aside_overwrites_another(written):
    for count in range(4):
        (written / NAMES[0]).write_bytes(bytes([count]))
        load(written)
    aside = [path.read_bytes() for path in written.iterdir() if "broken" in path.name]
    assert sorted(aside) == [bytes([count]) for count in range(4)]


@pytest.mark.parametrize(
    ("newest", "said"),
    [
        (
            encode_ledger(replace(driven((0, 0), cell_m=0.5), floor=NO_FLOOR)),
            r"are 0\.5 m wide, the configuration's 0\.3",
        ),
        (None, "version 7"),
    ],
)
def test_a_ledger_of_something_else_is_kept_and_not_overwritten(written, newest, said):
    if newest is None:
        newest = enveloped(b"?", version=7)
    (written / NAMES[0]).write_bytes(newest)
    file = LedgerFile(written, "robot")
    found = file.load(CELL_M)
    assert found.ledger is None
    assert isinstance(found.fault, LedgerMismatchError)
    assert re.search(said, str(found.fault))
    assert "to continue with it" in found.fault.hint
    file.write(lane(1))
    kept = {path.read_bytes() for path in written.iterdir() if "mismatch" in path.name}
    assert kept == {newest, encode_ledger(lane(3))}
    assert contents(load(written).ledger) == contents(lane(1))


def test_a_ledger_set_aside_is_complete(written):
    file = LedgerFile(written, "robot")
    kept = file.set_aside("fresh")
    assert sorted(kept) == names(written)
    assert all(".fresh-" in name for name in kept)
    assert load(written).ledger is None
    # Renamed back, it is there again.
    for name in kept:
        (written / name).rename(written / name.partition(".fresh-")[0])
    assert contents(load(written).ledger) == contents(lane(4))


def test_an_impossible_folder_does_not_prevent_the_start(tmp_path):
    (tmp_path / "file").write_text("not a folder")
    file = LedgerFile(tmp_path / "file", "robot")
    file.lock()
    assert file.load(CELL_M).ledger is None
    with pytest.raises(OSError, match=r"exists|Not a directory"):
        file.write(lane(1))


def test_a_ledger_that_appears_later_is_not_overwritten(tmp_path, written):
    """The disk with the ledger on it is mounted after the daemon has looked for it."""
    folder = tmp_path / "mounted late"
    file = LedgerFile(folder, "robot")
    file.lock()
    assert file.load(CELL_M).ledger is None
    folder.mkdir(exist_ok=True)
    for name in NAMES:
        shutil.copy(written / name, folder)
    kept = file.write(lane(1))
    assert sorted(name.partition(".unread-")[0] for name in kept) == list(NAMES)
    assert {(folder / name).read_bytes() for name in kept} == {
        (written / name).read_bytes() for name in NAMES
    }
    assert contents(load(folder).ledger) == contents(lane(1))
    assert file.write(lane(2)) == []


def test_a_folder_that_appears_later_is_locked_before_a_write(tmp_path):
    folder = tmp_path / "later"
    folder.write_text("in the way")
    first, second = LedgerFile(folder, "robot"), LedgerFile(folder, "robot")
    first.lock()
    second.lock()
    folder.unlink()
    first.write(lane(1))
    with pytest.raises(LedgerFileError, match="another daemon uses the ledger"):
        second.write(lane(2))
    first.write(lane(3))
    assert contents(load(folder).ledger) == contents(lane(3))


def test_a_disk_without_locks_is_written_nevertheless(tmp_path, monkeypatch):
    def failing(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", failing)
    file = LedgerFile(tmp_path, "robot")
    file.lock()
    file.write(lane(1))
    assert contents(load(tmp_path).ledger) == contents(lane(1))


def test_a_file_too_large_is_not_read_but_kept(written):
    newest = written / NAMES[0]
    with newest.open("ab") as file:
        file.truncate(10**9)
    found = load(written)
    assert contents(found.ledger) == contents(lane(3))
    assert f"bytes, at most {MOST_BYTES} are read" in str(found.fault)
    (aside,) = set(names(written)) - set(NAMES)
    assert (written / aside).stat().st_size == 10**9


def test_the_newest_and_largest_ledgers_set_aside_are_kept(tmp_path):
    """As two hundred resets make them, the first of a whole day's work."""
    file = LedgerFile(tmp_path, "robot")
    for length in [400, *[3 + number % 3 for number in range(30)], 20]:
        file.write(lane(length))
        file.set_aside("reset")
    kept = [
        len(visits_of(decode_ledger(path.read_bytes(), CELL_M)))
        for path in sorted(tmp_path.glob("*.reset-*"))
    ]
    assert len(kept) == KEPT_ASIDE + 1
    assert {400, 20} <= set(kept)
    assert names(tmp_path) == sorted(path.name for path in tmp_path.glob("*.reset-*"))


def test_an_empty_ledger_is_not_kept(tmp_path):
    file = LedgerFile(tmp_path, "robot")
    for length in (3, 0, 0):
        file.write(lane(length))
    assert file.set_aside("reset") == []
    assert names(tmp_path) == []


def test_the_number_not_the_clock_gives_the_age_of_a_set_aside(tmp_path, monkeypatch):
    path = tmp_path / "robot.ledger"
    years = iter([2026, 2027, 2026, 1970, 1970, 1970])
    monkeypatch.setattr(time, "gmtime", lambda: (next(years), 1, 1, 0, 0, 0, 3, 1, 0))
    names = []
    for _ in range(6):
        path.write_bytes(b"broken")
        names += LedgerFile(tmp_path, "robot").set_aside("reset")
    assert len(set(names)) == 6
    kept = {file.name for file in tmp_path.glob("robot.ledger.reset-*")}
    assert set(names[-3:]) <= kept
    assert len(kept) <= 4
