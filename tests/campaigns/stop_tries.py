"""A follower stops in time, whatever it is that fails.

    python -m tests.campaigns.stop_tries --tries 1000 [--stages 3]

Takes a quarter of an hour.

A follower in a process of its own drives a base along a path; then one thing fails, chosen at
random, and it is measured how long after that the last velocity but zero came. What fails: poses
stay away, are none, jump, or are in another frame; the path becomes empty or is none; the daemon's
token goes, its process is killed or frozen, alone or beside another daemon; the follower is asked
to end. For poses that stay away the time counts from when the newest is too old, for a frozen
daemon from when it is too silent.
Exit code 1 where one took longer than 0.2 s.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from fasaco_edge.grid.geometry import Pose2D
from tests.campaigns.services import show
from tests.support.driven_base import DrivenBase, follower_process
from tests.support.processes import ENVIRONMENT

LIMIT_S = 0.2
POSE_AGE_S = 0.5
SILENT_S = 2.5


class Stage:
    """A base, and a follower that drives it."""

    def __init__(self, folder: Path) -> None:
        self.base = DrivenBase()
        self.base.plans()
        self.log = folder / "follower.log"
        self.process: subprocess.Popen[bytes] | None = None
        self._running = follower_process(self.base.endpoint, self.log)
        self.begin()

    def begin(self) -> None:
        """Start the follower."""
        self._running = follower_process(self.base.endpoint, self.log)
        self.process = self._running.__enter__()

    def end(self) -> None:
        """End the follower."""
        self._running.__exit__(None, None, None)

    def drive(self, rng: random.Random) -> None:
        """Have the robot drive along a path from where it is."""
        base = self.base
        base.says_poses = base.says_status = True
        base.frame = "map"
        x, y, yaw = base.pose.x, base.pose.y, base.pose.yaw
        ahead = (x + 5.0 * np.cos(yaw), y + 5.0 * np.sin(yaw))
        base.send_path((x, y), ahead, (ahead[0], ahead[1] + 5.0))
        base.wait_until_it_moves()
        time.sleep(rng.uniform(0.0, 0.3))


@contextmanager
def other_daemon(stage: Stage) -> Iterator[subprocess.Popen[bytes]]:
    """Let another process be the daemon."""
    words = [sys.executable, "-m", "tests.support.driven_base", stage.base.endpoint]
    with subprocess.Popen(words, stdout=subprocess.PIPE, env=ENVIRONMENT) as daemon:
        assert daemon.stdout is not None
        assert daemon.stdout.readline() == b"plans\n"
        stage.base.plans(False)
        stage.base.daemon = "b2"
        try:
            # Another daemon has another path, and is trusted from its second status on.
            stage.base.stopped_after(time.monotonic())
            stage.drive(random.Random(0))
            yield daemon
        finally:
            daemon.kill()
            stage.base.plans()


def poses_stay_away(stage: Stage) -> float:
    """The newest pose becomes too old."""
    stage.base.says_poses = False
    time.sleep(0.06)
    return stage.base.stopped_after(stage.base.last_pose_at + POSE_AGE_S)


def pose_is_none(stage: Stage) -> float:
    """A pose of NaN, and no other."""
    stage.base.says_poses = False
    time.sleep(0.06)
    payload = bytes.fromhex("00010000") + bytes(8) + b"\x04\0\0\0map\0" + b"\xff" * 56
    return stage.base.stopped_after(stage.base.send_raw_pose(payload))


def pose_jumps(stage: Stage) -> float:
    """The pose is suddenly elsewhere."""
    here = stage.base.pose
    stage.base.pose = Pose2D(here.x + 3.0, here.y + 2.0, here.yaw)
    time.sleep(0.06)
    return stage.base.stopped_after(stage.base.last_pose_at)


def frame_changes(stage: Stage) -> float:
    """Poses are in another frame."""
    stage.base.frame = "odom"
    time.sleep(0.06)
    return stage.base.stopped_after(stage.base.last_pose_at)


def path_becomes_empty(stage: Stage) -> float:
    """As the daemon says when it is paused, or done."""
    return stage.base.stopped_after(stage.base.send_path())


def path_is_none(stage: Stage) -> float:
    """A path that cannot be read."""
    return stage.base.stopped_after(stage.base.send_raw_path(b"\0\1\0\0rubbish"))


def token_goes(stage: Stage) -> float:
    """The daemon plans no more."""
    since = time.monotonic()
    stage.base.plans(False)
    stopped = stage.base.stopped_after(since)
    stage.base.plans()
    return stopped


def daemon_is_killed(stage: Stage) -> float:
    """kill -9."""
    with other_daemon(stage) as daemon:
        since = time.monotonic()
        daemon.kill()
        return stage.base.stopped_after(since)


def daemon_is_frozen(stage: Stage) -> float:
    """kill -STOP: its token stays."""
    with other_daemon(stage) as daemon:
        since = time.monotonic()
        daemon.send_signal(signal.SIGSTOP)
        return stage.base.stopped_after(since + SILENT_S)


def daemon_is_frozen_beside_another(stage: Stage) -> float:
    """kill -STOP, while a daemon that waits publishes its status."""
    stage.base.has_second = True
    try:
        return daemon_is_frozen(stage)
    finally:
        stage.base.has_second = False


def follower_ends(stage: Stage) -> float:
    """As by `systemctl stop`."""
    assert stage.process is not None
    since = time.monotonic()
    stage.process.terminate()
    stopped = stage.base.stopped_after(since)
    assert stage.process.wait(30) == 0
    stage.end()
    stage.begin()
    return stopped


CAUSES: dict[Callable[[Stage], float], float] = {
    poses_stay_away: 3.0,
    pose_is_none: 3.0,
    pose_jumps: 2.0,
    frame_changes: 2.0,
    path_becomes_empty: 3.0,
    path_is_none: 2.0,
    token_goes: 3.0,
    daemon_is_killed: 1.0,
    daemon_is_frozen: 0.5,
    daemon_is_frozen_beside_another: 0.5,
    follower_ends: 0.5,
}
"""How often each is tried, beside the others."""


def run_tries(tries: int, seed: int, each: bool = False) -> list[tuple[str, float]]:
    """Return what failed and how long the follower took to stop [s]; ``each``: all in turn."""
    rng = random.Random(seed)
    causes = list(CAUSES)
    with tempfile.TemporaryDirectory() as folder:
        stage = Stage(Path(folder))
        try:
            done = []
            for number in range(tries):
                stage.drive(rng)
                (cause,) = rng.choices(causes, list(CAUSES.values()))
                cause = causes[number % len(causes)] if each else cause
                done.append((cause.__name__, cause(stage)))
            return done
        finally:
            stage.end()
            stage.base.close()


def main() -> int:
    """Run the campaign."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--tries", type=int, default=1000)
    parser.add_argument("--stages", type=int, default=3, help="tried at a time")
    args = parser.parse_args()
    shares = [len(range(stage, args.tries, args.stages)) for stage in range(args.stages)]
    with multiprocessing.get_context("spawn").Pool(args.stages) as pool:
        parts = pool.starmap(run_tries, [(n, seed) for seed, n in enumerate(shares)])
    done = [one for part in parts for one in part]
    for name in sorted({name for name, _ in done}):
        took = np.array([seconds for one, seconds in done if one == name])
        show(
            f"{name:20} {len(took):5} tries, median {np.median(took):.3f} s, "
            f"p99 {np.quantile(took, 0.99):.3f} s, most {took.max():.3f} s"
        )
    late = [one for one in done if one[1] > LIMIT_S]
    print(json.dumps({"tries": len(done), "late": late, "most_s": max(s for _, s in done)}))
    return 1 if late else 0


if __name__ == "__main__":
    sys.exit(main())
