"""A robot under ROS 2 gets its path: by rmw_zenoh's keys and by those of zenoh-bridge-ros2dds."""

from __future__ import annotations

import struct
import time
from contextlib import contextmanager

import numpy as np
import pytest

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.host.processes import own_mb
from tests.daemon.test_idle import IDLE_MB
from tests.support.outsider import Outsider
from tests.support.processes import daemon_process, free_endpoint
from tests.support.rooms import map_bytes, pillared_room, pose_bytes, two_rooms, update_bytes
from tests.support.ros_robot import (
    CLIENT,
    DIAGNOSTICS,
    EMPTY_REQUEST,
    GRID,
    PATH,
    POSE,
    TF,
    TRIGGER,
    UPDATE,
    Naming,
    RosRobot,
    check_attachment,
    check_path,
    is_walk,
    ros_node,
    ros_robot,
    ros_router,
)
from tests.wire import oracle

ROOM = pillared_room()
BRIDGE, RMW = Naming(None), Naming(0)


def ros2(naming: Naming, **keys):
    kind = {"kind": "bridge"} if naming.domain is None else {"kind": "rmw_zenoh"}
    domain = {"domain": naming.domain} if naming.domain else {}
    return {**kind, **domain, "namespace": naming.namespace or "/", **keys}


@contextmanager
def ros_graph(folder, naming, executed=False):
    with (
        daemon_process(folder, executed=executed, ros2=ros2(naming)) as running,
        ros_robot(running.endpoint, naming) as robot,
        Outsider(running.endpoint),
    ):
        yield running, robot


def put_map(robot: RosRobot) -> None:
    robot.put("map", GRID, map_bytes(ROOM), latched=True)


@pytest.mark.parametrize("naming", [RMW, BRIDGE], ids=["rmw_zenoh", "bridge"])
def test_a_robot_with_a_latched_map_and_tf_gets_its_path(naming, tmp_path):
    with daemon_process(tmp_path, ros2=ros2(naming)) as running:
        with ros_robot(running.endpoint, naming) as robot, Outsider(running.endpoint) as native:
            path, grid = robot.listen("coverage_path", PATH), robot.listen("coverage_grid", GRID)
            put_map(robot)
            robot.put_tf("base_footprint", "base_link", Pose2D(0.0, 0.0), topic="tf_static")
            robot.put_tf("map", "odom", Pose2D(0.5, 0.5, np.pi / 2))
            assert native.wait_status(lambda status: status["map"])["pose"] is None
            robot.put_tf("odom", "base_footprint", Pose2D(0.5, -0.5))
            heard = path.wait(is_walk)
            check_path(heard, near=(1.0, 1.0))
            covered = oracle.from_bytes(GRID, grid.wait(is_walk).payload)
            assert {0, 100} <= set(covered.data.tolist()) <= {-1, 0, 50, 75, 100}
            assert covered.header.frame_id == "map"
            # A status may be older than the path.
            status = native.wait_status(lambda status: status["pose"])
            assert status["pose"] == {"x": 1.0, "y": 1.0, "yaw": 1.5708}
            assert status["errors"]["total"] == 0
            assert native.ask("path").payload in [each.payload for each in path.heard]
            if naming.domain is not None:
                numbers = [check_attachment(each) for each in path.heard]
                assert numbers == sorted(set(numbers))
            else:
                assert heard.attachment is None
        with ros_robot(running.endpoint, naming) as late:
            check_path(late.listen("coverage_path", PATH).wait(is_walk), near=(1.0, 1.0))
            late.listen("coverage_grid", GRID).wait(is_walk)


