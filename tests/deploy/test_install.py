"""install.sh and uninstall.sh in a lab whose network is ``lo`` alone, as on a robot in the field.

The kernels run as plain Python there: what is tried is what is installed, not how fast it is.
"""

from __future__ import annotations

import hashlib
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.deploy import installed, releases
from tests.deploy.lab import Lab, booted, why_not

PREFIX = "/opt/fasaco-edge"
CONFIG = "/etc/fasaco-edge/config.yaml"
# Where what is installed could leave something.
WATCHED = ("/etc", "/opt", "/usr/local", "/var/lib", "/var/cache", "/var/log", "/srv/home")
DIES = """\
def run_daemon(*words, **more):
    raise RuntimeError("a screw is loose")
"""
FIRST, SECOND, BROKEN, DYING = "1.0", "1.1", "1.2", "1.3"


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    if reason := why_not() or installed.why_not():
        pytest.skip(reason)
    changes = {
        BROKEN: {"fasaco_edge/daemon/config.py": "import nothing_of_that_name\n"},
        DYING: {"fasaco_edge/daemon/service.py": DIES},
    }
    return {
        version: releases.write_release(
            tmp_path_factory.mktemp("release"), version, changes.get(version)
        )
        for version in (FIRST, SECOND, BROKEN, DYING)
    }


@pytest.fixture
def bare(folders: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lab]:
    """A lab on which nothing is installed."""
    shown = {f"/srv/{version}": folder for version, folder in folders.items()}
    with booted(tmp_path_factory.mktemp("lab"), shown | releases.binds()) as running:
        # What the machine has of it already would be taken for ours.
        running.run("sh", "-c", f"rm -rf {PREFIX} /etc/fasaco-edge /var/*/private/fasaco-edge*")
        running.run("mkdir", "/srv/home")
        running.run("systemctl", "set-environment", "NUMBA_DISABLE_JIT=1")
        yield running


@pytest.fixture
def robot(bare: Lab) -> Lab:
    """One on which the first version is installed."""
    install(bare, FIRST)
    return bare


def install(lab: Lab, version: str, *words: str, code: int = 0) -> subprocess.CompletedProcess[str]:
    done = lab.run(
        "env",
        "SETTLE_S=1",
        "HOME=/srv/home",
        f"/srv/{version}/install.sh",
        *words,
        check=False,
        timeout_s=100.0,
    )
    assert done.returncode == code, f"{done.returncode}\n{done.stdout}{done.stderr}"
    return done


def uninstall(lab: Lab, *words: str) -> str:
    return lab.run(f"{PREFIX}/current/deploy/uninstall.sh", *words).stdout


def current(lab: Lab) -> str:
    return lab.run("readlink", f"{PREFIX}/current").stdout.strip()


def is_running(lab: Lab, version: str) -> bool:
    state = lab.run("systemctl", "is-active", "fasaco-edge", check=False).stdout.strip()
    answer = lab.run("fasaco-edge", "ask", "version", check=False)
    return state == "active" and version in answer.stdout


def all_files(lab: Lab) -> dict[str, str]:
    """Return every file of the folders watched, with what it holds."""
    found = lab.run("find", *WATCHED, "-xdev", "-printf", r"%y %m %p %l\0").stdout.split("\0")
    lines = {line.split(" ", 2)[2]: line for line in found if line}
    # The journal and what others cache is theirs.
    theirs = ("/var/lib/systemd", "/var/log/journal", "/var/lib/private ")
    return {path: line for path, line in lines.items() if not path.startswith(theirs)}


def contents(lab: Lab, path: str) -> str:
    return hashlib.sha256((lab.root / path.lstrip("/")).read_bytes()).hexdigest()


