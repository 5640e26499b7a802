"""``fasaco-edge follow`` and a look-alike of Nav2, each in a process of its own."""

import math
from contextlib import contextmanager

import pytest

from fasaco_edge.wire.messages.poses import decode_pose
from tests.follow.nav2_missions import Robot, kind_of, nav2_follower, passed
from tests.support.driven_base import DrivenBase
from tests.support.outsider import joined_daemon
from tests.support.rooms import map_bytes, room
from tests.support.waiting import until

LANES = ((0.0, 0.0), (2.0, 0.0), (2.0, 0.276), (0.0, 0.276), (0.0, 0.552), (2.0, 0.552))
CROSSING = ((0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, -1.0))
PATIENCE_S = 120.0
# A robot that does not move from one of so many poses to the next, ten a second, stands.
STILL = 20


@pytest.fixture
def base():
    base = DrivenBase()
    base.says_poses = False
    yield base
    base.close()


def wait_log(log, words):
    wait(lambda: words in log.read_text(), log)


def wait(holds, log):
    until(holds, PATIENCE_S, why=log.read_text)


def listen(base):
    poses = []
    schema = "geometry_msgs/msg/PoseStamped"
    base.bus.subscribe(
        "7/pose/**", lambda sample: poses.append(decode_pose(sample.payload, schema).pose)
    )
    return poses


def undisturbed(done):
    """Return what the look-alike counted; None where a busy machine had a goal canceled for an old
    status."""
    return None if done["counts"]["canceled"] else done["counts"]


@contextmanager
def driving(base, folder, domain=7, nav2=None, **robot):
    wanted = {"endpoint": base.endpoint, "domain": domain, "start": (0.0, 0.0), **robot}
    ros2 = {**kind_of(domain), "nav2": nav2 or {}}
    with Robot(**wanted) as look_alike, nav2_follower(folder, base.endpoint, ros2) as log:
        base.plans()
        yield look_alike, log


@pytest.mark.parametrize(
    ("release", "domain"), [("humble", 7), ("lyrical", 7), ("humble", None), ("jazzy", None)]
)
def test_a_path_is_driven_to_its_end(base, tmp_path, release, domain):
    # By rmw_zenoh it is seen, whatever the configuration says.
    nav2 = {"release": release} if domain is None else {"controller": "FollowPath"}
    with driving(base, tmp_path, domain, nav2, release=release) as (look_alike, log):
        base.send_path(*LANES)
        wait_log(log, "standing, the path is driven")
    done = look_alike.end()
    assert (done["refused"], done["errors"]) == ([], [])
    # Lanes beside each other are one goal.
    assert undisturbed(done) in (None, {"goals": 1, "preempted": 0, "canceled": 0})
    assert passed(done["trail"], LANES)
    assert math.dist((done["x"], done["y"]), LANES[-1]) < 0.15


def test_a_path_that_crosses_itself_is_driven_without_standing(base, tmp_path):
    with driving(base, tmp_path, speed=0.5) as (look_alike, log):
        base.send_path(*CROSSING)
        wait_log(log, "standing, the path is driven")
    done = look_alike.end()
    assert passed(done["trail"], CROSSING)
    # The next goal was sent while the robot drove.
    assert undisturbed(done) in (None, {"goals": 2, "preempted": 1, "canceled": 0})


def test_a_reason_to_stop_cancels_the_goal(base, tmp_path):
    with driving(base, tmp_path, speed=0.3) as (look_alike, log):
        base.send_path((0.0, 0.0), (30.0, 0.0))
        poses = listen(base)
        wait(lambda: bool(poses) and poses[-1].x > 0.2, log)
        base.send_path()
        wait_log(log, "standing, stopped by an empty path")
        # While the follower is there: its own end cancels, too.
        wait(lambda: len(poses) > STILL and len({(at.x, at.y) for at in poses[-STILL:]}) == 1, log)
        done = look_alike.end()
    assert done["counts"]["canceled"] >= 1
    assert done["x"] < 28.0


def test_a_missing_server_and_an_error_are_logged_with_reasons(base, tmp_path):
    base.says_poses = True
    robot = {"endpoint": base.endpoint, "domain": 7, "start": (0.0, 0.0)}
    ros2 = {**kind_of(7), "nav2": {"controller": "Nothing"}}
    base.plans()
    base.send_path(*LANES)
    with nav2_follower(tmp_path, base.endpoint, ros2) as log:
        wait_log(log, "no pose")
        with Robot(**robot):
            wait_log(
                log, "standing, given up by Nav2: 101 invalid controller: no controller Nothing"
            )
        wait_log(log, "pose too old")


def test_a_mission_is_driven_by_nav2_to_its_end(tmp_path):
    """Daemon, follower and look-alike; aborts, late and lost answers in between."""
    names = {"name": "robot", "speed_m_s": 1.0, "quarter_turn_s": 0.5}
    ros2 = {**kind_of(0), "pose": "geometry_msgs/msg/PoseStamped"}
    with (
        joined_daemon(tmp_path, ros2=ros2, robot=names) as (daemon, native),
        Robot(
            endpoint=daemon.endpoint, domain=0, start=(0.6, 0.6), abort_every_s=6.0, delay_s=0.5,
            lost=0.02,
        ) as nav2,
        nav2_follower(tmp_path, daemon.endpoint, ros2, **names),
    ):  # fmt: skip
        native.put("map", map_bytes(room(2.4, 2.0)))
        status = native.wait_status(lambda status: status["state"] == "done")
        assert status["coverage"]["remaining"] == 0
        assert status["errors"]["total"] == 0
        done = nav2.end()
    assert done["refused"] == []
