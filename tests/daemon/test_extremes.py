"""Legal, but more than can be said or done: it costs a fault and never the daemon."""

from __future__ import annotations

import sys

import numpy as np

from fasaco_edge.bus.session import BusSettings, open_bus
from fasaco_edge.daemon.config import DaemonConfig
from fasaco_edge.daemon.supervisor import FIRST_PAUSE_S, RecorderSupervisor
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from tests.daemon.outsider import Outsider
from tests.daemon.processes import daemon_process, free_endpoint
from tests.daemon.rooms import map_bytes, pillared_room, pose_bytes
from tests.wire import oracle


def test_a_path_beyond_the_protocol_s_coordinates_is_a_fault(tmp_path):
    """Map and pose lie just inside the limit, the path's last cells just outside."""
    free = np.zeros((40, 100), np.int8)
    geometry = GridGeometry(40, 100, 0.05, Pose2D(999_996.0, 0.0))
    grid = oracle.occupancy_grid("map", 1, geometry, free)
    payload = oracle.to_bytes("nav_msgs/msg/OccupancyGrid", grid)
    with daemon_process(tmp_path) as daemon, Outsider(daemon.endpoint) as client:
        client.put("map", payload)
        client.put("pose", pose_bytes(999_997.0, 1.0))
        status = client.wait_status(lambda status: status["errors"]["total"] > 0)
        assert "must be within 1e+06 m" in status["errors"]["last"]
        client.put("map", map_bytes(pillared_room()))
        client.put("pose", pose_bytes(0.75, 0.75))
        client.wait_status(lambda status: (status["path"] or {}).get("steps", 0) > 10)


def test_a_recorder_that_cannot_be_started_is_tried_again(tmp_path, monkeypatch):
    config = DaemonConfig()
    with open_bus(BusSettings("peer", (), (free_endpoint(),))) as bus:
        monkeypatch.setattr(sys, "executable", str(tmp_path / "no-python"))
        recorder = RecorderSupervisor(config, bus, tmp_path)
        state = recorder.poll(100.0)
        assert state["state"] == "restarting"
        assert "could not be started" in state["reason"]
        assert recorder.poll(100.0 + 2 * FIRST_PAUSE_S)["restarts"] == 1
        recorder.close(1.0)
