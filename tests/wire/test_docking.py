"""Messages of DockRobot and UndockRobot against rosbags, and hashes against the definitions."""

import math

import pytest

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.wire.messages.nav2_goals import (
    ABORTED,
    CANCELED,
    SUCCEEDED,
    DockEnding,
    decode_dock_ending,
    decode_undock_ending,
    encode_dock,
    encode_undock,
)
from fasaco_edge.wire.ros_keys import CALLS, DOCK_ROBOT, UNDOCK_ROBOT, served_keys
from tests.support.dock_server import CANCEL_HASH, HASHES, dock_store
from tests.wire.test_ros_actions import GOAL, Definitions, base, named


def test_hashes_are_those_of_the_definitions():
    """The look-alike's server has them; ours asks for the type alone, whatever the hash."""
    uuid, time = named("unique_identifier_msgs/msg/UUID"), named("builtin_interfaces/msg/Time")
    goals = {
        "Dock": [
            ("use_dock_id", base("bool")), ("dock_id", base("string")),
            ("dock_pose", named("geometry_msgs/msg/PoseStamped")), ("dock_type", base("string")),
            ("max_staging_time", base("float32")), ("navigate_to_staging_pose", base("bool")),
        ],
        "Undock": [("dock_type", base("string")), ("max_undocking_time", base("float32"))],
    }  # fmt: skip
    for move, fields in goals.items():
        made, name = Definitions(), f"nav2_msgs/action/{move}Robot"
        made.put(f"{name}_Goal", fields)
        send_goal = made.service(
            f"{name}_SendGoal",
            [("goal_id", uuid), ("goal", named(f"{name}_Goal"))],
            [("accepted", base("bool")), ("stamp", time)],
        )
        retries = [("num_retries", base("uint16"))] if move == "Dock" else []
        first = [("success", base("bool")), ("error_code", base("uint16"))]
        made.put(f"{name}_Result", [*first, *retries, ("error_msg", base("string"))])
        get_result = made.service(
            f"{name}_GetResult",
            [("goal_id", uuid)],
            [("status", base("int8")), ("result", named(f"{name}_Result"))],
        )
        assert (send_goal, get_result) == HASHES[move]


def test_a_server_of_either_package_is_known_by_its_tokens():
    for package in ("nav2_msgs", "opennav_docking_msgs"):
        kind = f"{package}::action::dds_::DockRobot"
        types = {
            "send_goal": f"{kind}_SendGoal_",
            "cancel_goal": "action_msgs::srv::dds_::CancelGoal_",
            "get_result": f"{kind}_GetResult_",
        }
        tokens = [
            f"@ros2_lv/3/abc/0/1/SS/%/%/docking_server/%dock_robot%_action%{call}/{types[call]}/"
            f"{CANCEL_HASH}/::,10:,:,:,,"
            for call in CALLS
        ]
        assert list(served_keys(3, "/dock_robot", sorted(tokens), DOCK_ROBOT)) == sorted(CALLS)
        # FollowPath is another type, and undocking another one.
        assert set(served_keys(3, "/dock_robot", tokens, UNDOCK_ROBOT)) == {"cancel_goal"}


def test_goals_are_read_by_others():
    dock = Pose2D(1.0, -2.0, math.pi / 2)
    for dock_id in ("", "home"):
        payload = encode_dock(GOAL, dock, "map", dock_id, "charging_dock")
        goal = dock_store("Dock").deserialize_cdr(payload, "look_alike/msg/Send")
        assert bytes(goal.goal_id.uuid) == GOAL
        assert (goal.use_dock_id, goal.dock_id) == (bool(dock_id), dock_id)
        pose = goal.dock_pose
        assert (pose.header.frame_id, pose.pose.position.x, pose.pose.position.y) == ("map", 1, -2)
        assert pose.pose.orientation.z == pytest.approx(math.sin(math.pi / 4))
        assert (goal.dock_type, goal.max_staging_time) == ("charging_dock", 1000.0)
        assert goal.navigate_to_staging_pose is True
    goal = dock_store("Undock").deserialize_cdr(encode_undock(GOAL, "x"), "look_alike/msg/Send")
    assert (goal.dock_type, goal.max_undocking_time) == ("x", 30.0)


@pytest.mark.parametrize("with_message", [True, False])
@pytest.mark.parametrize("move", ["Dock", "Undock"])
def test_endings_of_others_are_read(move, with_message):
    store = dock_store(move, with_message=with_message)
    said = "no dock" if with_message else ""
    members = {"status": ABORTED, "success": False, "error_code": 904}
    members |= {"num_retries": 3} if move == "Dock" else {}
    members |= {"error_msg": said} if with_message else {}
    message = store.types["look_alike/msg/Ended"](**members)
    payload = bytes(store.serialize_cdr(message, "look_alike/msg/Ended", little_endian=True))
    read = decode_dock_ending if move == "Dock" else decode_undock_ending
    assert read(payload) == DockEnding(ABORTED, success=False, code=904, message=said)
    # Without a message it may end there.
    for cut in range(4, 10 if move == "Dock" else 8):
        with pytest.raises(MalformedMessage):
            read(payload[:cut])


def test_an_aborted_goal_with_success_is_done():
    assert DockEnding(SUCCEEDED, success=True).is_done
    # docking_server.cpp returns without a word, and its action server aborts the goal.
    assert DockEnding(ABORTED, success=True).is_done
    assert not DockEnding(ABORTED, success=False).is_done
    assert not DockEnding(ABORTED, success=False, code=905).is_done
    assert not DockEnding(CANCELED, success=False).is_done
