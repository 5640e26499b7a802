"""Whatever the moment at which the power goes, an installation leaves the old or the new."""

from __future__ import annotations

import shutil

import pytest

from tests.campaigns.install_calls import CALLS, PREFIX, SETTINGS, STRACE, Installation, calls_of
from tests.deploy import installed, releases
from tests.deploy.installing import bare_robot
from tests.deploy.lab import why_not

LOG = "/run/calls"


def taken(*calls: str) -> Installation:
    seen = Installation()
    for call in calls:
        seen.take(call)
    return seen


WRITTEN = f'openat(AT_FDCWD</>, "{SETTINGS}/a.part", O_WRONLY|O_CREAT) = 3<{SETTINGS}/a.part>'
NAMED = f'renameat2(AT_FDCWD</>, "{SETTINGS}/a.part", AT_FDCWD</>, "{SETTINGS}/config.yaml", 0) = 0'
SYNCED = f"fsync(3<{SETTINGS}/a.part>) = 0"


def test_a_name_that_counts_before_the_bytes_are_there_is_found():
    assert taken(WRITTEN, NAMED).wrong == [f"{SETTINGS}/config.yaml has its name, and may be empty"]
    assert taken(WRITTEN, SYNCED, NAMED).wrong == []
    assert taken(WRITTEN, SYNCED, NAMED).left() == [f"{SETTINGS}/config.yaml"]
    assert taken(WRITTEN, SYNCED, NAMED, f"fsync(3<{SETTINGS}>) = 0").left() == []


def test_a_version_is_on_disk_before_it_is_marked_complete():
    file = f'openat(AT_FDCWD</>, "{PREFIX}/1.0/x.py", O_WRONLY|O_CREAT) = 4<{PREFIX}/1.0/x.py>'
    mark = f'rename("{PREFIX}/1.0/M", "{PREFIX}/1.0/INSTALLED") = 0'
    assert len(taken(file, mark).wrong) == 1
    assert taken(file, f"syncfs(3<{PREFIX}/1.0>) = 0", mark).wrong == []


def test_calls_of_several_processes_come_in_pieces():
    lines = [
        '12 rename("a", <unfinished ...>\n',
        "13 sync() = 0\n",
        '12 <... rename resumed>"b") = 0\n',
    ]
    assert list(calls_of(lines)) == ["sync() = 0", 'rename("a","b") = 0']


def test_an_installation_is_there_or_not(tmp_path_factory):
    if reason := why_not() or installed.why_not():
        pytest.skip(reason)
    if shutil.which("strace") is None:
        pytest.skip("strace is not installed")
    versions = ("1.0", "1.1")
    folders = {
        version: releases.write_release(tmp_path_factory.mktemp("release"), version)
        for version in versions
    }
    with bare_robot(tmp_path_factory.mktemp("lab"), folders) as robot:
        installed.warm(robot)
        for version in versions:
            words = ("env", "SETTLE_S=1", *STRACE, CALLS, "-o", LOG, f"/srv/{version}/install.sh")
            robot.run(*words, timeout_s=600.0)
            seen = Installation()
            with (robot.root / LOG.lstrip("/")).open(errors="replace") as log:
                for call in calls_of(log):
                    seen.take(call)
            assert f"{PREFIX}/{version}/INSTALLED" in seen.counted, "the calls were seen"
            assert f"{PREFIX}/current" in seen.counted
            assert (seen.wrong, seen.left()) == ([], [])
