"""Installation, start, upgrade, plan and mission on emulated arm64, compared with this machine.

    python -m tests.campaigns.arm64 FOLDER [--without-recording] [--only mission]

Takes hours.

Needs root and, the first time, the network: FOLDER then holds a tree of Debian for arm64 and the
release folder that is installed in it, 3 GB. To compile the kernels there takes an hour. Everything
runs under emulation (QEMU, Cortex-A72): the seconds say nothing of a real one, the results do. A
plan has to be the same, bit for bit, as this machine's. Exit code 1 where something differs or
fails, 77 where it cannot run.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from tests.campaigns.emulated import Tree, make_release, why_not
from tests.deploy.installed import CHECKOUT
from tests.support.rooms import map_bytes, pillared_room, pose_bytes

CANNOT_RUN = 77
PROGRAM = "/usr/local/bin/fasaco-edge"
CURRENT = "/opt/fasaco-edge/current"
# From the start to READY=1, and from a first map and pose to the first path [s].
COLD = """\
import os, socket, subprocess, sys, time
sys.path.insert(0, "/srv/checkout")
from pathlib import Path
from tests.support.outsider import Outsider
manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
manager.bind("/tmp/cold/notify")
began = time.monotonic()
daemon = subprocess.Popen(
    ["/usr/local/bin/fasaco-edge", "run", "--state", "/tmp/cold/state"],
    env=os.environ | {"NOTIFY_SOCKET": "/tmp/cold/notify"},
)
while b"READY=1" not in manager.recv(4096):
    pass
ready = time.monotonic() - began
with Outsider("tcp/127.0.0.1:7447") as outsider:
    path = outsider.listen("path")
    began = time.monotonic()
    for key in ("map", "pose"):
        outsider.put(key, Path("/srv/samples", key).read_bytes())
    path.wait(lambda heard: len(heard.payload) > 100)
    first = time.monotonic() - began
daemon.terminate()
daemon.wait()
print(f"{ready:.1f} s to READY, {first:.1f} s from the first map to the first path")
"""
# A fixed amount of work each: ants walk to their end, no clock decides.
PLANS = {
    "colony alone": ("basement", "--planner", "fasaco", "--ants", "60", "--turn-s", "1.5"),
    "local search": ("flat", "--budget", "1e5", "--ants", "40", "--turn-s", "1.5"),
    "local search, larger": ("basement", "--budget", "1e5", "--ants", "8", "--turn-s", "1.5"),
    "spiral-stc": ("office", "--planner", "spiral-stc"),
}
# What the clock says of a plan.
CLOCKED = ("wall_s", "cpu_s", "first_walk_ms")
# The last answer stands in the end, whatever became of the daemon since.
MISSION = """\
cd /tmp && rm -rf state && exec 2>mission.log
fasaco-edge run --state state & daemon=$!
sleep 20
fasaco-edge simulate office --speed 4 >drove & robot=$!
for turn in $(seq 120); do
    sleep 4
    fasaco-edge ask status --json --timeout 30 >asked && mv asked status
    grep --only-matching '"coverage":{[^}]*}' status >&2
    grep --quiet '"state":"done"' status && break
    kill -0 $daemon || break
