"""Before the first map: small, reachable, and beside others."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from fasaco_edge.host.processes import own_mb
from tests.support.outsider import Outsider, joined_daemon
from tests.support.processes import Daemon, daemon_process, mapped_files
from tests.support.rooms import pillared_room, pose_bytes, show_room

# Memory of its own at most, without pages of files [MB].
IDLE_MB = 32.0


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    with daemon_process(tmp_path_factory.mktemp("daemon"), executed=True) as running:
        yield running


@pytest.fixture(scope="module")
def waiting(daemon: Daemon) -> Daemon:
    with Outsider(daemon.endpoint) as outsider:
        outsider.wait_status(lambda status: status["state"] == "waiting for map")
    return daemon


def test_it_is_ready_when_its_token_stands(tmp_path):
    started = time.monotonic()
    with joined_daemon(tmp_path, executed=True) as (running, outsider):
        print(f"ready {1e3 * (time.monotonic() - started):.0f} ms after its start")
        assert "ready after" in running.log_text()
        running.stop()
        assert not outsider.alive(timeout_s=0.5)


def test_neither_compiler_nor_viewer_is_loaded(waiting):
    mapped = mapped_files(waiting.pid)
    assert [name for name in ("numba", "llvmlite", "rerun", "PIL") if name in mapped] == []


def test_it_is_small(waiting):
    resident = own_mb(waiting.pid)
    print(f"idle: {resident:.1f} MB")
    assert resident < IDLE_MB


def wakes(pid):
    lines = Path(f"/proc/{pid}/task/{pid}/status").read_text().splitlines()
    (line,) = (line for line in lines if line.startswith("voluntary_ctxt_switches"))
    return int(line.split()[1])


def test_an_idle_daemon_uses_little_processor_time(waiting):
    before, since = wakes(waiting.pid), time.monotonic()
    time.sleep(4.0)
    each_s = (wakes(waiting.pid) - before) / (time.monotonic() - since)
    print(f"idle: wakes {each_s:.1f} times a second")
    assert each_s < 5.0


def test_poses_and_broken_samples_do_not_wake_it(waiting):
    with Outsider(waiting.endpoint) as outsider:
        outsider.put("pose", pose_bytes(1.0, 1.0))
        outsider.put("pose", b"no pose")
        outsider.put("map", b"no map")
        status = outsider.wait_status(lambda status: status["errors"]["total"] == 2)
    assert status["errors"]["by_code"] == {"malformed_message": 2}
    assert status["state"] == "waiting for map"
    assert "numba" not in mapped_files(waiting.pid)


def test_a_second_robot_joins_where_one_listens(daemon, tmp_path):
    bus = {"listen": [daemon.endpoint]}
    with daemon_process(tmp_path, bus=bus, robot={"name": "second"}) as second:
        first_client, client = Outsider(daemon.endpoint), Outsider(daemon.endpoint, "second")
        with first_client, client:
            client.wait_status(lambda status: status["robot"] == "second")
            assert client.alive()
            assert first_client.ask_status()["robot"] == "robot"
            path, other_path = client.listen("path"), first_client.listen("path")
            show_room(client, pillared_room(), 1.0, 1.0)
            path.wait(lambda heard: len(heard.payload) > 100)
            assert other_path.heard == []
            assert first_client.ask_status()["map"] is None
        second.stop()
    with Outsider(daemon.endpoint) as first_client:
        assert first_client.ask_status()["robot"] == "robot"
        assert daemon.process.poll() is None
