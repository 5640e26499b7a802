"""A tree of Debian for arm64, whose programs run under emulation in namespaces of their own.

The emulator and Debian's packages are fetched into a folder and only unpacked there: nothing is
installed on this machine. A tree has process ids, mounts and network (``lo`` alone) of its own.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from tests.deploy.installed import CHECKOUT

SUITE = "bookworm"
PACKAGES = "python3,python3-venv,libgomp1,systemd,iproute2"
PROCESSOR = "cortex-a72"  # a Raspberry Pi 4's
ENVIRONMENT = {
    "PATH": "/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin",
    "LANG": "C.UTF-8",
    "HOME": "/root",
    "COLUMNS": "200",
    "QEMU_CPU": PROCESSOR,
}
# The kernel of these namespaces alone learns to start arm64 programs by the emulator.
MAGIC = r"\x7fELF\x02\x01\x01\x00\x00\x00\x00\x00\x00\x00\x00\x00\x02\x00\xb7\x00"
MASK = r"\xff\xff\xff\xff\xff\xff\xff\x00\xff\xff\xff\xff\xff\xff\xff\xff\xfe\xff\xff\xff"
SPACES = ("user", "mount", "pid", "net")
ENTER = rf"""
mount -t proc proc "$0/proc" && mount -t binfmt_misc binfmt_misc "$0/proc/sys/fs/binfmt_misc" &&
echo ":arm64:M::{MAGIC}:{MASK}:$0/qemu:F" >"$0/proc/sys/fs/binfmt_misc/register" &&
mount --rbind /dev "$0/dev" && ip link set lo up && exec chroot "$0" "$@"
"""


def why_not() -> str:
    """Return why no tree can be made here, "" if one can."""
    if os.geteuid() != 0:
        return "emulation in a tree of its own needs root"
    lacking = [name for name in ("apt-get", "dpkg", "unshare", "ip") if shutil.which(name) is None]
    return f"not installed: {', '.join(lacking)}" if lacking else ""


class Tree:
    """A tree in a folder; what has been made there once is taken again."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        self.root = self.folder / "root"

    def make(self) -> None:
        """Fetch and unpack all; needs the network, about a minute and 700 MB."""
        if (self.root / "complete").exists():
            return
        shutil.rmtree(self.root, ignore_errors=True)
        self.folder.mkdir(parents=True, exist_ok=True)
        tools = self.folder / "tools"
        _run("apt-get", "download", "-q", "qemu-user-static", "debootstrap", folder=self.folder)
        for package in self.folder.glob("*.deb"):
            _run("dpkg", "-x", package, tools)
        _run(
            tools / "usr/sbin/debootstrap",
            "--arch=arm64", "--foreign", "--variant=minbase", f"--include={PACKAGES}",
            SUITE, self.root,
            more={"DEBOOTSTRAP_DIR": str(tools / "usr/share/debootstrap")},
        )  # fmt: skip
        for package in sorted((self.root / "var/cache/apt/archives").glob("*.deb")):
            _run("dpkg", "-x", package, self.root)
        shutil.copy2(tools / "usr/bin/qemu-aarch64-static", self.root / "qemu")
        (self.root / "complete").touch()

    def words(self, *words: str) -> list[str]:
        """Return the command line that runs ``words`` inside."""
        spaces = [f"--{name}" for name in SPACES]
        unshare = ["unshare", *spaces, "--map-root-user", "--fork", "--kill-child"]
        return [*unshare, "--propagation=private", "sh", "-c", ENTER, str(self.root), *words]

    def run(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Run a program inside, without the network."""
        return subprocess.run(
            self.words(*words), env=ENVIRONMENT, capture_output=True, text=True, check=False
        )


def make_release(out: Path) -> Path:
    """Make a release folder for arm64; needs the network."""
    words = [sys.executable, "-m", "wheelhouse", "--arch", "aarch64", "--out", str(out)]
    _run(*words, more={"PYTHONPATH": str(CHECKOUT / "deploy")})
    return next(out.glob("fasaco-edge-*-aarch64-*"))


def _run(
    *words: str | Path, folder: Path | None = None, more: dict[str, str] | None = None
) -> None:
    done = subprocess.run(
        [str(word) for word in words],
        cwd=folder,
        env=os.environ | (more or {}),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    if done.returncode:
        raise SystemExit(f"{words[0]} ended with {done.returncode}:\n{done.stdout[-3000:]}")