@pytest.mark.parametrize("naming", [RMW, BRIDGE], ids=["rmw_zenoh", "bridge"])
def test_a_daemon_that_comes_late_gets_map_and_static_transforms(naming, tmp_path):
    """Three programs say where frames lie for ever: what each said last counts.

    Each has its own publisher under rmw_zenoh; a bridge speaks for all.
    """
    links = (("odom", "base_footprint"), ("base_footprint", "base"), ("base", "base_link"))
    with daemon_process(tmp_path) as router, ros_robot(router.endpoint, naming) as robot:
        put_map(robot)
        fixed = oracle.pose(Pose2D(0.0, 0.0))
        publisher = robot.another("tf_static", TF, latched=True)
        for frame, child in links:
            message = oracle.transforms((frame, child, 1, fixed))
            publisher.put(oracle.to_bytes(TF, message))
            if naming.domain is not None:
                publisher = robot.another("tf_static", TF, latched=True)
        path = robot.listen("coverage_path", PATH)
        bus = {"listen": [], "connect": [router.endpoint], "mode": "client"}
        names = {"robot": {"name": "second"}, "bus": bus, "ros2": ros2(naming)}
        with daemon_process(tmp_path, **names), Outsider(router.endpoint, "second") as native:
            native.wait_status(lambda status: status["map"])
            robot.put_tf("map", "odom", Pose2D(1.0, 1.0))
            check_path(path.wait(is_walk), near=(1.0, 1.0))


@pytest.mark.parametrize("naming", [RMW, BRIDGE], ids=["rmw_zenoh", "bridge"])
def test_updates_find_the_map_of_ros_and_poses_their_type(naming, tmp_path):
    block = ros2(naming, pose=POSE, topics={"pose": "/slam/pose"})
    with (
        daemon_process(tmp_path, ros2=block, pose={"schema": "nav_msgs/msg/Odometry"}) as running,
        ros_robot(running.endpoint, naming) as robot,
        Outsider(running.endpoint) as native,
    ):
        path = robot.listen("coverage_path", PATH)
        put_map(robot)
        native.wait_status(lambda status: status["map"])
        # An update of another map makes the daemon ask for the map, and the robot's cache answers.
        robot.put("map_updates", UPDATE, update_bytes(two_rooms(door=True), 5.0, 1.0, 6.0, 2.0))
        native.wait_status(lambda status: status["map"]["revision"] == 2)
        robot.put("slam/pose", POSE, pose_bytes(1.0, 1.0))
        check_path(path.wait(is_walk), near=(1.0, 1.0))
        revision = native.ask_status()["map"]["revision"]
        robot.put("map_updates", UPDATE, update_bytes(ROOM, 1.0, 1.0, 2.0, 2.0))
        status = native.wait_status(lambda status: status["map"]["revision"] > revision)
        assert status["errors"]["by_code"] == {"patch_without_base": 1}


def test_broken_transforms_affect_no_others(tmp_path):
    with (
        daemon_process(tmp_path, ros2=ros2(RMW)) as running,
        ros_robot(running.endpoint, RMW) as robot,
        Outsider(running.endpoint) as native,
    ):
        put_map(robot)
        native.wait_status(lambda status: status["map"])
        robot.put("tf", TF, b"no transforms")
        robot.put_tf("map", "odom", Pose2D(float("nan"), 0.0))
        robot.put_tf("odom", "base_link", Pose2D(1.0, 1.0))
        robot.put_tf("base_link", "odom", Pose2D(0.0, 0.0))
        refused = {"malformed_message": 2, "transform_loop": 1}
        native.wait_status(lambda status: status["errors"]["by_code"] == refused)
        robot.put_tf("map", "odom", Pose2D(0.0, 0.0))
        robot.put_tf("odom", "base_link", Pose2D(1.0, 1.0))
        status = native.wait_status(lambda status: status["pose"])
        assert status["pose"] == {"x": 1.0, "y": 1.0, "yaw": 0.0}
        assert status["errors"]["by_code"] == refused


