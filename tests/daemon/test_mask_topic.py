"""A keep-out mask as a message: it holds before the robot drives, and as soon as it changes."""

from __future__ import annotations

import time
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.daemon.mask_topic import MaskTopic
from fasaco_edge.daemon.notify import ServiceManager
from fasaco_edge.daemon.reload import Reload
from fasaco_edge.errors import BadConfiguration
from tests.daemon.test_mission import planned
from tests.daemon.test_reload import taken_by
from tests.daemon.test_ros2 import BRIDGE, RMW, ros2
from tests.support.outsider import TIMEOUT_S, Outsider, joined_daemon
from tests.support.processes import daemon_process
from tests.support.rooms import (
    FREE,
    WALL,
    cells_of,
    fill,
    lanes,
    map_bytes,
    pose_bytes,
    room,
    show_room,
)
from tests.support.ros_robot import GRID, ros_robot
from tests.wire import oracle

ROOM = room(4.0, 3.0)
BLANK = fill(ROOM, 0.0, 0.0, 4.0, 3.0, FREE)
# A square of 4 x 4 cells, and the robot's rim.
MASK = fill(BLANK, 0.9, 0.9, 2.1, 2.1, WALL)
AROUND = {(row, col) for row in range(2, 8) for col in range(2, 8)}
MISSION = {"keep_out_topic": True}


def put_mask(outsider, pixels, **keys):
    outsider.put("keep_out_mask", map_bytes(pixels, **keys), schema=GRID)


def give(outsider):
    show_room(outsider, ROOM, *lanes(1)[0])


def cells_in(frame, heard):
    message = oracle.from_bytes("nav_msgs/msg/Path", heard.payload)
    places = [(stamped.pose.position.x, stamped.pose.position.y) for stamped in message.poses]
    return set(cells_of(np.array(places))) if message.header.frame_id == frame and places else set()


def driven(heard):
    return set(cells_of(planned(heard)[0]))


def test_there_is_no_mission_before_the_mask_has_come(tmp_path):
    with joined_daemon(tmp_path, mission=dict(MISSION)) as (_, outsider):
        paths = outsider.listen("path")
        give(outsider)
        status = outsider.wait_status(lambda status: "mask" in status["reason"])
        assert (status["state"], status["reason"]) == ("waiting for map", "no keep-out mask yet")
        assert paths.heard == []
        put_mask(outsider, MASK)
        cells = driven(paths.wait(lambda heard: len(planned(heard)[0]) > 0))
        assert cells
        assert not cells & AROUND
        assert outsider.ask_status()["mission"]["keep_out"] == 1
        # Another mask takes its place; what was kept out is covered now.
        since = len(paths.heard)
        put_mask(outsider, BLANK)
        paths.wait(lambda heard: bool(driven(heard) & AROUND), since=since)


def test_an_unreadable_mask_leaves_the_last_one_in_force(tmp_path):
    with joined_daemon(tmp_path, mission=dict(MISSION)) as (_, outsider):
        # It may come before the map.
        put_mask(outsider, MASK)
        give(outsider)
        outsider.wait_status(lambda status: status["state"] == "covering")
        bad = {
            b"rubbish": "keep_out_mask: nav_msgs/msg/OccupancyGrid: encapsulation",
            map_bytes(MASK)[:-5]: "keep_out_mask: nav_msgs/msg/OccupancyGrid: length of data",
            map_bytes(MASK, frame="odom"): "keep_out_mask: in frame 'odom', the map in 'map'",
        }
        for payload, why in bad.items():
            outsider.put("keep_out_mask", payload, schema=GRID)
            outsider.wait_status(lambda status, why=why: why in (status["errors"]["last"] or ""))
        assert outsider.ask_status()["state"] == "covering"
        assert not driven(outsider.listen("path").wait(lambda heard: True)) & AROUND


@pytest.mark.parametrize("naming", [RMW, BRIDGE], ids=["rmw_zenoh", "bridge"])
def test_navs_mask_is_taken_however_early_it_was_published(naming, tmp_path):
    """map_server publishes it once, transient local."""
    with (
        daemon_process(tmp_path, mission=dict(MISSION), ros2=ros2(naming)) as running,
        ros_robot(running.endpoint, naming) as robot,
        Outsider(running.endpoint) as outsider,
    ):
        robot.put("keepout_filter_mask", GRID, map_bytes(MASK), latched=True)
        give(outsider)
        cells = driven(outsider.listen("path").wait(lambda heard: len(planned(heard)[0]) > 0))
        assert cells
        assert not cells & AROUND


def test_a_mask_in_another_frame_waits_for_a_map_in_that_frame(tmp_path):
    """Published once, it would not come again; one of another map keeps out of other places."""
    with joined_daemon(tmp_path, mission=dict(MISSION)) as (_, outsider):
        put_mask(outsider, BLANK)
        give(outsider)
        outsider.wait_status(lambda status: status["state"] == "covering")
        put_mask(outsider, MASK, frame="odom")
        wrong = "keep_out_mask: in frame 'odom', the map in 'map'"
        outsider.wait_status(lambda status: wrong in (status["errors"]["last"] or ""))
        assert outsider.ask_status()["state"] == "covering"
        paths = outsider.listen("path", late=False)
        outsider.put("map", map_bytes(ROOM, frame="odom"))
        deadline = time.monotonic() + TIMEOUT_S
        while not any(cells_in("odom", heard) for heard in paths.heard):
            assert time.monotonic() < deadline, outsider.ask_status()["reason"]
            outsider.put("pose", pose_bytes(*lanes(1)[0], frame="odom"))
            time.sleep(0.1)
        assert not any(cells_in("odom", heard) & AROUND for heard in paths.heard)


class Mask:
    def __init__(self, *faults):
        self.has_change = True
        self.faults = list(faults)

    def added_to(self, config):
        self.has_change = False
        return config, self.faults


def test_a_new_mask_does_not_read_the_file_again():
    def read():
        raise AssertionError("the file may hold what nobody has put in force yet")

    reload = Reload(read, ServiceManager({}))
    reload.mask = Mask()
    assert reload.is_wanted
    assert taken_by(reload) == (DaemonConfig(), [])
    assert not reload.is_wanted


def test_an_unreadable_mask_keeps_the_written_configuration(caplog):
    written = msgspec.convert({"robot": {"speed_m_s": 2.0}}, DaemonConfig)
    fault = BadConfiguration("keep_out_mask: rubbish")
    reload = Reload(lambda: written, ServiceManager({}))
    reload.mask = Mask(fault)
    reload.asked.set()
    assert taken_by(reload) == (written, [fault])
    assert "keep-out mask refused: keep_out_mask: rubbish" in caplog.text


def test_a_reload_keeps_the_received_mask():
    """Whether one comes as a message changes with a restart alone."""
    bus = SimpleNamespace(listen=lambda keys, topic, take: heard.append(take))
    heard = []
    config = msgspec.convert({"mission": MISSION}, DaemonConfig)
    mask = MaskTopic(bus, config, None, lambda: None)
    (take,) = heard
    payload = map_bytes(MASK)
    take(Sample("keep_out_mask", payload, GRID))
    mask.map_frame = "map"
    mask.choose(0.0)
    assert mask.has_change
    in_force, faults = mask.added_to(config)
    assert faults == []
    assert in_force.mission.keep_out_mask
    assert not mask.has_change
    written = DaemonConfig()
    assert mask.added_to(written)[0].mission.keep_out_mask == in_force.mission.keep_out_mask
