"""Process 1 of a lab: builds a root of its own, throws the machine's away, and becomes systemd.

Run by ``unshare`` in new namespaces; reads its orders, JSON, from the file that is its argument.
It imports nothing but the standard library: it runs before there is anything else.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

SYSTEMD = "/usr/lib/systemd/systemd"
PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"
DEVICES = ("null", "zero", "full", "random", "urandom", "tty")
# What is changed on the machine while a lab runs, by whoever installs a package there, must not be
# seen inside: of these it has a copy, of the others nothing but an empty folder.
COPIED = ("etc", "usr/local/bin", "usr/local/sbin")
EMPTY = ("opt", "srv", "var/cache", "var/lib", "var/log")
# The machine's own; a lab has neither hardware nor users who log in.
MASKED = (
    "systemd-udevd.service",
    "systemd-udev-trigger.service",
    "systemd-timesyncd.service",
    "systemd-resolved.service",
    "systemd-networkd.service",
    "systemd-logind.service",
    "systemd-random-seed.service",
    "systemd-remount-fs.service",
    "systemd-firstboot.service",
    "getty.target",
)
TARGET = """\
[Unit]
Description=All that a lab starts by itself
Requires=basic.target
After=basic.target
AllowIsolate=yes
"""
# Every line is to be seen: what limits them has to be the service itself.
JOURNAL = "[Journal]\nStorage=volatile\nForwardToConsole=no\nRateLimitBurst=0\n"


def main(orders: dict) -> None:
    folder = Path(orders["folder"])
    # /proc is still the machine's: this is the process id there.
    (folder / "pid").write_text(os.readlink("/proc/self"))
    mount("--make-rprivate", "/")
    mount("-t", "tmpfs", "-o", "size=4g", "tmpfs", folder / "mnt")
    upper, work, root = (folder / "mnt" / name for name in ("upper", "work", "root"))
    for made in (upper, work, root):
        made.mkdir()
    layers = f"lowerdir=/,upperdir={upper},workdir={work}"
    mount("-t", "overlay", "overlay", "-o", layers, root)
    own_folders(root, folder / "mnt" / "own")
    kernel_interfaces(root)
    devices(root)
    for inside, outside in orders["binds"].items():
        place = root / inside.lstrip("/")
        place.mkdir(parents=True, exist_ok=True)
        mount("--bind", "-o", "ro", outside, place)
    settings(root)
    enter(root)
    words = [SYSTEMD, "--system", "--unit=lab.target", "--log-target=journal", "--show-status=no"]
    os.execve(SYSTEMD, words, {"PATH": PATH, "container": "lab", "LANG": "C.UTF-8"})


def mount(*words: object) -> None:
    subprocess.run(["mount", *map(str, words)], check=True)


def own_folders(root: Path, place: Path) -> None:
    """Put folders of the lab's own over those that programs write to on the machine."""
    for name in (*COPIED, *EMPTY):
        shown, own = root / name, place / name
        if not shown.is_dir():
            continue
        own.mkdir(parents=True)
        if name in COPIED:
            # A file may go while this reads it.
            subprocess.run(["cp", "--archive", f"{shown}/.", own], check=False)
        mount("--bind", own, shown)


def kernel_interfaces(root: Path) -> None:
    mount("-t", "proc", "proc", root / "proc")
    mount("-t", "sysfs", "sysfs", root / "sys")
    mount("-t", "cgroup2", "cgroup2", root / "sys/fs/cgroup")
    mount("-t", "tmpfs", "-o", "mode=755", "tmpfs", root / "run")
    mount("-t", "tmpfs", "-o", "mode=1777", "tmpfs", root / "tmp")


def devices(root: Path) -> None:
    """Give the lab the devices that every program may expect, and no others."""
    mount("-t", "tmpfs", "-o", "mode=755", "tmpfs", root / "dev")
    for name in DEVICES:
        (root / "dev" / name).touch()
        mount("--bind", f"/dev/{name}", root / "dev" / name)
    for name in ("pts", "shm"):
        (root / "dev" / name).mkdir()
    options = "newinstance,ptmxmode=0666,mode=620,gid=5"
    mount("-t", "devpts", "-o", options, "devpts", root / "dev/pts")
    mount("-t", "tmpfs", "tmpfs", root / "dev/shm")
    for name, there in (("ptmx", "pts/ptmx"), ("fd", "/proc/self/fd")):
        (root / "dev" / name).symlink_to(there)
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        (root / "dev" / name).symlink_to(f"fd/{number}")


def settings(root: Path) -> None:
    """Say what systemd is to start, and what of the machine's it is not."""
    units = root / "run/systemd/system"
    units.mkdir(parents=True)
    (units / "lab.target").write_text(TARGET)
    for name in MASKED:
        (units / name).symlink_to("/dev/null")
    journal = root / "etc/systemd/journald.conf.d/lab.conf"
    journal.parent.mkdir(parents=True, exist_ok=True)
    journal.write_text(JOURNAL)
    (root / "etc/machine-id").write_text("")
    subprocess.run(["hostname", "lab"], check=True)
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)


def enter(root: Path) -> None:
    """Make ``root`` the root, and let go of the machine's."""
    old = root / ".old"
    old.mkdir()
    os.chdir(root)
    subprocess.run(["pivot_root", ".", ".old"], check=True)
    subprocess.run(["umount", "-l", "/.old"], check=True)
    Path("/.old").rmdir()
    # In a container systemd leaves this to whoever made it; LoadCredential= needs it.
    mount("--make-rshared", "/")


if __name__ == "__main__":
    main(json.loads(Path(sys.argv[1]).read_text()))
