"""Who listens, and how badly, must not matter to the planner."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

from fasaco_edge.bus.session import open_bus
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.config.security import BusConfig
from fasaco_edge.daemon import supervisor
from tests.support.outsider import Outsider, joined_daemon
from tests.support.processes import daemon_process, free_endpoint
from tests.support.rooms import fill, map_bytes, odometry_bytes, pose_bytes, room

RECORDING = "recording"


def plan_times(outsider, count, first_revision):
    path = outsider.listen("path")
    outsider.put("pose", pose_bytes(0.75, 0.75))
    seconds = []
    for number in range(count):
        # A wall that grows, so that each map loses cells.
        length = 0.5 + 0.3 * (first_revision + number)
        pixels = fill(room(15.0, 15.0), 6.0, 0.0, 6.2, length, 100)
        since = len(path.heard)
        sent = time.monotonic()
        outsider.put("map", map_bytes(pixels, stamp_ns=1000 + first_revision + number))
        stamp = f'"map_stamp_ns":{1000 + first_revision + number},'.encode()
        path.wait(lambda heard, stamp=stamp: stamp in heard.attachment, since)
        seconds.append(time.monotonic() - sent)
    return seconds


def test_a_frozen_subscriber_does_not_hold_the_planner(daemon, outsider):
    plan_times(outsider, 1, 0)  # brings the kernels along
    free = plan_times(outsider, 5, 1)
    command = [sys.executable, "-m", "tests.support.outsider", daemon.endpoint]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as listener:
        try:
            assert listener.stdout.readline() == b"listening\n"
            listener.send_signal(signal.SIGSTOP)
            held = plan_times(outsider, 12, 6)
        finally:
            listener.kill()
    print(f"map to path [ms]: free {1e3 * max(free):.0f}, held {1e3 * max(held):.0f}")
    # The lease of a frozen session ends after ten seconds: nothing waited for that.
    assert max(held) < 10 * max(free) + 5.0
    assert outsider.ask_status()["errors"]["total"] == 0


def wait_recorder(outsider, state, **more):
    def holds(status):
        said = status["recorder"] or {}
        return said.get("state") == state and all(said.get(k) == v for k, v in more.items())

    return outsider.wait_status(holds)["recorder"]


def test_a_killed_recorder_restarts_and_planning_continues(tmp_path):
    pytest.importorskip("rerun")
    with joined_daemon(tmp_path, "--record", str(tmp_path)) as (_, outsider):
        plan_times(outsider, 1, 0)
        first = wait_recorder(outsider, RECORDING)
        assert first["restarts"] == 0
        os.kill(first["pid"], signal.SIGKILL)
        gone = wait_recorder(outsider, "restarting")
        assert gone["reason"] == "died by signal 9"
        assert len(plan_times(outsider, 3, 1)) == 3
        again = wait_recorder(outsider, RECORDING, restarts=1)
        assert again["pid"] != first["pid"]
        assert again["malformed"] == 0
        plan_times(outsider, 1, 4)
    assert len(list(tmp_path.glob("*.rrd"))) >= 2


def test_a_slow_recorder_gets_time_to_start_but_a_hung_one_ends(tmp_path, monkeypatch):
    """On a slow computer its libraries alone take longer than a hang may last."""
    pytest.importorskip("rerun")
    monkeypatch.setattr(supervisor, "SILENT_AFTER_S", 0.05)
    endpoint = free_endpoint()
    config = DaemonConfig(bus=BusConfig(mode="router", listen=(endpoint,)))
    with open_bus(config.bus.settings(config.keys().prefix)) as bus:
        watched = supervisor.RecorderSupervisor(config, bus, tmp_path)
        try:
            states = [watched.poll(time.monotonic())]
            # Its words come more than 0.05 s apart: after the first, it counts as hanging.
            while states[-1].state not in ("silent", "restarting"):
                time.sleep(0.01)
                states.append(watched.poll(time.monotonic()))
        finally:
            watched.close(60.0, 60.0)
    assert {"starting", "recording"} <= {state.state for state in states}
    assert states[-1].reason == "no status for 0 s"


def test_the_recorder_takes_untyped_poses_as_the_daemon_does(tmp_path):
    pytest.importorskip("rerun")
    with (
        daemon_process(
            tmp_path, "--record", str(tmp_path), pose={"schema": "nav_msgs/msg/Odometry"}
        ) as running,
        Outsider(running.endpoint) as outsider,
    ):
        wait_recorder(outsider, RECORDING)
        for _ in range(3):
            outsider.put("pose", odometry_bytes(0.75, 0.75), "")
        outsider.put("map", map_bytes(room(3.0, 3.0)))
        outsider.wait_status(lambda status: status["state"] == "covering")
        before = outsider.ask_status()["recorder"]["messages"]
        said = outsider.wait_status(lambda status: status["recorder"]["messages"] > before + 3)
        assert said["recorder"]["malformed"] == 0
