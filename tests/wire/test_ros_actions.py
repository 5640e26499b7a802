"""Names, hashes and messages of the action FollowPath, against definitions and rosbags."""

from __future__ import annotations

import math

import pytest
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from fasaco_edge.errors import MalformedMessage
from fasaco_edge.wire.messages.nav2_goals import (
    ABORTED,
    SUCCEEDED,
    TAKEN,
    Ending,
    decode_accepted,
    decode_cancel,
    decode_ending,
    encode_cancel,
    encode_goal,
    encode_goal_id,
)
from fasaco_edge.wire.ros_keys import (
    CALLS,
    RELEASES,
    bridge_keys,
    release_of,
    served_keys,
    server_tokens,
)
from tests.support.nav2_server import HASHES, PATH_IDS, RESULTS, TYPES, store_of
from tests.wire.test_ros_keys import TABLE

GOAL = bytes(range(16))
POINTS = [(0.0, 0.0), (1.0, 0.0), (1.0, -2.0)]


def base(name):
    return Nodetype.BASE, (name, 0)


def named(name):
    return Nodetype.NAME, name


class Definitions:
    """Hashes of services by rosbags, which has none: their parts are described as messages."""

    def __init__(self):
        self.store = get_typestore(Stores.ROS2_JAZZY)
        constants, fields = self.store.fielddefs["service_msgs/msg/ServiceEventInfo"]
        # A char of a .msg is a uint8 of the IDL, by which hashes are made.
        gid = (Nodetype.ARRAY, (base("uint8"), 16))
        fields = [(name, gid if name == "client_gid" else kind) for name, kind in fields]
        self.put("service_msgs/msg/ServiceEventInfo", fields, constants)

    def put(self, name, fields, constants=()):
        self.store.fielddefs[name] = (list(constants), list(fields))

    def service(self, name, request, response):
        self.put(f"{name}_Request", request)
        self.put(f"{name}_Response", response)
        both = {part: named(f"{name}_{part.title()}") for part in ("request", "response")}
        bounded = [(part, (Nodetype.SEQUENCE, (kind, 1))) for part, kind in both.items()]
        info = ("info", named("service_msgs/msg/ServiceEventInfo"))
        self.put(f"{name}_Event", [info, *bounded])
        parts = [*both.items(), ("event", named(f"{name}_Event"))]
        self.put(name, [(f"{part}_message", kind) for part, kind in parts])
        return self.store.hash_rihs01(name)


def test_hashes_of_services_are_made_as_those_that_are_published():
    response = [("success", base("bool")), ("message", base("string"))]
    trigger = Definitions().service("std_srvs/srv/Trigger", [], response)
    assert trigger == TABLE["hashes"]["std_srvs/srv/Trigger"]


@pytest.mark.parametrize("release", ["jazzy", "lyrical"])
def test_hashes_are_those_of_the_definitions(release):
    made, goal = Definitions(), "nav2_msgs/action/FollowPath_Goal"
    time, uuid = named("builtin_interfaces/msg/Time"), named("unique_identifier_msgs/msg/UUID")
    names = [(name, base("string")) for name in PATH_IDS[release]]
    made.put(goal, [("path", named("nav_msgs/msg/Path")), *names])
    send_goal = made.service(
        "nav2_msgs/action/FollowPath_SendGoal",
        [("goal_id", uuid), ("goal", named(goal))],
        [("accepted", base("bool")), ("stamp", time)],
    )
    info = named("action_msgs/msg/GoalInfo")
    canceling = ("goals_canceling", (Nodetype.SEQUENCE, (info, 0)))
    cancel_goal = made.service(
        "action_msgs/srv/CancelGoal",
        [("goal_info", info)],
        [("return_code", base("int8")), canceling],
    )
    result = "nav2_msgs/action/FollowPath_Result"
    extra = [("error_code", base("uint16")), ("error_msg", base("string"))]
    made.put(result, [("result", named("std_msgs/msg/Empty")), *extra])
    get_result = made.service(
        "nav2_msgs/action/FollowPath_GetResult",
        [("goal_id", uuid)],
        [("status", base("int8")), ("result", named(result))],
    )
    assert (send_goal, cancel_goal, get_result) == HASHES[release]
    assert release_of(f"0/follow_path/_action/send_goal/x/{send_goal}") == release


