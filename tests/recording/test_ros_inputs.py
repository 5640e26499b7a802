"""What a mission hears on ROS 2 topics is recorded as what it hears by the native keys."""

from __future__ import annotations

import json
from collections import Counter

import numpy as np
import pytest

pytest.importorskip("rerun")

from fasaco_edge.cli.record import ros_config
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.recording import entities
from fasaco_edge.recording.read.run import RecordedSamples
from fasaco_edge.replay.replay import Replay, read_run
from fasaco_edge.review.review import read_review
from fasaco_edge.wire.schemas import OCCUPANCY_GRID, TF_MESSAGE
from tests.support.outsider import joined_daemon
from tests.support.recordings import read_summary
from tests.support.rooms import map_bytes, pillared_room
from tests.support.ros_robot import GRID, Naming, ros_robot

WAY = [(0.75 + 0.05 * step, 0.75) for step in range(20)]


@pytest.mark.parametrize("domain", [None, 0], ids=["bridge", "rmw_zenoh"])
def test_maps_and_transforms_are_in_the_recording(domain, tmp_path):
    naming = Naming(domain, "/robot1")
    kind = "bridge" if domain is None else "rmw_zenoh"
    ros2 = {"kind": kind, "namespace": "/robot1", "frames": {"map": "map", "robot": "body"}}
    out = tmp_path / "runs"
    with (
        joined_daemon(tmp_path, "--record", str(out), ros2=ros2) as (running, native),
        ros_robot(running.endpoint, naming) as robot,
    ):
        robot.put("map", GRID, map_bytes(pillared_room()), latched=True)
        robot.put_tf("odom", "body", Pose2D(0.0, 0.0, 0.0), topic="tf_static")
        # What it joined late for comes when it asks for that: the map and the static transform.
        native.wait_status(lambda status: (status["recorder"] or {}).get("messages", 0) >= 2)
        for x, y in WAY:
            robot.put_tf("map", "odom", Pose2D(x, y, 0.0))
        native.wait_status(lambda status: status["path"] is not None)
        # What was heard is written once a second.
        messages = native.ask_status()["recorder"]["messages"]
        native.wait_status(lambda status: status["recorder"]["messages"] > messages)
        running.stop()
    parts = sorted(out.glob("*.rrd"))
    samples = list(RecordedSamples(parts))
    topics = Counter((sample.topic, sample.sample.schema) for sample in samples)
    assert topics["map", OCCUPANCY_GRID] == 1
    assert topics["tf_static", TF_MESSAGE] == 1
    assert topics["pose", TF_MESSAGE] == len(WAY)
    assert read_summary(parts[0]).rows[entities.ROBOT] >= len(WAY) - 1
    story = read_review(parts).data
    assert story.grid is not None
    assert np.allclose([pose[:2] for pose in story.poses], WAY)
    assert not story.undecodable
    # A replay without the turn log finds the pose, too: by static transforms.
    run = read_run(samples)
    replay = Replay(run.daemon_config(), run.ready_ns, work=0)
    assert [step for step in replay.steps(samples) if step.refused] == []
    assert replay.mission.pose is not None
    assert np.allclose((replay.mission.pose.pose.x, replay.mission.pose.pose.y), WAY[-1])


def test_the_block_is_read_as_the_daemon_reads_it():
    config = ros_config(json.dumps({"kind": "rmw_zenoh", "domain": 3}))
    assert config.input_key(config.inputs["map"]).startswith("3/map/")
    for text in ("{}", '{"kind": "bridge", "domain": 3}', "no json"):
        with pytest.raises(Exception, match="ros2: "):
            ros_config(text)
