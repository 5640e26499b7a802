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


def apart(first: str, *words: str) -> tuple[str, ...]:
    """Return an installation after a command that changes the mounts, for this one alone."""
    script = f'{first} && exec "$@"'
    return "unshare", "--mount", "sh", "-c", script, "sh", INSTALL, *words


NOBODY = ("setpriv", "--reuid=nobody", "--regid=nogroup", "--clear-groups", INSTALL)
MAJA = "mkdir -p /home/maja && mount --bind /usr /home/maja"


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ((INSTALL, "--wheel", "/srv"), 2, ["--wheel is not understood"]),
        ((INSTALL, "--wheels"), 2, ["--wheels needs a value"]),
        (NOBODY, 3, ["only root may"]),
        (apart(f"{HIDE} $(readlink -f /usr/bin/python3)"), 3, ["there is no /usr/bin/python3"]),
        (
            apart(MAJA, "--python", "/home/maja/bin/python3"),
            3,
            ["/home/maja", "a service cannot reach"],
        ),
        (apart(f"{HIDE} /usr/bin/systemctl"), 3, ["there is no systemd here"]),
        (
            apart("mount -t tmpfs nothing /run/systemd"),
            3,
            ["installed but does not run", "--no-start"],
        ),
        ((INSTALL, "--wheels", "/etc"), 3, ["/etc is no folder of wheels", "make wheelhouse"]),
        ((f"/srv/{ELSEWHERE}/install.sh",), 3, ["these wheels are for riscv64"]),
        ((f"/srv/{NEWER}/install.sh",), 3, ["Python 3.99"]),
        ((f"/srv/{DAMAGED}/install.sh",), 1, ["HASHES", "copy the release folder again"]),
        (apart("mount -t tmpfs -o size=16m small /opt"), 3, ["17 MB free, this version needs "]),
        ((INSTALL, "--rollback"), 3, ["there is no version before"]),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_a_mistake_is_refused_with_a_hint(robot, words, code, said):
    told = refused(robot, *words, code=code)
    assert [part for part in said if part not in told] == []


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
