"""Follow deploy/README.md in a lab, as a new user would, with the real wheels.

    PYTHONPATH=deploy python -m tests.campaigns.manual RELEASE

Takes minutes.

RELEASE is a folder that `make wheelhouse` has made. Every command for the robot is run, in the
manual's order, while a simulated robot covers a flat; what each took is printed. The kernels are
compiled as on a robot, so this takes some minutes. Before the last section a byte of one kernel is
changed: the service must report and recompile it. Exit code 1 if a command fails, the mission does
not continue through an upgrade, or something is left at the end; 77 where no lab can be booted.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.deploy.installing import CONFIG, HOME, PREFIX, Robot
from tests.deploy.lab import booted, why_not
from tests.deploy.manual import Block, blocks

CANNOT_RUN = 77
EXAMPLE = f"{PREFIX}/current/deploy/fasaco-edge.yaml"
# A report of faults, and the faults that a lab has.
MAY_END_WITH_1 = "fasaco-edge doctor"
PROTOCOL = Path(__file__).parents[2] / "protocol" / "security.md"
CACHE = "/var/cache/private/fasaco-edge"


def main() -> int:
    """Follow the manual; print what each command took."""
    args = _parser().parse_args()
    if reason := why_not():
        print(f"skipped: {reason}")
        return CANNOT_RUN
    folder = Path(tempfile.mkdtemp())
    folder.chmod(0o755)
    with booted(folder, {"/srv/release": args.release.resolve()}) as lab:
        robot = Robot(lab.pid, lab.boot_s)
        robot.run("mkdir", HOME)
        robot.run("sh", "-c", f"cp -r /srv/release {HOME}/{args.release.resolve().name}")
        untouched = robot.files()
        follow(robot)
        left = set(robot.files()) - set(untouched)
    print("left in the end:", *sorted(left) or ["nothing"])
    return 1 if left else 0


def follow(robot: Robot) -> None:
    """Run all blocks in order, and what the manual leaves to its reader in between."""
    where, section = HOME, ""
    with driving(robot):
        for block in blocks():
            if block.section != section:
                section = block.section
                print(f"\n## {section}", flush=True)
                PREPARE.get(section, nothing)(robot)
            if block.kind == "yaml":
                take(robot, block)
            elif not block.text.startswith("make "):
                where = follow_block(robot, block, where)
    if section == "Uninstall":
        purge(robot)


def follow_block(robot: Robot, block: Block, where: str) -> str:
    """Run a block's commands, each as typed; return the folder it ends in."""
    for command in block.commands:
        started = time.monotonic()
        script = f"cd {where} && {command}\ncode=$?; pwd >/tmp/where; exit $code"
        done = robot.run("env", f"HOME={HOME}", "bash", "-c", script, check=False, timeout_s=1500)
        print(f"$ {command}    [{time.monotonic() - started:.1f} s, {done.returncode}]")
        print("\n".join(f"    {line}" for line in (done.stdout + done.stderr).splitlines()[:30]))
        sys.stdout.flush()
        fine = (0, 1) if MAY_END_WITH_1 in command else (0,)
        assert done.returncode in fine, command
        where = robot.run("cat", "/tmp/where").stdout.strip()
    return where


def take(robot: Robot, block: Block) -> None:
    """Write a configuration of the manual's, and check it; where it is to be secured, it stays."""
    before = robot.run("cat", CONFIG).stdout
    robot.write(CONFIG, block.text)
    robot.run("fasaco-edge", "check-config", CONFIG)
    if block.section != "Secure":
        robot.write(CONFIG, before)


def certificates(robot: Robot) -> None:
    """Make certificates as the protocol's manual says."""
    script = next(
        code
        for code in re.findall(r"^```sh\n(.*?)^```$", PROTOCOL.read_text(), re.M | re.S)
        if "openssl req -x509" in code
    )
    robot.write(f"{HOME}/sign.sh", script)
    robot.run("sh", "-c", f"cd {HOME}/*-py3* && bash -e ../sign.sh")


def upgrade(robot: Robot) -> None:
    """Upgrade to another build while the robot drives; the mission has to go on."""
    robot.run("cp", EXAMPLE, CONFIG)
    robot.run("rm", "-r", "/etc/systemd/system/fasaco-edge.service.d")
    robot.run("systemctl", "daemon-reload")
    robot.run("systemctl", "restart", "fasaco-edge")
    until = time.monotonic() + 120.0
    while covered(robot) < 3.0 and time.monotonic() < until:
        time.sleep(1.0)
    before = covered(robot)
    robot.run("sh", "-c", f"cd {HOME}/*-py3* && echo '# changed' >>{Path(EXAMPLE).name}")
    started = time.monotonic()
    robot.run("sh", "-c", f"{HOME}/*-py3*/install.sh", timeout_s=1500)
    after = covered(robot)
    print(f"upgrade while driving: {time.monotonic() - started:.0f} s, covered {before} m2 before,")
    settings = robot.run("ls", "/etc/fasaco-edge").stdout.split()
    print(f"    {after} m2 after; configuration: {', '.join(settings)}")
    assert 3.0 <= before <= after + 0.5


def purge(robot: Robot) -> None:
    """Take the rest away, too."""
    robot.run("sh", "-c", f"{HOME}/*-py3*/uninstall.sh --purge")
    robot.run("sh", "-c", f"rm -r {HOME}/* {HOME}/.[!.]* 2>/dev/null || true")


def harm(robot: Robot) -> None:
    """Append a byte to one kernel; the service reports it and compiles it again."""
    change = f"file=$(find {CACHE} -name '*.nbc' | head -n 1) && printf x >>$file && echo $file"
    file = Path(robot.run("sh", "-c", change).stdout.strip())
    started = time.monotonic()
    robot.run("systemctl", "restart", "fasaco-edge", timeout_s=900.0)
    print(f"start with a damaged kernel: {time.monotonic() - started:.1f} s")
    words = ("--unit", "fasaco-edge", "--output", "cat", "--no-pager")
    journal = robot.run("journalctl", *words).stdout
    assert f"{file.name} is damaged" in journal, journal
    assert "kernels compiled in" in journal, journal


def nothing(robot: Robot) -> None:
    """Prepare nothing."""


PREPARE = {"Secure": certificates, "Upgrade": upgrade, "Uninstall": harm}


def covered(robot: Robot) -> float:
    """Return what the mission has covered [m2]."""
    done = robot.run("fasaco-edge", "ask", "status", "--json", check=False)
    if done.returncode:
        return 0.0
    return float((json.loads(done.stdout).get("coverage") or {}).get("covered_m2", 0.0))


@contextmanager
def driving(robot: Robot) -> Iterator[None]:
    """Let a simulated robot of the installed program drive, as soon as that is there."""
    loop = (
        "while sleep 1; do [ -x /usr/local/bin/fasaco-edge ] && NUMBA_CACHE_DIR=/tmp/simulated "
        "/usr/local/bin/fasaco-edge simulate flat --speed 2; done"
    )
    words = robot.words("bash", "-c", loop)
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield
    finally:
        process.kill()
        process.wait()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="Follow deploy/README.md in a lab.")
    parser.add_argument("release", type=Path, metavar="RELEASE", help="made by `make wheelhouse`")
    return parser


if __name__ == "__main__":
    sys.exit(main())