done
kill $robot; kill $daemon; wait $daemon; echo "daemon ended with $?" >&2
cat status
"""


def main() -> int:
    """Run the steps, and print a table."""
    args = _parser().parse_args()
    if reason := why_not():
        print(f"skipped: {reason}")
        return CANNOT_RUN
    tree = Tree(args.folder)
    tree.make()
    steps: dict[str, Callable[[Tree], str]] = {
        "install": lambda tree: install(tree, args.folder, args.without_recording),
        "doctor": doctor,
        "kernels": kernels,
        "upgrade": lambda tree: upgrade(tree, args.folder, args.without_recording),
        "cold": cold,
        "plans": plans,
        "mission": mission,
    }
    failed = False
    for name in args.only or steps:
        started = time.monotonic()
        try:
            told = steps[name](tree)
        except AssertionError as error:
            told, failed = f"FAILED: {error}", True
        print(f"{name}: {time.monotonic() - started:.0f} s: {told}", flush=True)
    return 1 if failed else 0


def install(tree: Tree, folder: Path, without_recording: bool) -> str:
    """Install from a release folder, without a network and without a running systemd."""
    releases = folder / "releases"
    if not releases.exists():
        make_release(releases)
    _lay(tree, releases, "first")
    _install(tree, "first", without_recording)
    again = _install(tree, "first", without_recording)
    assert again.startswith("nothing to do"), again
    sizes = _checked(tree, "du", "-sm", "/opt/fasaco-edge/").stdout.split()[0]
    return f"{sizes} MB, a second time there is nothing to do"


def _lay(tree: Tree, releases: Path, name: str) -> None:
    release = next(releases.glob("fasaco-edge-*"))
    shutil.copytree(release, tree.root / "srv" / name, dirs_exist_ok=True)


def _install(tree: Tree, name: str, without_recording: bool, *words: str) -> str:
    more = ["--without-recording"] if without_recording and not words else []
    return _checked(tree, f"/srv/{name}/install.sh", "--no-start", *more, *words).stdout


def doctor(tree: Tree) -> str:
    """Let doctor look at it."""
    return "\n" + _checked(tree, PROGRAM, "doctor", codes=(0, 1)).stdout


def kernels(tree: Tree) -> str:
    """Compile the kernels, which takes an hour, unless they are there."""
    return _checked(tree, PROGRAM, "warmup").stderr.strip()


def upgrade(tree: Tree, folder: Path, without_recording: bool) -> str:
    """Upgrade to the same release with another example, roll back, and upgrade again."""
    _lay(tree, folder / "releases", "second")
    with (tree.root / "srv/second/fasaco-edge.yaml").open("a") as example:
        example.write("# another\n")
    took = []
    for words in ((), ("--rollback",), ()):
        started = time.monotonic()
        _install(tree, "second", without_recording, *words)
        took.append(f"{time.monotonic() - started:.0f}")
    return f"upgrade, rollback, upgrade again in {', '.join(took)} s"


def cold(tree: Tree) -> str:
    """Start with the kernels compiled."""
    shutil.copytree(CHECKOUT / "tests", tree.root / "srv/checkout/tests", dirs_exist_ok=True)
    samples = tree.root / "srv/samples"
    samples.mkdir(exist_ok=True)
    (samples / "map").write_bytes(map_bytes(pillared_room()))
    (samples / "pose").write_bytes(pose_bytes(1.0, 1.0))
    start = ("rm -rf /tmp/cold && mkdir /tmp/cold && exec "
             f"{CURRENT}/bin/python -c '{COLD}'")  # fmt: skip
    return _checked(tree, "bash", "-c", start).stdout.strip()


def plans(tree: Tree) -> str:
    """Plan here and there."""
    told = []
    for name, words in PLANS.items():
        command = ["plan", *words, "--seed", "3", "--json", "--path-out", "/tmp/fasaco-walk.csv"]
        there = json.loads(_checked(tree, PROGRAM, *command).stdout)
        walk = (tree.root / "tmp/fasaco-walk.csv").read_bytes()
        here = json.loads(_here(command))
        took = f"{there['wall_s']:.2f} s, here {here['wall_s']:.2f} s"
        for clocked in CLOCKED:
            here.pop(clocked), there.pop(clocked)
        assert walk == Path("/tmp/fasaco-walk.csv").read_bytes(), f"{name}: the walks differ"
        differing = [key for key in here if here[key] != there[key]]
        assert not differing, f"{name}: the same walk, but other {differing}"
        told.append(f"{name}: {here['steps']} steps, {here['kicks']} kicks, equal ({took})")
    return "; ".join(told)


def mission(tree: Tree) -> str:
    """Let a simulated robot map and cover a room with the daemon."""
    done = tree.run("bash", "-c", MISSION)
    said = (tree.root / "tmp/mission.log").read_text()
    assert done.stdout, said[-2000:]
    status = json.loads(done.stdout)
    assert "daemon ended with 0" in said, said[-2000:]
    assert status["state"] == "done", f"{status}\n{said[-2000:]}"
    return f"{status['coverage']}, {status['plan']}, {status['latency_ms']}"


def _here(command: list[str]) -> str:
    words = [sys.executable, "-m", "fasaco_edge", *command]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout


def _checked(
    tree: Tree, *words: str, codes: tuple[int, ...] = (0,)
) -> subprocess.CompletedProcess[str]:
    done = tree.run(*words)
    told = f"{' '.join(words)} ended with {done.returncode}:\n{(done.stdout + done.stderr)[-3000:]}"
    assert done.returncode in codes, told
    return done


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="fasaco_edge on emulated arm64.")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="made once, then used again")
    parser.add_argument("--without-recording", action="store_true", help="install without Rerun")
    parser.add_argument(
        "--only",
        action="append",
        choices=("install", "doctor", "kernels", "upgrade", "cold", "plans", "mission"),
        help="this step alone; may be repeated",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
