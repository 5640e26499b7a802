"""A viewer that joins late sees the mission; where nobody may listen it is said."""

from __future__ import annotations

import socket
import subprocess
import sys
import time

import pytest

pytest.importorskip("rerun")

from fasaco_edge.errors import BadConfiguration
from fasaco_edge.host.addresses import free_port
from fasaco_edge.recording.write.streams import serve_live
from tests.support.recordings import bus_on_free_port, recorder_process
from tests.support.scripted_mission import Mission


def test_a_client_that_joins_late_reads_what_was_logged(tmp_path):
    port, copy = free_port(), tmp_path / "copy.rrd"
    with (
        bus_on_free_port() as (bus, endpoint),
        recorder_process(bus, endpoint, tmp_path / "runs", serve=("127.0.0.1", port)) as recorder,
    ):
        mission = Mission(bus)
        for _ in mission.frames(20):
            time.sleep(0.02)
        recorder.written(30)
        with socket.create_connection(("127.0.0.1", port), timeout=5):
            pass
        command = [sys.executable, "-m", "rerun", "--save", str(copy)]
        viewer = subprocess.Popen([*command, f"rerun+http://127.0.0.1:{port}/proxy"])
        try:
            deadline = time.monotonic() + 120
            while not (copy.exists() and b"world" in copy.read_bytes()):
                assert viewer.poll() is None
                assert time.monotonic() < deadline
                time.sleep(0.1)
        finally:
            viewer.kill()
            viewer.wait()


def test_an_address_that_is_taken_is_refused():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        with pytest.raises(BadConfiguration, match="cannot serve at"):
            serve_live("run", *other.getsockname())
