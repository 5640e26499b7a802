"""A real daemon is started, looked into and ended."""

import os
from pathlib import Path

import pytest

from fasaco_edge.bench.processes import DaemonProcess
from fasaco_edge.errors import ProcessEnded
from fasaco_edge.host.processes import resident_mb


def test_daemon_is_gone_after_the_block():
    with DaemonProcess() as daemon:
        bus = daemon.join()
        assert 0.0 < daemon.wait_alive(bus) <= daemon.wait_status(bus)
        pid = daemon.pid
        assert Path(f"/proc/{pid}").exists()
    assert not Path(f"/proc/{pid}").exists()


def test_daemon_that_ends_by_itself_says_why():
    with (
        DaemonProcess({"planner": {"ants": 0}}) as daemon,
        pytest.raises(ProcessEnded, match=r"planner\.ants"),
    ):
        daemon.join()


def test_a_process_without_memory_has_none():
    child = os.fork()
    if child == 0:
        os._exit(0)
    os.waitid(os.P_PID, child, os.WEXITED | os.WNOWAIT)
    assert resident_mb(child) == 0.0
    os.waitpid(child, 0)
