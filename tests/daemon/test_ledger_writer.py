"""The thread that writes: it never holds anybody up, and gives up nothing."""

from __future__ import annotations

import errno
import logging
import os
import shutil
import subprocess
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import asdict

from fasaco_edge.daemon.ledger import disk_writer
from fasaco_edge.daemon.ledger.codec import decode_ledger, encode_ledger
from fasaco_edge.daemon.ledger.disk_writer import HANGS_S
from fasaco_edge.daemon.ledger.file import LedgerFile
from fasaco_edge.daemon.ledger.writer import (
    FLOOR_PERIOD_S,
    PERIOD_S,
    LedgerKeeper,
    LedgerWriter,
    open_ledger,
)
from fasaco_edge.errors import LedgerFileError, LedgerMismatchError
from fasaco_edge.mission.coverage.floor_tiles import NO_FLOOR
from fasaco_edge.mission.orders.keep_outs import KeepOut
from fasaco_edge.mission.work.order_state import NO_ORDER, OrderState
from tests.mission.world import CELL, Drive, MapReceived, building, pose_at
from tests.support.disks import disk_fixture
from tests.support.ledgers import CELL_M, contents, lane
from tests.support.waiting import until

DEADLINE_S = 60.0
small_disk = disk_fixture("256k")


def on_disk(folder: Path, cell_m: float = CELL_M) -> object:
    """Return what the newest holds; changes nothing, as the writer may be at work."""
    try:
        payload = (folder / "robot.ledger").read_bytes()
    except FileNotFoundError:
        return None
    return contents(decode_ledger(payload, cell_m))


def document(writer: LedgerWriter) -> dict[str, Any]:
    return asdict(writer.report(time.monotonic()))


@pytest.fixture
def retry_soon(monkeypatch):
    monkeypatch.setattr(disk_writer, "RETRY_S", 0.05)


def test_a_folder_that_cannot_be_made_is_reported_at_the_start(tmp_path):
    folder = tmp_path / "state"
    folder.write_text("in the way")
    writer = open_ledger(folder, "robot", CELL_M)
    assert f"cannot write {folder / 'robot.ledger'}: " in document(writer)["fault"]
    assert len(writer.disk.take_faults()) == 1
    folder.unlink()
    writer.put(lane(1))
    until(lambda: document(writer)["fault"] is None)
    writer.disk.close(1.0)


def test_a_read_only_disk_is_reported_at_the_start(small_disk):
    (small_disk / "robot.ledger.lock").touch()
    subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=True)
    writer = open_ledger(small_disk, "robot", CELL_M)
    assert "Read-only file system: progress is kept in memory" in document(writer)["fault"]
    subprocess.run(["mount", "-o", "remount,rw", str(small_disk)], check=True)
    writer.put(lane(1))
    until(lambda: document(writer)["fault"] is None)
    writer.disk.close(1.0)


def test_a_snapshot_that_is_put_is_written(tmp_path):
    writer = open_ledger(tmp_path, "robot", CELL_M)
    assert writer.restored is None
    path = str(tmp_path / "robot.ledger")
    assert document(writer) == {"path": path, "age_s": None, "restored_cells": 0, "fault": None}
    writer.put(lane(3))
    until(lambda: document(writer)["age_s"] is not None)
    assert on_disk(tmp_path) == contents(lane(3))
    assert 0 <= document(writer)["age_s"] < DEADLINE_S
    writer.disk.close(1.0)
    assert document(writer)["fault"] is None
    assert writer.disk.take_faults() == []


def test_the_last_thing_put_is_on_disk_when_it_is_closed(tmp_path):
    writer = open_ledger(tmp_path, "robot", CELL_M)
    for length in range(1, 50):
        writer.put(lane(length))
    writer.disk.close(5.0)
    assert on_disk(tmp_path) == contents(lane(49))


def test_a_fault_on_disk_is_reported(tmp_path, caplog):
    LedgerFile(tmp_path, "robot").write(lane(7))
    (tmp_path / "robot.ledger").write_bytes(b"torn")
    writer = open_ledger(tmp_path, "robot", CELL_M)
    (fault,) = writer.disk.take_faults()
    assert isinstance(fault, LedgerFileError)
    assert writer.disk.take_faults() == []
    writer.put(lane(1))
    until(lambda: document(writer)["age_s"] is not None)
    # It is still worth knowing after all is well again.
    assert document(writer)["fault"] == f"{fault}: {fault.hint}"
    assert str(fault) in caplog.text
    writer.disk.close(1.0)


