"""The follower in a ROS 2 graph: its velocities under the key of their ROS topic."""

from __future__ import annotations

from collections.abc import Callable

from fasaco_edge.bus.publisher import RosPublisher
from fasaco_edge.bus.session import Bus
from fasaco_edge.follow.node import FollowerNode
from fasaco_edge.follow.settings import FollowSettings
from fasaco_edge.wire import topics
from fasaco_edge.wire.ros_keys import RosNode, RosTopic, gid_of
from fasaco_edge.wire.topic_types import VOLATILE


def ros_node(bus: Bus, settings: FollowSettings, report: Callable[[str], None]) -> FollowerNode:
    """Return the node that sends velocities to ROS; rmw_zenoh sees it as a node."""
    ros, gid = settings.ros, b""
    if ros["kind"] == "rmw_zenoh":
        node = RosNode(ros["domain"], bus.id, ros["namespace"], ros["node"])
        token = node.endpoint_token(1, "MP", RosTopic(ros["topic"], settings.schema))
        bus.token(node.token)
        bus.token(token)
        gid = gid_of(token)
    out = bus.publisher(settings.cmd_key, settings.schema, topics.CMD_VEL.qos or VOLATILE)
    return FollowerNode(settings, bus, RosPublisher(out, gid), report)
