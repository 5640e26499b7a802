"""A library of somebody else, zenoh-ros2-sdk from PyPI, lists and decodes what the daemon offers.

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

from fasaco_edge.grid.geometry import Pose2D
from tests.daemon.outsider import Outsider
from tests.daemon.processes import daemon_process
from tests.daemon.rooms import map_bytes, pillared_room
from tests.daemon.ros_robot import GRID, PATH, Naming, ros_robot
from tests.wire import oracle

PYTHON = os.environ.get("ZENOH_ROS2_SDK_PYTHON", sys.executable)
LISTENER = Path(__file__).with_name("ros2_sdk_listener.py")
HAS_SDK = subprocess.run([PYTHON, "-c", "import zenoh_ros2_sdk"], capture_output=True, check=False)
NAMING = Naming(3)


@pytest.mark.skipif(HAS_SDK.returncode != 0, reason="zenoh-ros2-sdk is not installed")
def test_a_library_of_somebody_else_lists_and_decodes_what_is_offered(tmp_path):
    with (
        daemon_process(tmp_path, ros2={"kind": "rmw_zenoh", "domain": 3}) as running,
        ros_robot(running.endpoint, NAMING) as robot,
        Outsider(running.endpoint) as native,
    ):
        robot.put("map", GRID, map_bytes(pillared_room()), latched=True)
        robot.put_tf("map", "base_link", Pose2D(1.0, 1.0))
        native.wait_status(lambda status: status["state"] == "covering")
        native.listen("coverage").wait(lambda heard: True)
        port = running.endpoint.rpartition(":")[2]
        command = [PYTHON, str(LISTENER), port, "3", str(tmp_path / "messages")]
        ended = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
        assert ended.returncode == 0, ended.stderr
        found = json.loads(ended.stdout.splitlines()[-1])
        print(json.dumps({**found, "path": {**found["path"], "xy": len(found["path"]["xy"])}}))
        assert found["topics"] == {
            "/map": [GRID],
            "/map_updates": ["map_msgs/msg/OccupancyGridUpdate"],
            "/tf": ["tf2_msgs/msg/TFMessage"],
            "/tf_static": ["tf2_msgs/msg/TFMessage"],
            "/coverage_path": [PATH],
            "/coverage_grid": [GRID],
        }
        assert found["publishers"] == [["/", "fasaco_edge"]]
        path = oracle.from_bytes(PATH, native.ask("path").payload)
        ours = [[pose.pose.position.x, pose.pose.position.y] for pose in path.poses]
        np.testing.assert_allclose(found["path"]["xy"], ours)
        assert found["path"]["frame"] == found["grid"]["frame"] == "map"
        assert found["grid"]["resolution"] == 0.3
        assert {0, 100} <= set(found["grid"]["values"]) <= {-1, 0, 50, 75, 100}
