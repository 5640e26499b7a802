"""Legal, but more than can be said or done: it costs a fault and never the daemon."""

from __future__ import annotations

import sys

from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.supervisor import FIRST_PAUSE_S, RecorderSupervisor
from tests.support.processes import free_endpoint


def test_a_recorder_that_cannot_be_started_is_tried_again(tmp_path, monkeypatch):
    config = DaemonConfig()
    with open_bus(BusSettings("peer", (), (free_endpoint(),))) as bus:
        monkeypatch.setattr(sys, "executable", str(tmp_path / "no-python"))
        recorder = RecorderSupervisor(config, bus, tmp_path)
        state = recorder.poll(100.0)
        assert state.state == "restarting"
        assert "could not be started" in state.reason
        assert recorder.poll(100.0 + 2 * FIRST_PAUSE_S).restarts == 1
        recorder.close(1.0, 1.0)
