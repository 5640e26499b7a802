"""Install a release in a lab without a network, and start it cold and warm.

    PYTHONPATH=deploy python -m tests.campaigns.cold_start RELEASE [--json]

Takes minutes.

RELEASE is a folder that `make wheelhouse` has made. Measured are the installation, which compiles
the kernels, a start until systemd calls the service ready, the time from a first map and pose to
the first path, the memory that this takes at most, and a roll back to a version before. Then a byte
of one kernel is changed: the service has to say so, compile again what is damaged, within the
unit's limit on memory, and plan. 77 where there can be no lab.
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
        figures |= _started(robot)
        print(robot.run("fasaco-edge", "warmup", "--check").stderr, file=sys.stderr)
        figures["upgrade_s"] = _install(robot, "second")
        figures["rollback_s"] = _install(robot, "first", "--rollback")
        harmed = _harmed(robot)
    report = {
        **{name: round(value, 2) for name, value in figures.items()},
        **{f"harmed_{name}": round(value, 2) for name, value in harmed.items()},
    }
    if args.json:
        print(json.dumps(report))
    else:
        print("\n".join(f"{name:24} {value:g}" for name, value in report.items()))
    return 0


def _install(robot: Robot, version: str, *words: str) -> float:
    began = time.monotonic()
    robot.install(version, *words)
    return time.monotonic() - began


def _started(robot: Robot) -> dict[str, float]:
    """Start the service again; return what it took."""
    robot.run("systemctl", "stop", SERVICE)
    began = time.monotonic()
    robot.run("systemctl", "start", SERVICE, timeout_s=900.0)
    ready_s = time.monotonic() - began
    first_path_s = float(robot.run(PYTHON, "-c", FIRST_PATH, timeout_s=120.0).stdout)
    pid = robot.run("systemctl", "show", "--value", "--property=MainPID", SERVICE).stdout.strip()
    status = robot.run("cat", f"/proc/{pid}/status").stdout
    peak_mb = int(status.partition("VmHWM:")[2].split()[0]) * 1024 / 1e6
    return {"ready_s": ready_s, "first_path_s": first_path_s, "peak_mb": peak_mb}


def _harmed(robot: Robot) -> dict[str, float]:
    """Change a byte of one kernel; the service says so, compiles it again, and plans."""
    change = f"file=$(find {CACHE} -name '*.nbc' | head -n 1) && printf x >>$file && echo $file"
    file = Path(robot.run("sh", "-c", change).stdout.strip())
    figures = _started(robot)
    journal = robot.run("journalctl", "--unit", SERVICE, "--output", "cat", "--no-pager").stdout
    assert f"{file.name} is damaged" in journal, journal
    assert "kernels compiled in" in journal, journal
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
