"""Install a release in a lab without a network, and start it cold: nothing may be compiled.

    PYTHONPATH=deploy python -m tests.campaigns.cold_start RELEASE [--json]

RELEASE is a folder that `make wheelhouse` has made, with compiled kernels in it. Measured are the
installation, a first start until systemd calls the service ready, the time from a first map and
pose to the first path, the memory that this takes at most, and a roll back to a version before.
Then a byte of one kernel is changed: the service has to say so, and plan. Exit code 1 where
something is compiled that need not be, or fails; 77 where there can be no lab.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

from tests.deploy.installing import HOME, PREFIX, Robot
from tests.deploy.lab import booted, why_not
from tests.support.rooms import map_bytes, pillared_room, pose_bytes

CANNOT_RUN = 77
CHECKOUT = Path(__file__).parents[2]
SERVICE = "fasaco-edge"
PYTHON = f"{PREFIX}/current/bin/python"
KERNELS = f"{PREFIX}/current/lib/python3.*/site-packages/fasaco_edge/_share/kernels"
CACHE = "/var/cache/private/fasaco-edge"
FIRST_PATH = """\
import sys, time
sys.path.insert(0, "/srv/checkout")
from pathlib import Path
from tests.support.outsider import Outsider
with Outsider("tcp/127.0.0.1:7447") as outsider:
    path = outsider.listen("path")
    began = time.monotonic()
    for key in ("map", "pose"):
        outsider.put(key, Path("/srv/samples", key).read_bytes())
    path.wait(lambda heard: len(heard.payload) > 100)
    print(time.monotonic() - began)
"""


def main() -> int:
    """Install, start, plan, harm and mend; print a figure a line."""
    args = _parser().parse_args()
    if reason := why_not():
        print(f"skipped: {reason}")
        return CANNOT_RUN
    folder = Path(tempfile.mkdtemp())
    folder.chmod(0o755)
    samples = Path(tempfile.mkdtemp())
    samples.chmod(0o755)
    (samples / "map").write_bytes(map_bytes(pillared_room()))
    (samples / "pose").write_bytes(pose_bytes(1.0, 1.0))
    shown = {
        "/srv/release": args.release.resolve(),
        "/srv/checkout": CHECKOUT,
        "/srv/samples": samples,
    }
    with booted(folder, shown) as lab:
        robot = Robot(lab.pid, lab.boot_s)
        robot.run("mkdir", HOME)
        robot.run("sh", "-c", "cp -r /srv/release /srv/first; cp -r /srv/release /srv/second")
        robot.run("sh", "-c", "echo '# another' >>/srv/second/fasaco-edge.yaml")
        figures = {"install_s": _install(robot, "first")}
        figures |= _cold(robot)
        print(robot.run("fasaco-edge", "warmup", "--check").stderr, file=sys.stderr)
        figures["upgrade_s"] = _install(robot, "second")
        figures["rollback_s"] = _install(robot, "first", "--rollback")
        compiled = _compiled(robot)
        harmed = _harmed(robot)
    report = {
        **{name: round(value, 2) for name, value in figures.items()},
        "compiled_files": compiled,
        **{f"harmed_{name}": round(value, 2) for name, value in harmed.items()},
    }
    if args.json:
        print(json.dumps(report))
    else:
        print("\n".join(f"{name:24} {value:g}" for name, value in report.items()))
    return 1 if compiled else 0


def _install(robot: Robot, version: str, *words: str) -> float:
    began = time.monotonic()
    robot.install(version, *words)
    return time.monotonic() - began


def _cold(robot: Robot) -> dict[str, float]:
    """Start with nothing compiled on the robot; return what it took."""
    robot.run("systemctl", "stop", SERVICE)
    robot.run("sh", "-c", f"rm -rf {CACHE}/*")
    began = time.monotonic()
    robot.run("systemctl", "start", SERVICE, timeout_s=900.0)
    ready_s = time.monotonic() - began
    first_path_s = float(robot.run(PYTHON, "-c", FIRST_PATH, timeout_s=120.0).stdout)
    pid = robot.run("systemctl", "show", "--value", "--property=MainPID", SERVICE).stdout.strip()
    status = robot.run("cat", f"/proc/{pid}/status").stdout
    peak_mb = int(status.partition("VmHWM:")[2].split()[0]) * 1024 / 1e6
    return {"ready_s": ready_s, "first_path_s": first_path_s, "peak_mb": peak_mb}


def _compiled(robot: Robot) -> int:
    """Return how many kernels were compiled into the service's cache."""
    return len(robot.run("find", CACHE, "-name", "*.kernel").stdout.splitlines())


def _harmed(robot: Robot) -> dict[str, float]:
    """Change a byte of one kernel; the service says so, compiles them for itself, and plans."""
    change = f"file=$(ls {KERNELS}/*.kernel | head -n 1) && printf x >>$file && echo $file"
    file = robot.run("sh", "-c", change).stdout.strip()
    figures = _cold(robot)
    journal = robot.run("journalctl", "--unit", SERVICE, "--output", "cat", "--no-pager").stdout
    said = f"compiled kernels of this installation are not used: {Path(file).resolve()} is damaged"
    assert said.rpartition("/")[2] in journal, journal
    assert _compiled(robot) > 0
    return figures


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m tests.campaigns.cold_start",
        description="Install a release in a lab, and start it cold.",
    )
    parser.add_argument("release", type=Path, metavar="RELEASE", help="made by `make wheelhouse`")
    parser.add_argument("--json", action="store_true", help="the figures as JSON")
    return parser


if __name__ == "__main__":
    sys.exit(main())