def test_from_nothing_to_a_service_that_answers_and_again_is_nothing_to_do(bare):
    install(bare, FIRST)
    assert is_running(bare, FIRST)
    assert bare.run("systemctl", "is-enabled", "fasaco-edge").stdout == "enabled\n"
    assert current(bare) == FIRST
    compiled = bare.run("find", f"{PREFIX}/{FIRST}", "-name", "config.cpython-*.pyc").stdout
    assert "fasaco_edge/daemon" in compiled
    pid = bare.run("systemctl", "show", "-P", "MainPID", "fasaco-edge").stdout
    before = all_files(bare)
    assert install(bare, FIRST).stdout == f"nothing to do: version {FIRST} is installed\n"
    assert all_files(bare) == before
    assert bare.run("systemctl", "show", "-P", "MainPID", "fasaco-edge").stdout == pid


def test_an_upgrade_keeps_the_configuration_and_the_version_before(robot):
    mine = "robot: {name: maja}\nmission: {lost_pose_s: 0.0}\n"
    robot.write(CONFIG, mine)
    install(robot, SECOND)
    assert current(robot) == SECOND
    assert robot.run("cat", CONFIG).stdout == mine
    assert SECOND in robot.run("fasaco-edge", "ask", "version", "--robot", "maja").stdout
    robot.run(f"{PREFIX}/current/deploy/install.sh", "--rollback")
    assert current(robot) == FIRST
    assert robot.run("readlink", f"{PREFIX}/previous").stdout.strip() == SECOND


@pytest.mark.parametrize(
    ("version", "code", "told"),
    [
        (BROKEN, 4, "No module named 'nothing_of_that_name'"),
        (DYING, 5, "a screw is loose"),
    ],
)
def test_a_version_that_does_not_work_leaves_the_old_one_running(robot, version, code, told):
    before = all_files(robot)
    done = install(robot, version, code=code)
    assert told in done.stderr
    assert FIRST in done.stderr
    assert is_running(robot, FIRST)
    now = all_files(robot)
    kernels = "/var/cache/private/fasaco-edge/"
    assert {path for path in now.keys() ^ before.keys() if not path.startswith(kernels)} == set()


def test_a_first_version_that_does_not_come_up_leaves_no_service_behind(bare):
    done = install(bare, DYING, code=5)
    assert "a screw is loose" in done.stderr
    assert bare.run("systemctl", "is-active", "fasaco-edge", check=False).stdout != "active\n"
    assert not (bare.root / "etc/systemd/system/fasaco-edge.service").exists()
    assert not (bare.root / "opt/fasaco-edge").exists()


def test_a_configuration_that_is_wrong_is_told_before_anything_is_switched(robot):
    robot.write(CONFIG, "robot: {radius_m: -1}\n")
    done = install(robot, SECOND, code=4)
    assert "radius_m" in done.stderr
    assert current(robot) == FIRST


def test_what_is_uninstalled_leaves_what_was_written_and_purged_nothing(bare):
    before = all_files(bare)
    install(bare, FIRST)
    mine = "mission: {lost_pose_s: 0.0}\n"
    bare.write(CONFIG, mine)
    bare.run("systemctl", "restart", "fasaco-edge")
    told = uninstall(bare)
    assert "what stays" in told
    left = all_files(bare).keys() - before.keys()
    kept = ("/etc/fasaco-edge", "/var/lib/", "/var/log/")
    assert left
    assert all(path.startswith(kept) for path in left), left
    assert bare.run("cat", CONFIG).stdout == mine
    assert bare.run("systemctl", "list-units", "--all", "fasaco*", "--plain", "-q").stdout == ""
    bare.run("/srv/1.0/uninstall.sh", "--purge")
    assert all_files(bare) == before
    assert bare.run("/srv/1.0/uninstall.sh").stdout.startswith("nothing to do")


def test_a_dry_run_changes_nothing(bare):
    before = all_files(bare)
    steps = install(bare, FIRST, "--dry-run").stdout
    assert all(line.startswith("would ") for line in steps.splitlines())
    assert all_files(bare) == before
    install(bare, FIRST)
    before = all_files(bare)
    assert f"would switch from {FIRST} to {SECOND}" in install(bare, SECOND, "--dry-run").stdout
    assert "would remove /opt/fasaco-edge" in uninstall(bare, "--purge", "--dry-run")
    assert all_files(bare) == before
    assert is_running(bare, FIRST)