def test_another_ledger_never_overwrites_the_one_kept_aside(tmp_path):
    LedgerFile(tmp_path, "robot").write(lane(7))
    writer = open_ledger(tmp_path, "robot", CELL_M)
    writer.put(lane(8))
    writer.begin_anew(LedgerMismatchError("of another building"), "mismatch")
    writer.put(lane(2))
    writer.disk.close(5.0)
    assert on_disk(tmp_path) == contents(lane(2))
    aside = tmp_path / "aside"
    aside.mkdir()
    for path in tmp_path.glob("*.mismatch-*"):
        path.rename(aside / path.name.partition(".mismatch-")[0])
    # What still waited was of the old building, and may be written or not.
    assert on_disk(aside) in (contents(lane(7)), contents(lane(8)))
    assert document(writer)["restored_cells"] == 0
    assert document(writer)["fault"].startswith("of another building: it was renamed")


def test_each_new_beginning_keeps_what_there_was_until_then(tmp_path, caplog):
    writer = open_ledger(tmp_path, "robot", CELL_M)
    for length in (3, 5):
        writer.put(lane(length))
        until(lambda length=length: on_disk(tmp_path) == contents(lane(length)))
        writer.begin_anew(LedgerMismatchError("of another building"), "mismatch")
        until(lambda: not (tmp_path / "robot.ledger").exists())
    writer.disk.close(1.0)
    aside = sorted(path.read_bytes() for path in tmp_path.glob("robot.ledger.mismatch-*"))
    assert aside == sorted(encode_ledger(lane(length)) for length in (3, 5))
    assert caplog.text.count("the previous ledger is kept as robot.ledger.mismatch-") == 2


def test_a_failing_disk_is_reported_once_and_retried(tmp_path, monkeypatch, caplog, retry_soon):
    caplog.set_level(logging.INFO)
    tries, real = [], os.fsync

    def failing(descriptor: int) -> None:
        tries.append(time.monotonic())
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", failing)
    writer = open_ledger(tmp_path, "robot", CELL_M)
    writer.put(lane(3))
    until(lambda: len(tries) >= 4)
    told = document(writer)["fault"]
    assert f"cannot write {tmp_path / 'robot.ledger'}: No space left on device" in told
    assert "kept in memory, and writing is retried" in told
    assert caplog.text.count("No space left") == 1
    assert len(writer.disk.take_faults()) == 1
    assert min(b - a for a, b in pairwise(tries)) >= 0.05, "no busy loop"
    writer.put(lane(4))
    monkeypatch.setattr(os, "fsync", real)
    until(lambda: document(writer)["fault"] is None)
    assert on_disk(tmp_path) == contents(lane(4))
    assert "written again" in caplog.text
    writer.disk.close(1.0)


def test_new_ledgers_do_not_make_a_failing_disk_busy(tmp_path, monkeypatch):
    tries = []

    def failing(descriptor: int) -> None:
        tries.append(descriptor)
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(disk_writer, "RETRY_S", 600.0)
    writer = open_ledger(tmp_path, "robot", CELL_M)
    monkeypatch.setattr(os, "fsync", failing)
    for length in range(1, 60):
        writer.put(lane(length))
        time.sleep(0.005)
    assert len(tries) == 1
    # One last try, then it ends.
    writer.disk.close(60.0)
    assert len(tries) == 2


def test_set_aside_comes_first_also_after_failures(tmp_path, monkeypatch, retry_soon):
    LedgerFile(tmp_path, "robot").write(lane(7))
    tries = []

    def failing(*_):
        tries.append(1)
        raise OSError(errno.EROFS, "Read-only file system")

    writer = open_ledger(tmp_path, "robot", CELL_M)
    with monkeypatch.context() as patch:
        patch.setattr(Path, "rename", failing)
        writer.begin_anew(LedgerMismatchError("of another building"), "mismatch")
        writer.put(lane(2))
        until(lambda: len(tries) >= 3)
        assert on_disk(tmp_path) == contents(lane(7))
    until(lambda: on_disk(tmp_path) == contents(lane(2)))
    writer.disk.close(1.0)
    assert list(tmp_path.glob("robot.ledger.mismatch-*"))


