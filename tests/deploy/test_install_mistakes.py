"""What install.sh refuses: each time it says what is wrong and what to do, and changes nothing."""

from __future__ import annotations

import shutil
import subprocess
import time
from collections.abc import Iterator

import pytest

from tests.deploy import installed, releases
from tests.deploy.installing import PREFIX, Robot, bare_robot
from tests.deploy.lab import why_not
from wheelhouse.closure import Target

HERE, ELSEWHERE, NEWER, DAMAGED = "here", "elsewhere", "newer", "damaged"
INSTALL = f"/srv/{HERE}/install.sh"
# Nobody sees a program there any more: what is bound over it cannot be run.
HIDE = "mount --bind /dev/null"


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    if reason := why_not() or installed.why_not():
        pytest.skip(reason)
    targets = {
        HERE: None,
        ELSEWHERE: Target("riscv64", "3.11"),
        NEWER: Target(releases.THIS.machine, "3.99"),
    }
    folders = {
        name: releases.write_release(tmp_path_factory.mktemp(name), "1.0", target=target)
        for name, target in targets.items()
    }
    folders[DAMAGED] = tmp_path_factory.mktemp(DAMAGED) / "release"
    shutil.copytree(folders[HERE], folders[DAMAGED])
    wheel = next(folders[DAMAGED].glob("wheels/fasaco_edge-*.whl"))
    wheel.write_bytes(wheel.read_bytes() + b"\n")
    folders[DAMAGED].parent.chmod(0o755)
    with bare_robot(tmp_path_factory.mktemp("lab"), folders) as running:
        yield running


def refused(robot: Robot, *words: str, code: int = 3) -> str:
    """Run a command that has to fail with this code and leave nothing; return what it says."""
    before = robot.files()
    done = robot.run(*words, check=False)
    assert done.returncode == code, f"{done.returncode}\n{done.stdout}{done.stderr}"
    assert robot.files() == before
    assert "\n  hint: " in done.stderr
    return done.stderr


def apart(robot: Robot, first: str, *words: str) -> str:
    """The same after a command that changes the mounts, for this one alone."""
    script = f'{first} && exec "$@"'
    return refused(robot, "unshare", "--mount", "sh", "-c", script, "sh", INSTALL, *words)


def test_words_it_does_not_know(robot):
    assert "--wheel is not understood" in refused(robot, INSTALL, "--wheel", "/srv", code=2)
    assert "--wheels needs a value" in refused(robot, INSTALL, "--wheels", code=2)


def test_another_than_root(robot):
    words = ("setpriv", "--reuid=nobody", "--regid=nogroup", "--clear-groups", INSTALL)
    assert "only root may" in refused(robot, *words)


def test_an_installation_without_python_is_refused(robot):
    assert "there is no /usr/bin/python3" in apart(robot, f"{HIDE} $(readlink -f /usr/bin/python3)")


def test_a_python_that_a_service_cannot_reach_is_refused(robot):
    robot.run("mkdir", "-p", "/home/maja")
    words = "mount --bind /usr /home/maja"
    told = apart(robot, words, "--python", "/home/maja/bin/python3")
    assert "/home/maja" in told
    assert "a service cannot reach" in told


def test_an_installation_without_systemd_is_refused(robot):
    assert "there is no systemd here" in apart(robot, f"{HIDE} /usr/bin/systemctl")


def test_a_systemd_that_does_not_run_is_refused(robot):
    told = apart(robot, "mount -t tmpfs nothing /run/systemd")
    assert "installed but does not run" in told
    assert "--no-start" in told


def test_an_installation_without_wheels_is_refused(robot):
    told = refused(robot, INSTALL, "--wheels", "/etc")
    assert "/etc is no folder of wheels" in told
    assert "make wheelhouse" in told


def test_wheels_for_another_computer_are_refused(robot):
    told = refused(robot, f"/srv/{ELSEWHERE}/install.sh")
    assert "these wheels are for riscv64" in told
    assert "Python 3.99" in refused(robot, f"/srv/{NEWER}/install.sh")


def test_a_wheel_that_was_damaged_on_the_way(robot):
    told = refused(robot, f"/srv/{DAMAGED}/install.sh", code=1)
    assert "HASHES" in told
    assert "copy the release folder again" in told


def test_a_disk_without_room(robot):
    told = apart(robot, "mount -t tmpfs -o size=16m small /opt")
    assert " has 17 MB free, this version needs " in told


def test_no_version_to_go_back_to(robot):
    assert "there is no version before" in refused(robot, INSTALL, "--rollback")


def test_two_at_once(robot):
    # The other one may just have begun: what it has locked is still empty, and stays.
    robot.run("mkdir", PREFIX)
    assert "another install.sh" in refused(robot, "flock", PREFIX, INSTALL)
    robot.run("rmdir", PREFIX)


def test_an_interrupted_installation_leaves_nothing(robot):
    before = robot.files()
    with subprocess.Popen(robot.words(INSTALL), stdout=subprocess.PIPE, text=True) as running:
        assert running.stdout.readline().startswith("build version 1.0")
        time.sleep(1.0)
        robot.run("pkill", "--full", f"^/bin/bash -p {INSTALL}")
    assert running.returncode == 143
    assert robot.files().keys() - before.keys() == set()


def test_a_folder_prepared_by_another_user_is_not_loaded(robot):
    """What lies where root calls it, or where the environment points, is never run."""
    planted, mark = "/srv/planted", "/srv/planted/LOADED"
    for name in ("venv", "sysconfig", "platform", "zipfile", "sitecustomize", "os"):
        robot.write(f"{planted}/{name}.py", f"open({mark!r}, 'a').write({name!r})\n")
    robot.write(f"{planted}/env.sh", f"echo env.sh >>{mark}\n")
    told = [f"{name}={planted}" for name in ("PYTHONPATH", "PYTHONHOME", "HOME", "TMPDIR")]
    told += [f"BASH_ENV={planted}/env.sh", f"PYTHONSTARTUP={planted}/os.py", f"CDPATH={planted}"]
    folder = ("env", f"--chdir={planted}", *told)
    steps = robot.run(*folder, INSTALL, "--dry-run").stdout
    assert "would build version 1.0" in steps
    robot.run(*folder, f"/srv/{HERE}/uninstall.sh", "--dry-run")
    # A path is still as the caller means it.
    assert "/srv/planted/wheels is no folder" in refused(robot, *folder, INSTALL, "--wheels=wheels")
    assert robot.run("ls", mark, check=False).stdout == ""