def test_a_server_is_known_by_its_tokens():
    tokens = [
        f"@ros2_lv/3/abc/0/{n}/SS/%/%robot1/controller_server/%robot1%follow_path%_action%{call}/"
        f"{kind}/{type_hash}/::,10:,:,:,,"
        for n, ((call, kind), type_hash) in enumerate(zip(TYPES, HASHES["jazzy"], strict=True))
    ]
    other = [token.replace("robot1", "robot2") for token in tokens]
    keys = served_keys(3, "/robot1/follow_path", [*other, *tokens, "@ros2_lv/3/x"])
    assert list(keys) == [call for call, _ in TYPES]
    assert keys["send_goal"] == (
        f"3/robot1/follow_path/_action/send_goal/{TYPES[0][1]}/{HASHES['jazzy'][0]}"
    )
    assert release_of(keys["send_goal"]) == "jazzy"
    assert release_of("3/x/RIHS01_0") is None
    assert served_keys(3, "/follow_path", tokens) == {}
    assert "%robot1%follow_path%_action%" in server_tokens(3, "/robot1/follow_path")


def test_a_bridge_shows_only_names():
    keys = bridge_keys("/robot1/follow_path")
    assert keys == {call: f"robot1/follow_path/_action/{call}" for call in CALLS}


@pytest.mark.parametrize("release", RELEASES)
def test_goals_are_read_by_others(release):
    names = ["FollowPath", "checker", "", "handler"][: RELEASES[release]]
    payload = encode_goal(GOAL, POINTS, "map", 5, names)
    goal = store_of(release).deserialize_cdr(payload, "look_alike/msg/Send")
    assert bytes(goal.goal_id.uuid) == GOAL
    assert goal.path.header.frame_id == "map"
    xy = [(pose.pose.position.x, pose.pose.position.y) for pose in goal.path.poses]
    assert xy == POINTS
    # Each faces the next one, the last one as the one before it.
    turns = [round(pose.pose.orientation.z, 4) for pose in goal.path.poses]
    assert turns == [0.0, -0.7071, -0.7071]
    payload = encode_goal(GOAL, POINTS, "map", 5, names, end_yaw=math.pi / 2)
    goal = store_of(release).deserialize_cdr(payload, "look_alike/msg/Send")
    assert goal.path.poses[-1].pose.orientation.z == pytest.approx(math.sqrt(0.5))
    assert [getattr(goal, name) for name in PATH_IDS[release]] == names


def test_a_goal_needs_two_points():
    with pytest.raises(MalformedMessage, match="length of poses"):
        encode_goal(GOAL, POINTS[:1], "map", 0, ())


@pytest.mark.parametrize("release", RESULTS)
@pytest.mark.parametrize("padding", [b"", b"\0\0"])
def test_endings_of_others_are_read(release, padding):
    store = store_of(release)
    members = {"error_code": 105, "error_msg": "stuck"} if RESULTS[release] else {}
    empty = store.types["std_msgs/msg/Empty"]()
    message = store.types["look_alike/msg/Ended"](status=ABORTED, result=empty, **members)
    payload = bytes(store.serialize_cdr(message, "look_alike/msg/Ended", little_endian=True))
    if padding and not members:
        payload = payload[:3] + b"\2" + payload[4:] + padding
    code, said = (105, "stuck") if members else (0, "")
    assert decode_ending(payload) == Ending(ABORTED, code, said)


def test_answers_of_others_are_read():
    store = store_of("jazzy")

    def written(name, **members):
        message = store.types[f"look_alike/msg/{name}"](**members)
        return bytes(store.serialize_cdr(message, f"look_alike/msg/{name}", little_endian=True))

    stamp = store.types["builtin_interfaces/msg/Time"](sec=1, nanosec=2)
    for accepted in (True, False):
        assert decode_accepted(written("Sent", accepted=accepted, stamp=stamp)) == accepted
    asked = store.deserialize_cdr(encode_cancel(GOAL), "look_alike/msg/Cancel")
    assert bytes(asked.goal_info.goal_id.uuid) == GOAL
    canceled = written("Canceled", return_code=TAKEN, goals_canceling=[asked.goal_info] * 2)
    assert decode_cancel(canceled) == TAKEN
    about = store.deserialize_cdr(encode_goal_id(GOAL), "look_alike/msg/Ask")
    assert bytes(about.goal_id.uuid) == GOAL


@pytest.mark.parametrize(
    ("decode", "payload"),
    [
        (decode_accepted, b""),
        (decode_accepted, b"\0\1\0\0\2\0\0\0" + bytes(8)),
        (decode_cancel, b"\0\1\0\0\0\0\0\0\xff\xff\xff\xff"),
        (decode_ending, b"\0\1\0\0"),
        (decode_ending, b"\0\1\0\0\x02\0"),
        (decode_ending, b"\0\1\0\0\x04\0\0\0\xff\0\0\0a\0"),
    ],
)
def test_an_invalid_answer_is_refused(decode, payload):
    with pytest.raises(MalformedMessage):
        decode(payload)


def test_a_result_of_iron_ends_with_its_code():
    assert decode_ending(b"\0\1\0\0\x04\0\0\0") == Ending(SUCCEEDED)
    assert decode_ending(b"\0\1\0\0\x06\0\x69\0") == Ending(ABORTED, 105)
