"""Names of ROS 2 on Zenoh, against the documents of rmw_zenoh and the table of the contract."""

from __future__ import annotations

import re

import pytest
import zenoh
import zenoh.ext

from fasaco_edge.config.ros import ROS_TOPICS, RosConfig
from fasaco_edge.wire import schemas
from fasaco_edge.wire.ros_keys import (
    GID_BYTES,
    SERVICE_HASHES,
    TRIGGER,
    TYPE_HASHES,
    RosNode,
    RosTopic,
    attachment,
    gid_of,
)
from tests.wire import oracle
from tests.wire.contract_files import CONTRACT, load

TABLE = load("keys.yaml")["ros2"]
PATH = RosTopic("/robot1/coverage_path", schemas.PATH, latched=True)
NODE = RosNode(2, "aac3178e146ba6f1fc6e6a4085e77f21", "/robot1", "fasaco_edge")


@pytest.mark.parametrize("schema", TYPE_HASHES)
def test_hashes_are_those_of_the_definitions(schema: str) -> None:
    assert f"RIHS01_{TYPE_HASHES[schema]}" == oracle.STORE.hash_rihs01(schema)


def test_hashes_are_those_of_the_table() -> None:
    ours = TYPE_HASHES | SERVICE_HASHES
    assert {schema: f"RIHS01_{value}" for schema, value in ours.items()} == TABLE["hashes"]


def test_services_are_those_of_the_table() -> None:
    commands = RosConfig(kind="rmw_zenoh", namespace="/robot1").commands
    assert list(commands) == TABLE["services"]
    home = commands["home"]
    hash_ = TABLE["hashes"][TRIGGER]
    key = f"3/robot1/coverage/home/std_srvs::srv::dds_::Trigger_/{hash_}"
    assert (home.bridge_key, home.rmw_key(3)) == ("robot1/coverage/home", key)
    assert NODE.endpoint_token(5, "SS", home).endswith(
        f"/5/SS/%/%robot1/fasaco_edge/%robot1%coverage%home/std_srvs::srv::dds_::Trigger_/{hash_}"
        "/::,10:,:,:,,"
    )


def test_topics_are_those_of_the_table() -> None:
    """What the daemon has by default, what keys.yaml says, and what the contract shows."""
    config = RosConfig(kind="rmw_zenoh")
    by_pose = RosConfig(kind="rmw_zenoh", pose=schemas.ODOMETRY)
    inputs = list(by_pose.inputs.values())
    ours = [
        *(*inputs[:4], config.topic("keep_out_mask"), config.topic("scan"), *inputs[4:]),
        *(config.inputs["pose"], config.inputs["tf_static"]),
        *config.outputs.values(),
        config.topic("cmd_vel", schemas.TWIST),
    ]
    shown = re.findall(r"^\| `(/\w+)` \| (in|out).* \| (.*) \| (.*) \|$", CONTRACT, re.MULTILINE)
    for topic, entry, row in zip(ours, TABLE["topics"], shown, strict=True):
        facts = topic.name, topic.latched, topic.depth
        assert facts == (entry["topic"], entry["latched"], entry["depth"])
        assert topic.schema in entry["schema"]
        durability = "transient local" if topic.latched else "volatile"
        types = [schema.replace("/msg/", "/") for schema in entry["schema"]]
        qos = f"reliable, {durability}, {topic.depth}"
        assert row == (topic.name, entry["direction"], row[2], qos)
        assert re.split(", | or ", row[2]) == types


def test_keys_are_those_of_the_table() -> None:
    parts = {
        "topic": "robot1/coverage_path",
        "domain": 2,
        "type": "nav_msgs::msg::dds_::Path_",
        "hash": TABLE["hashes"][schemas.PATH],
    }
    assert PATH.bridge_key == TABLE["bridge"].format(**parts)
    assert PATH.rmw_key(2) == TABLE["rmw_zenoh"].format(**parts)
    assert PATH.rmw_key(2, any_hash=True) == TABLE["rmw_zenoh"].format(**{**parts, "hash": "*"})


def test_tokens_are_those_of_the_design() -> None:
    """The examples of rmw_zenoh's design.md, with our names in them."""
    prefix = "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0"
    assert NODE.token == f"{prefix}/0/NN/%/%robot1/fasaco_edge"
    assert RosNode(2, NODE.session, "/", "x").token == f"{prefix}/0/NN/%/%/x"
    assert NODE.endpoint_token(3, "MP", PATH) == (
        f"{prefix}/3/MP/%/%robot1/fasaco_edge/%robot1%coverage_path/nav_msgs::msg::dds_::Path_/"
        "RIHS01_1957a5bb3cee5da65c4e52e52b65a93df227efce4c20f8458b36e73066ca334b/:1:,1:,:,:,,"
    )
    plain = RosTopic("/tf", schemas.TF_MESSAGE, depth=10)
    assert NODE.endpoint_token(4, "MS", plain).endswith("/::,10:,:,:,,")


def test_tokens_are_key_expressions() -> None:
    for token in (NODE.token, NODE.endpoint_token(1, "MP", PATH)):
        assert str(zenoh.KeyExpr(token)) == token


def test_the_attachment_is_what_zenoh_serialises() -> None:
    gid = bytes(range(GID_BYTES))
    ours = attachment(7, 1_700_000_000_123_456_789, gid)
    serial = zenoh.ext.z_serialize
    numbers = serial(zenoh.ext.Int64(7)), serial(zenoh.ext.Int64(1_700_000_000_123_456_789))
    assert ours == b"".join(bytes(part) for part in (*numbers, serial(gid)))
    assert len(ours) == 33


def test_each_publisher_has_a_gid_of_its_own() -> None:
    tokens = [NODE.endpoint_token(number, "MP", PATH) for number in range(1, 5)]
    assert len({gid_of(token) for token in tokens}) == 4
    assert {len(gid_of(token)) for token in tokens} == {GID_BYTES}


def test_rows_are_those_of_the_table() -> None:
    rows = [
        (row.name, row.direction, list(row.schemas), row.latched, row.depth)
        for row in ROS_TOPICS.values()
    ]
    columns = ("name", "direction", "schema", "latched", "depth")
    assert rows == [tuple(entry[name] for name in columns) for entry in TABLE["topics"]]
