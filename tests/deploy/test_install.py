"""install.sh and uninstall.sh on a robot whose network is ``lo`` alone.

All but the first two share one robot; each leaves it as it was, with the first version running, and
the last uninstalls it.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.deploy import installed, releases
from tests.deploy.installing import CONFIG, PREFIX, Robot, bare_robot
from tests.deploy.lab import why_not

DIES = """\
def run_daemon(*words, **more):
    raise RuntimeError("a screw is loose")
"""
FIRST, SECOND, BROKEN, DYING = "1.0", "1.1", "1.2", "1.3"
# Of the same version as the first, but not the same.
OTHER = "other"
CHANGES = {
    BROKEN: {"fasaco_edge/config/config.py": "import nothing_of_that_name\n"},
    DYING: {"fasaco_edge/daemon/service.py": DIES},
    OTHER: {"fasaco_edge/_share/maps/README.md": "other maps\n"},
}
MINE = "robot: {name: maja}\nmission: {lost_pose_s: 0.0}\n"


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    if reason := why_not() or installed.why_not():
        pytest.skip(reason)
    return {
        version: releases.write_release(
            tmp_path_factory.mktemp("release"),
            FIRST if version == OTHER else version,
            CHANGES.get(version),
        )
        for version in (FIRST, SECOND, BROKEN, DYING, OTHER)
    }


@pytest.fixture(scope="module")
def untouched() -> dict[str, str]:
    """The robot's files before anything was installed."""
    return {}


@pytest.fixture(scope="module")
def robot(
    folders: dict[str, Path], untouched: dict[str, str], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Robot]:
    """A robot on which the first version was installed."""
    with bare_robot(tmp_path_factory.mktemp("lab"), folders) as running:
        untouched |= running.files()
        installed.warm(running)
        running.install(FIRST)
        yield running


def test_a_failed_first_install_leaves_no_service_behind(folders, tmp_path):
    with bare_robot(tmp_path, folders) as bare:
        installed.warm(bare)
        done = bare.install(DYING, code=5)
        assert "a screw is loose" in done.stderr
        assert bare.run("systemctl", "is-active", "fasaco-edge", check=False).stdout != "active\n"
        assert not (bare.root / "etc/systemd/system/fasaco-edge.service").exists()
        assert not (bare.root / "opt/fasaco-edge").exists()


def test_without_recording_and_without_a_start(folders, tmp_path):
    with bare_robot(tmp_path, folders) as bare:
        told = bare.install(FIRST, "--without-recording", "--no-start").stdout
        assert told.endswith(f"version {FIRST} is installed\n")
        assert bare.run("systemctl", "is-active", "fasaco-edge", check=False).stdout != "active\n"
        assert bare.run("systemctl", "is-enabled", "fasaco-edge").stdout == "enabled\n"
        assert not (bare.root / "etc/systemd/system/fasaco-edge-recorder.service").exists()
        assert not list((bare.root / f"opt/fasaco-edge/{FIRST}").glob("lib/*/*/rerun_sdk*"))
        installed.warm(bare)
        bare.run("systemctl", "start", "fasaco-edge")
        assert bare.answers(FIRST)


def test_from_nothing_to_a_service_and_again_is_nothing_to_do(robot):
    assert robot.answers(FIRST)
    assert robot.run("systemctl", "is-enabled", "fasaco-edge").stdout == "enabled\n"
    compiled = robot.run("find", f"{PREFIX}/{FIRST}", "-name", "config.cpython-*.pyc").stdout
    assert "fasaco_edge/config" in compiled
    pid = robot.run("systemctl", "show", "-P", "MainPID", "fasaco-edge").stdout
    before = robot.settled()
    assert robot.install(FIRST).stdout == f"nothing to do: version {FIRST} is installed\n"
    assert robot.settled() == before
    assert robot.run("systemctl", "show", "-P", "MainPID", "fasaco-edge").stdout == pid


def test_a_service_that_was_stopped_is_started_again(robot):
    robot.run("systemctl", "disable", "--now", "fasaco-edge")
    robot.install(FIRST)
    assert robot.answers(FIRST)
    assert robot.run("systemctl", "is-enabled", "fasaco-edge").stdout == "enabled\n"


@pytest.mark.parametrize(
    ("version", "code", "told"),
    [(BROKEN, 4, "No module named 'nothing_of_that_name'"), (DYING, 5, "a screw is loose")],
)
def test_a_version_that_does_not_work_leaves_the_old_one_running(robot, version, code, told):
    before = robot.settled()
    done = robot.install(version, code=code)
    assert told in done.stderr
    assert f"{FIRST} runs" in done.stderr
    assert robot.answers(FIRST)
    assert robot.settled() == before


def test_a_dry_run_changes_nothing(robot):
    before = robot.settled()
    steps = robot.install(SECOND, "--dry-run").stdout
    assert f"would switch from {FIRST} to {SECOND}" in steps
    assert all(line.startswith("would ") for line in steps.splitlines())
    assert f"would remove {PREFIX}" in robot.uninstall("--purge", "--dry-run")
    assert robot.settled() == before
    assert robot.answers(FIRST)


def test_an_upgrade_keeps_the_configuration_and_the_old_version(robot):
    robot.write(CONFIG, MINE)
    robot.install(SECOND)
    assert robot.version() == SECOND
    assert robot.run("cat", CONFIG).stdout == MINE
    assert SECOND in robot.run("fasaco-edge", "ask", "version", "--robot", "maja").stdout
    robot.roll_back()
    assert (robot.version(), robot.version("previous")) == (FIRST, SECOND)
    assert FIRST in robot.run("fasaco-edge", "ask", "version", "--robot", "maja").stdout


def test_a_wrong_configuration_is_reported_before_any_switch(robot):
    before = robot.run("cat", CONFIG).stdout
    robot.write(CONFIG, "robot: {radius_m: -1}\n")
    assert "radius_m" in robot.install(OTHER, code=4).stderr
    assert robot.version() == FIRST
    robot.write(CONFIG, before)


def test_another_build_of_the_same_version_stands_beside_it(robot):
    robot.install(OTHER)
    assert robot.version().startswith(f"{FIRST}-")
    assert robot.version("previous") == FIRST
    robot.roll_back()
    assert robot.version() == FIRST


def test_uninstall_leaves_the_users_data_and_purge_removes_it(robot, untouched):
    robot.write(CONFIG, MINE)
    told = robot.uninstall()
    left = robot.files().keys() - untouched.keys()
    assert "what stays" in told
    assert {path.strip() for path in left} >= {"/etc/fasaco-edge", CONFIG}
    assert all(path.startswith(("/etc/fasaco-edge", "/var/lib/", "/var/log/")) for path in left)
    assert robot.run("cat", CONFIG).stdout == MINE
    assert robot.run("systemctl", "list-units", "--all", "fasaco*", "--plain", "-q").stdout == ""
    again = f"/srv/{FIRST}/uninstall.sh"
    robot.run(again, "--purge")
    assert robot.files() == untouched
    assert robot.run(again).stdout.startswith("nothing to do")