def test_the_graph_shows_node_publishers_and_subscribers(tmp_path):
    """Each token has the parts of rmw_zenoh's, and vanishes with the daemon."""
    naming = Naming(7, "/robot1")
    with ros_graph(tmp_path, naming) as (running, robot):
        tokens = robot.tokens()
        nodes = [parts for parts in tokens if parts[5] == "NN"]
        assert [parts[6:] for parts in nodes] == [["%", "%robot1", "fasaco_edge"]]
        session = nodes[0][2]
        endpoints = [parts for parts in tokens if parts[5] in ("MP", "MS")]
        services = {parts[9].replace("%", "/") for parts in tokens if parts[5] == "SS"}
        assert services == {
            f"/robot1/coverage/{name}" for name in ("start", "pause", "resume", "home", "cancel")
        }
        assert len(endpoints) + len(services) == len(tokens) - 1
        found = {}
        for parts in endpoints:
            assert parts[:4] == ["@ros2_lv", "7", session, "0"]
            assert parts[6:9] == ["%", "%robot1", "fasaco_edge"]
            topic, type_name, type_hash, qos = parts[9:]
            schema = type_name.replace("::dds_::", "/").replace("::", "/").rstrip("_")
            assert type_hash == oracle.STORE.hash_rihs01(schema)
            reliability, durability, history, *others = qos.split(":")
            assert (reliability, others) == ("", [",", ",", ",,"])
            assert history.startswith(",")
            found[topic.replace("%", "/")] = parts[5], schema, durability == "1"
        assert len({parts[4] for parts in tokens}) == len(tokens)
        running.stop()
        assert robot.tokens() == []
        assert found == {
            "/robot1/map": ("MS", GRID, True),
            "/robot1/map_updates": ("MS", UPDATE, False),
            "/robot1/battery_state": ("MS", "sensor_msgs/msg/BatteryState", False),
            "/robot1/floor_priority": ("MS", GRID, True),
            "/robot1/tf": ("MS", TF, False),
            "/robot1/tf_static": ("MS", TF, True),
            "/robot1/coverage_path": ("MP", PATH, True),
            "/robot1/coverage_grid": ("MP", GRID, True),
            "/robot1/diagnostics": ("MP", DIAGNOSTICS, False),
        }


@pytest.mark.parametrize("naming", [Naming(0, "/robot1"), BRIDGE], ids=["rmw_zenoh", "bridge"])
def test_services_command_the_mission_and_diagnostics_show_it(naming, tmp_path):
    with ros_graph(tmp_path, naming) as (running, robot):
        shown = robot.listen("diagnostics", DIAGNOSTICS)
        put_map(robot)
        robot.put_tf("map", "base_link", Pose2D(1.0, 1.0))
        with Outsider(running.endpoint) as native:
            native.wait_status(lambda status: status["state"] == "covering")
            done, message, beside = robot.call("coverage/pause")
            assert (done, message) == (True, "paused: paused by command")
            if naming.domain is not None:
                sequence, _, size = struct.unpack_from("<qqB", beside)
                assert (sequence, size, beside[17:]) == (7, 16, CLIENT)
            assert robot.call("coverage/pause")[0], "told twice is told once"
            assert robot.call("coverage/home")[0]
            native.wait_status(lambda status: status["reason"] == "at home, paused by command")
            assert robot.call("coverage/resume")[0]
            assert robot.call("coverage/cancel")[:2] == (True, "idle: cancelled")
            done, message, _ = robot.call("coverage/resume")
            assert not done
            assert message.startswith("there is no mission to resume (")
            assert robot.call("coverage/start")[0]
            # Whoever asks for all of them at once means none.
            every = robot.naming.key("coverage/pause", TRIGGER).replace("pause", "*")
            told = list(robot.session.get(every, payload=EMPTY_REQUEST, timeout=10.0))
            assert not any(
                one.ok and struct.unpack_from("<?", bytes(one.ok.payload), 4)[0] for one in told
            )
            assert native.ask_status()["reason"] != "paused by command"

    def levels():
        told = [oracle.from_bytes(DIAGNOSTICS, each.payload).status[0] for each in shown.heard]
        return {one.values[0].value: one.level for one in told}

    found = levels()
    assert {state: found.get(state) for state in ("covering", "paused", "idle")} == {
        "covering": 0,
        "paused": 1,
        "idle": 0,
    }


