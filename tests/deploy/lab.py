"""A lab: a real systemd in namespaces of its own, over a throw-away overlay of this machine's root.

It has process ids, mounts, network (``lo`` alone), host name and cgroups of its own. What is
written inside lies in a tmpfs of its mount namespace, so its end leaves nothing behind; what is
installed on the machine meanwhile is not seen in /etc, /opt, /srv or /var; and it ends with the
process that booted it, however that ends.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from tests.support.waiting import until

# A lab has all of these for itself.
SPACES = ("pid", "mount", "cgroup", "ipc", "uts", "net")
UNSHARE = ("unshare", "--fork", "--propagation=private", *(f"--{name}" for name in SPACES))
NSENTER = ("nsenter", "-p", "-m", "-C", "-i", "-u", "-n", "--root", "--wd")
PROGRAMS = ("unshare", "nsenter", "setpriv", "pivot_root", "mount", "ip", "systemctl")
SYSTEMD = Path("/usr/lib/systemd/systemd")
BOOT_S = 40.0
ENVIRONMENT = {
    "PATH": "/opt/fasaco-edge/current/bin:/usr/sbin:/usr/bin:/sbin:/bin",
    "LANG": "C.UTF-8",
    "SYSTEMD_COLORS": "0",
    "SYSTEMD_PAGER": "",
}


class Lab:
    """A running lab.

    Attributes:
        pid: process id of its systemd, as this machine counts.
        root: its root folder, seen from here.
        boot_s: seconds from nothing to a running system.
    """

    def __init__(self, pid: int, boot_s: float) -> None:
        self.pid = pid
        self.root = Path(f"/proc/{pid}/root")
        self.boot_s = boot_s

    def words(self, *words: str) -> list[str]:
        """Return the command line that runs ``words`` inside."""
        # nsenter forks: what it has started is to end with it.
        alone = ("setpriv", "--pdeathsig", "KILL")
        return [*NSENTER, f"--target={self.pid}", "--", *alone, *words]

    def run(
        self, *words: str, check: bool = True, timeout_s: float = 600.0
    ) -> subprocess.CompletedProcess[str]:
        """Run a program inside, as root; with ``check`` an exit code but 0 is a failure."""
        done = subprocess.run(
            self.words(*words),
            env=ENVIRONMENT,
            capture_output=True,
            text=True,
            timeout=timeout_s,
            check=False,
        )
        assert not check or done.returncode == 0, f"{words}: {done.stdout}{done.stderr}"
        return done

    def write(self, path: str, text: str) -> None:
        file = self.root / path.lstrip("/")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")


def why_not() -> str:
    """Return why there can be no lab here, "" if there can."""
    if os.geteuid() != 0:
        return "a lab needs root"
    if not SYSTEMD.exists():
        return "systemd is not installed"
    lacking = [name for name in PROGRAMS if shutil.which(name) is None]
    if lacking:
        return f"not installed: {', '.join(lacking)}"
    if _cgroup2() is None:
        return "no cgroup2 is mounted"
    overlay = "mount -t tmpfs t /mnt && mkdir /mnt/u /mnt/w && mount -t overlay o -o "
    overlay += "lowerdir=/,upperdir=/mnt/u,workdir=/mnt/w /mnt"
    words = [*UNSHARE, "sh", "-c", overlay]
    tried = subprocess.run(words, capture_output=True, text=True, check=False)
    return f"no namespaces or no overlay here: {tried.stderr.strip()}" if tried.returncode else ""


@contextmanager
def booted(folder: Path, binds: Mapping[str, Path]) -> Iterator[Lab]:
    """Boot a lab, and end it.

    Args:
        folder: an empty folder for its log.
        binds: folders to be seen inside, read-only, by their place there.
    """
    started = time.monotonic()
    group = _make_cgroup()
    (folder / "mnt").mkdir()
    orders = {
        "folder": str(folder),
        "binds": {inside: str(outside) for inside, outside in binds.items()},
    }
    (folder / "orders").write_text(json.dumps(orders))
    process = _launch(folder, group)
    try:
        pid = _wait_for_boot(folder, process)
        yield Lab(pid, time.monotonic() - started)
    finally:
        process.kill()  # and with it, as its last child's parent, the whole process namespace
        process.wait()
        _remove_cgroup(group)


def _launch(folder: Path, group: Path) -> subprocess.Popen[bytes]:
    """Start process 1; it is killed when this thread ends, whatever ends it."""
    join = 'echo $$ >"$GROUP_TO_JOIN/cgroup.procs"; exec "$@"'
    first = [sys.executable, "-I", str(Path(__file__).with_name("lab_init.py"))]
    words = ["setpriv", "--pdeathsig", "KILL", "sh", "-c", join, "sh"]
    words += [*UNSHARE, "--kill-child", *first, str(folder / "orders")]
    environment = os.environ | {"GROUP_TO_JOIN": str(group)}
    with (folder / "console.log").open("wb") as console:
        return subprocess.Popen(
            words,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=console,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )


def _wait_for_boot(folder: Path, process: subprocess.Popen[bytes]) -> int:
    until = time.monotonic() + BOOT_S
    state = ""
    while time.monotonic() < until and process.poll() is None:
        with suppress(FileNotFoundError, ValueError):
            pid = int((folder / "pid").read_text())
            state = Lab(pid, 0.0).run("systemctl", "is-system-running", check=False).stdout.strip()
            if state in ("running", "degraded"):
                return pid
        time.sleep(0.05)
    console = (folder / "console.log").read_text(errors="replace")
    raise AssertionError(f"the lab did not boot, its state is {state!r}:\n{console}")


def _cgroup2() -> Path | None:
    for line in Path("/proc/mounts").read_text().splitlines():
        _, place, kind, *_ = line.split()
        if kind == "cgroup2":
            return Path(place)
    return None


def _make_cgroup() -> Path:
    """Make a leaf of our own, so that the lab's cgroup namespace has a root of its own."""
    base = _cgroup2()
    assert base is not None
    for left in base.glob("fasaco-lab-*"):  # of a run that was killed
        if not Path("/proc", left.name.rpartition("-")[2]).exists():
            _remove_cgroup(left)
    group = base / f"fasaco-lab-{time.monotonic_ns()}-{os.getpid()}"
    group.mkdir()
    return group


def _remove_cgroup(group: Path) -> None:
    """Remove a cgroup with all below it; the last processes may take a moment to be gone."""

    def is_gone() -> bool:
        for folder, _, _ in os.walk(group, topdown=False):
            with suppress(OSError):
                os.rmdir(folder)
        return not group.exists()

    until(is_gone, 5.0, why=lambda: f"left behind: {group}")
