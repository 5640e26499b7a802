"""A robot made with a library of somebody else, zenoh-ros2-sdk from PyPI, is served by the daemon.

It runs in the Python that $ZENOH_ROS2_SDK_PYTHON names, by default this one; without it the test
is skipped.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.support.outsider import Outsider
from tests.support.processes import daemon_process
from tests.support.ros_robot import GRID, PATH
from tests.wire import oracle

PYTHON = os.environ.get("ZENOH_ROS2_SDK_PYTHON", sys.executable)
ROBOT = Path(__file__).parents[1] / "support" / "ros2_sdk_robot.py"
HAS_SDK = subprocess.run([PYTHON, "-c", "import zenoh_ros2_sdk"], capture_output=True, check=False)


@pytest.mark.skipif(HAS_SDK.returncode != 0, reason="zenoh-ros2-sdk is not installed")
def test_a_robot_with_a_third_party_library_gets_its_path(tmp_path):
    with (
        daemon_process(tmp_path, ros2={"kind": "rmw_zenoh", "domain": 3}) as running,
        Outsider(running.endpoint) as native,
    ):
        port = running.endpoint.rpartition(":")[2]
        command = [PYTHON, str(ROBOT), port, "3", str(tmp_path / "messages")]
        ended = subprocess.run(command, capture_output=True, text=True, check=False, timeout=90)
        assert ended.returncode == 0, ended.stderr
        found = json.loads(ended.stdout.splitlines()[-1])
        print(json.dumps({**found, "path": {**found["path"], "xy": len(found["path"]["xy"])}}))
        assert found["topics"] == {
            "/map": [GRID],
            "/map_updates": ["map_msgs/msg/OccupancyGridUpdate"],
            "/battery_state": ["sensor_msgs/msg/BatteryState"],
            "/floor_priority": [GRID],
            "/tf": ["tf2_msgs/msg/TFMessage"],
            "/tf_static": ["tf2_msgs/msg/TFMessage"],
            "/coverage_path": [PATH],
            "/coverage_grid": [GRID],
            "/diagnostics": ["diagnostic_msgs/msg/DiagnosticArray"],
        }
        assert found["publishers"] == [["/", "fasaco_edge"]]
        path = oracle.from_bytes(PATH, native.ask("path").payload)
        ours = [[pose.pose.position.x, pose.pose.position.y] for pose in path.poses]
        np.testing.assert_allclose(found["path"]["xy"], ours)
        assert len(ours) > 50
        assert np.hypot(*np.subtract(ours[0], 1.0)) < 0.5
        assert found["path"]["stamp"] == [7, 1]
        assert found["path"]["frame"] == found["grid"]["frame"] == "map"
        assert found["grid"]["resolution"] == 0.3
        assert {0, 100} <= set(found["grid"]["values"]) <= {-1, 0, 50, 75, 100}
