"""What a process leaves behind that dies, or is refused, between two calls of the system."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fasaco_edge.daemon.ledger.codec import encode_ledger
from fasaco_edge.daemon.ledger.file import LedgerFile
from fasaco_edge.host import durable
from tests.campaigns.file_calls import Failure, Kind, Watch, why_not
from tests.support.ledgers import CELL_M, NAMES, contents, lane, load, names
from tests.support.processes import ENVIRONMENT


class Death(BaseException):
    """The end of a process, as far as the code under test can tell."""


def deaths(monkeypatch: pytest.MonkeyPatch, at: int) -> None:
    """Let the process die instead of its call number ``at`` that changes the disk."""
    count = 0

    def dying(real):
        def call(*args, **kwargs):
            nonlocal count
            count += 1
            if count > at:
                raise Death
            return real(*args, **kwargs)

        return call

    for name in ("fsync", "replace"):
        monkeypatch.setattr(os, name, dying(getattr(os, name)))
    for name in ("rename", "unlink"):
        monkeypatch.setattr(Path, name, dying(getattr(Path, name)))
    monkeypatch.setattr(durable, "open_own", dying(durable.open_own))


@pytest.mark.parametrize("at", range(6))
def test_a_crash_between_any_two_calls_leaves_a_whole_ledger(written, at):
    """By then, or as soon as the write has returned, it is the new one."""
    file = LedgerFile(written, "robot")
    with pytest.MonkeyPatch.context() as patch:
        deaths(patch, at)
        try:
            file.write(lane(5))
            returned = True
        except Death:
            returned = False
    found = load(written)
    assert found.fault is None
    assert contents(found.ledger) in (contents(lane(4)), contents(lane(5)))
    if returned or at >= 2:
        assert contents(found.ledger) == contents(lane(5))
    assert returned == (at == 5), "the test knows all calls"
    # And it goes on.
    file = LedgerFile(written, "robot")
    file.load(CELL_M)
    file.write(lane(6))
    assert contents(load(written).ledger) == contents(lane(6))
    assert names(written) == list(NAMES)


def order(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return what will be written to the disk itself and renamed, in order."""
    done: list[str] = []

    def noting(name: str, of: Callable[[Any], Path]) -> Callable[..., Any]:
        real = getattr(os, name)

        def call(*args: Any) -> Any:
            done.append(f"{name} {of(args[0]).name}")
            return real(*args)

        return call

    opened = noting("fsync", lambda fd: Path(f"/proc/self/fd/{fd}").readlink())
    monkeypatch.setattr(os, "fsync", opened)
    monkeypatch.setattr(os, "replace", noting("replace", Path))
    return done


def test_no_name_moves_on_before_the_bytes_are_on_the_disk(tmp_path, monkeypatch):
    """A loss of power forgets what was not synchronised: bytes, names, and folders."""
    done = order(monkeypatch)
    file = LedgerFile(tmp_path / "var" / "state", "robot")
    file.write(lane(1))
    new = ["fsync robot.ledger.new", "replace robot.ledger.new", "fsync state"]
    assert done == [f"fsync {tmp_path.name}", "fsync var", *new]
    done.clear()
    file.write(lane(2))
    assert done == [new[0], "replace robot.ledger", *new[1:]]
    done.clear()
    file.set_aside("fresh")
    assert done == ["fsync state"]


def test_a_disk_that_cannot_synchronise_folders_does_without(written, monkeypatch):
    real = os.fsync

    def failing(descriptor: int) -> None:
        if stat.S_ISDIR(os.fstat(descriptor).st_mode):
            raise OSError(errno.EINVAL, "Invalid argument")
        real(descriptor)

    monkeypatch.setattr(os, "fsync", failing)
    LedgerFile(written, "robot").write(lane(5))
    assert contents(load(written).ledger) == contents(lane(5))


@pytest.mark.parametrize("at", range(4))
def test_a_crash_while_finishing_a_cut_write_does_no_harm(written, at):
    (written / "robot.ledger.new").write_bytes(encode_ledger(lane(5)))
    with pytest.MonkeyPatch.context() as patch:
        deaths(patch, at)
        with contextlib.suppress(Death):
            load(written)
    assert contents(load(written).ledger) == contents(lane(5))


def test_half_a_new_one_is_no_fault(written):
    (written / "robot.ledger.new").write_bytes(encode_ledger(lane(5))[:-1])
    found = load(written)
    assert (contents(found.ledger), found.fault) == (contents(lane(4)), None)


LOADS = """
import pathlib, sys
from tests.support.ledgers import load, visits_of
found = load(pathlib.Path(sys.argv[1]))
print(len(visits_of(found.ledger)), found.fault)
"""


@pytest.mark.skipif(bool(why_not()), reason=why_not())
@pytest.mark.parametrize("moved", [False, True])
def test_an_unreadable_new_ledger_is_reported_and_kept(written, moved):
    """It may be the newest whole one: the process died before it had its name."""
    (written / "robot.ledger.new").write_bytes(encode_ledger(lane(5)))
    if moved:
        (written / "robot.ledger").replace(written / "robot.ledger.previous")
    with Watch([written], Failure(Kind.OPEN, 1, "EIO")) as watch:
        environment = ENVIRONMENT | watch.environment
        command = [sys.executable, "-c", LOADS, str(written)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    told = "resumed from the previous ledger (robot.ledger.new: Input/output error)"
    assert done.stdout.startswith(f"4 {told}; kept as robot.ledger.new.broken-"), done.stdout
    (kept,) = written.glob("robot.ledger.new.broken-*")
    assert kept.read_bytes() == encode_ledger(lane(5))


@pytest.mark.parametrize("call", ["fsync", "replace"])
@pytest.mark.parametrize("nth", [1, 2])
def test_an_error_of_the_disk_loses_nothing(written, monkeypatch, call, nth):
    """It is raised; what was there stays; and the next try, of a newer ledger, succeeds."""
    file, calls, real = LedgerFile(written, "robot"), [], getattr(os, call)

    def failing(*args):
        calls.append(args)
        if len(calls) == nth:
            raise OSError(errno.EIO, "Input/output error")
        return real(*args)

    monkeypatch.setattr(os, call, failing)
    with pytest.raises(OSError, match="Input/output error"):
        file.write(lane(5))
    assert contents(load(written).ledger) in (contents(lane(4)), contents(lane(5)))
    monkeypatch.setattr(os, call, real)
    file.write(lane(6))
    assert contents(load(written).ledger) == contents(lane(6))
    assert names(written) == list(NAMES)


def test_a_complete_newest_ledger_is_not_overwritten(written, monkeypatch):
    """Its name could not be changed: it is, before the next one takes its place."""
    file, real = LedgerFile(written, "robot"), os.replace

    def failing(source, target):
        if str(source).endswith(".new"):
            raise OSError(errno.EIO, "Input/output error")
        real(source, target)

    monkeypatch.setattr(os, "replace", failing)
    with pytest.raises(OSError, match="Input/output error"):
        file.write(lane(5))
    with pytest.raises(OSError, match="Input/output error"):
        file.write(lane(6))
    monkeypatch.setattr(os, "replace", real)
    assert contents(load(written).ledger) == contents(lane(5))