def test_two_robots_on_one_router_stay_separate(tmp_path):
    first, second = Naming(RMW.domain, "/robot1"), Naming(RMW.domain, "/robot2")
    with (
        daemon_process(tmp_path, ros2=ros2(first)) as one,
        ros_robot(one.endpoint, second) as robot,
        Outsider(one.endpoint) as native,
    ):
        bus = {"listen": [], "connect": [one.endpoint], "mode": "client"}
        names = {"robot": {"name": "second"}, "bus": bus, "ros2": ros2(second)}
        with daemon_process(tmp_path, **names), Outsider(one.endpoint, "second") as other:
            other_path = RosRobot(robot.session, first).listen("coverage_path", PATH)
            path = robot.listen("coverage_path", PATH)
            put_map(robot)
            robot.put_tf("map", "base_link", Pose2D(1.0, 1.0))
            check_path(path.wait(is_walk), near=(1.0, 1.0))
            other.wait_status(lambda status: status["map"])
            assert native.ask_status()["map"] is None
            assert not any(map(is_walk, other_path.heard))


def test_a_client_of_a_router_serves_nodes_that_are_its_peers(tmp_path):
    """As rmw_zenoh is by default: rmw_zenohd is the router, each node a peer."""
    router = free_endpoint()
    bus = {"listen": [], "connect": [router], "mode": "client"}
    with ros_router(router), ros_node(router, RMW) as mapper, ros_node(router, RMW) as driver:
        put_map(mapper)
        path = driver.listen("coverage_path", PATH)
        with daemon_process(tmp_path, bus=bus, ros2=ros2(RMW)), Outsider(router) as native:
            native.wait_status(lambda status: status["map"])
            mapper.put_tf("map", "odom", Pose2D(0.0, 0.0))
            driver.put_tf("odom", "base_link", Pose2D(1.0, 1.0))
            check_path(path.wait(is_walk), near=(1.0, 1.0))
            with ros_node(router, RMW) as late:
                check_path(late.listen("coverage_path", PATH).wait(is_walk), near=(1.0, 1.0))


def test_it_is_small_with_ros(tmp_path):
    with (
        ros_graph(tmp_path, RMW, executed=True) as (running, robot),
        Outsider(running.endpoint) as native,
    ):
        native.wait_status(lambda status: status["state"] == "waiting for map")
        for _ in range(50):
            robot.put_tf("odom", "base_link", Pose2D(1.0, 1.0))
        time.sleep(0.3)
        resident = own_mb(running.pid)
        print(f"idle with ros2: {resident:.1f} MB")
        assert resident < IDLE_MB


@pytest.mark.parametrize("naming", [RMW, BRIDGE], ids=["rmw_zenoh", "bridge"])
def test_on_a_bus_with_names_ros_has_a_role_of_its_own(naming, tmp_path):
    for name, text in (("own.txt", "secret\n"), ("all.txt", "ros:one\neye:two\n")):
        (tmp_path / name).write_text(text)
    files = {
        "password_file": str(tmp_path / "own.txt"),
        "dictionary_file": str(tmp_path / "all.txt"),
    }
    roles = {"ros": ["ros"], "viewer": ["eye"]}
    security = {"kind": "user", "user": {"name": "robot", **files}, "roles": roles}
    bus = {"listen": [free_endpoint()], "security": security}

    def shown(user, password):
        return {"auth": {"usrpwd": {"user": user, "password": password}}}

    with daemon_process(tmp_path, bus=bus, ros2=ros2(naming)) as running:
        eye, ros = shown("eye", "two"), shown("ros", "one")
        with (
            Outsider(running.endpoint, transport=eye) as native,
            ros_robot(running.endpoint, naming, eye) as viewer,
        ):
            unheard = viewer.listen("coverage_path", PATH)
            put_map(viewer)
            time.sleep(1.0)
            assert native.ask_status()["state"] == "waiting for map"
            assert naming.domain is None or viewer.tokens() == []
            with ros_robot(running.endpoint, naming, ros) as robot:
                path = robot.listen("coverage_path", PATH)
                put_map(robot)
                robot.put_tf("map", "base_link", Pose2D(1.0, 1.0))
                check_path(path.wait(is_walk), near=(1.0, 1.0))
                assert naming.domain is None or robot.tokens()
            native.wait_status(lambda status: status["path"])
            assert not unheard.heard
