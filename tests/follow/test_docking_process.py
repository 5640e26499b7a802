"""``fasaco-edge follow`` and a look-alike of Nav2 with its docking server, as processes."""

import math

import pytest

from tests.follow.nav2_missions import Robot, kind_of, nav2_follower
from tests.follow.test_nav2_process import listen, wait, wait_log
from tests.support.driven_base import DrivenBase

DOCK = {"x_m": 1.5, "y_m": 0.0, "yaw_deg": 0.0, "approach_m": 0.5}
TO_DOCK, OUT = ((0.0, 0.0), (1.0, 0.0)), ((1.0, 0.0), (1.0, 0.8))


@pytest.fixture
def base():
    base = DrivenBase()
    base.says_poses = False
    yield base
    base.close()


@pytest.mark.parametrize(
    ("domain", "wanted", "nav2", "docking"),
    [
        (7, {"failures": 1}, {}, ["Dock", "Dock 904", "Dock", "Dock succeeded"]),
        (None, {"with_message": False, "delay_s": 1.0}, {"dock_type": "charging_dock"},
         ["Dock", "Dock succeeded"]),
        (7, {"dock_package": "opennav_docking_msgs"}, {"dock_id": "home"},
         ["Dock", "Dock succeeded"]),
    ],
    ids=["failure", "bridge, delays", "humble"],
)  # fmt: skip
def test_it_docks_and_comes_out_again(base, tmp_path, domain, wanted, nav2, docking):
    dock = {"pose": (1.5, 0.0, 0.0), "failures": wanted.get("failures", 0)}
    robot = {"endpoint": base.endpoint, "domain": domain, "start": (0.0, 0.0), "dock": dock}
    ros2 = {**kind_of(domain), "dock": "nav2", "nav2": nav2}
    with (
        Robot(**robot, **wanted) as look_alike,
        nav2_follower(tmp_path, base.endpoint, ros2, mission={"dock": DOCK}) as log,
    ):
        poses = listen(base, "7/pose/**" if domain else "pose")
        base.plans()
        base.send_path(*TO_DOCK)
        wait_log(log, "standing, the path is driven")
        # As the daemon does it: the path ends, and it says that the robot charges.
        base.send_path()
        base.state = "charging"
        tries, line = docking.count("Dock"), "INFO fasaco_edge.follow.docking: dock: docking\n"
        wait(lambda: log.read_text().count(line) == tries, log)
        base.send_path(*OUT)
        wait_log(log, "dock: in its dock")
        base.state = "covering"
        wait(lambda: math.dist((poses[-1].x, poses[-1].y), OUT[-1]) < 0.15, log)
    done = look_alike.end()
    assert done["refused"] == []
    assert done["docking"] == [*docking, "Undock", "Undock succeeded"]
    assert math.dist((done["x"], done["y"]), OUT[-1]) < 0.15
    # It was in the dock, and left it backward before it turned off.
    assert max(x for x, _ in done["trail"]) < 1.1