def test_a_hanging_disk_does_not_block_the_caller(tmp_path, caplog, retry_soon):
    """Who opens a pipe to write waits for a reader, as for a disk that does not answer."""
    writer = open_ledger(tmp_path, "robot", CELL_M)
    pipe = tmp_path / "robot.ledger.new"
    os.mkfifo(pipe)
    # The pipe never gets a reader: whoever waited for it would wait for ever.
    for length in range(1, 10):
        writer.put(lane(length))
        document(writer)
    # Its thread may begin to write after all that.
    until(lambda: writer.report(time.monotonic() + HANGS_S).fault is not None)
    report = writer.report(time.monotonic() + 2 * HANGS_S)
    assert "the disk has hung for 10 s or more" in str(report.fault)
    assert len(writer.disk.take_faults()) == 1
    writer.disk.close(0.1)
    assert "the disk is too slow" in caplog.text
    os.close(os.open(pipe, os.O_RDONLY | os.O_NONBLOCK))  # so that the thread can end


def test_floor_swept_between_two_cells_is_written_once_a_second(tmp_path):
    drive = Drive((0, 0), MapReceived(building("....")), pose_at(0, 0))
    writer = open_ledger(tmp_path, "robot", CELL)
    keeper = LedgerKeeper(writer, CELL, autostart=True)

    def is_written():
        return on_disk(tmp_path, CELL) == contents(drive.mission.snapshot())

    keeper.keep(drive.mission, 0.0)
    until(lambda: is_written() and not writer.disk.is_behind())
    visits = drive.mission.covered.current.total
    drive.tell(pose_at(0, 0.2))
    assert drive.mission.covered.current.total == visits
    keeper.keep(drive.mission, PERIOD_S)
    assert not writer.disk.is_behind()
    assert not is_written()
    keeper.keep(drive.mission, FLOOR_PERIOD_S)
    until(is_written)
    # A cell does not wait for it.
    drive.tell(pose_at(0, 1))
    keeper.keep(drive.mission, FLOOR_PERIOD_S + PERIOD_S)
    until(is_written)
    writer.disk.close(1.0)


def test_time_of_a_paused_robot_is_written_twice_a_minute(tmp_path):
    drive = Drive((0, 0), MapReceived(building("....")), pose_at(0, 0))
    drive.command("start", {"until_min": 5.0})
    drive.command("pause")
    writer = open_ledger(tmp_path, "robot", CELL)
    keeper = LedgerKeeper(writer, CELL, autostart=False)

    def kept_s():
        keeper.keep(drive.mission, drive.now)
        until(lambda: not writer.disk.is_behind())
        return OrderState.from_json(LedgerFile(tmp_path, "robot").load(CELL).ledger.note).spent_s

    first_s = kept_s()
    drive.tell(after=10.0)
    assert kept_s() == first_s
    drive.tell(after=25.0)
    assert kept_s() == pytest.approx(first_s + 35.0)
    writer.disk.close(1.0)


def test_floor_without_covered_cells_is_restored(tmp_path):
    """A robot that never came over the middle of a cell."""
    first = Drive((0, 0), MapReceived(building("....")), pose_at(0.45, 0.45))
    snapshot = first.mission.snapshot()
    assert not snapshot.cells
    LedgerFile(tmp_path, "robot").write(snapshot)
    writer = open_ledger(tmp_path, "robot", CELL)
    drive = Drive((0, 0))
    LedgerKeeper(writer, CELL, autostart=True).restore(drive.mission, drive.mission.rooms)
    assert drive.mission.covered.floor.pixels == snapshot.floor.pixels > 0
    writer.disk.close(1.0)


@pytest.mark.parametrize("change", ["fresh", "another tool, no floor"])
def test_starting_over_keeps_the_keep_outs(tmp_path, caplog, change):
    """Progress is set aside, as it was asked for, or as cells are others; keep-outs are not."""
    caplog.set_level("INFO")
    vase = KeepOut("vase", ((0.9, 0.9), (2.1, 0.9), (2.1, 2.1)))
    note = replace(OrderState.idle(NO_ORDER), keep_out=(vase,)).to_json()
    begun, again = tmp_path / "begun", tmp_path / "again"
    LedgerFile(begun, "robot").write(replace(lane(5), note=note, floor=NO_FLOOR))
    is_fresh, cell_m = change == "fresh", CELL_M if change == "fresh" else 0.4
    for folder, fresh in ((begun, is_fresh), (again, False)):
        writer = open_ledger(folder, "robot", cell_m, fresh=fresh)
        assert document(writer)["restored_cells"] == 0
        # A robot that waits for orders gets one; then its configuration is changed.
        for autostart in (False, True):
            state = LedgerKeeper(writer, cell_m, autostart=autostart).order_state
            assert (state.keep_out, state.automatic) == ((vase,), autostart)
        until(lambda writer=writer: not writer.disk.is_behind())
        if folder == begun:
            shutil.copytree(begun, again)  # killed before anything was covered
        writer.disk.close(1.0)
    assert caplog.text.count("keep-outs that were added stay: vase") == 1
