"""Names of a ROS 2 action on Zenoh: its services, and its server in liveliness tokens.

An action is three services and two topics below ``<action>/_action``; rmw_zenoh and
zenoh-bridge-ros2dds have no other notion of an action. Sources: rcl_action of Jazzy (names),
rmw_zenoh_cpp at commit 028bbe3 (``rmw_service_data.cpp``: attachment of a request; sequence numbers
must not repeat), nav2_msgs of Humble, Iron, Jazzy and Lyrical. Hashes follow REP 2016; that of
CancelGoal is also published.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, Literal

from fasaco_edge.wire.ros_keys import dds_type, mangled

Call = Literal["send_goal", "cancel_goal", "get_result"]
CALLS: Final[tuple[Call, ...]] = ("send_goal", "cancel_goal", "get_result")
_CANCEL: Final = "action_msgs/srv/CancelGoal"

FOLLOW_PATH: Final = ("nav2_msgs/action/FollowPath",)
DOCK_ROBOT: Final = ("nav2_msgs/action/DockRobot", "opennav_docking_msgs/action/DockRobot")
UNDOCK_ROBOT: Final = ("nav2_msgs/action/UndockRobot", "opennav_docking_msgs/action/UndockRobot")
"""Types of actions, under all names that they have had."""

Release = Literal["humble", "jazzy", "lyrical"]
RELEASES: Final[dict[Release, int]] = {"humble": 2, "jazzy": 3, "lyrical": 4}
"""How many names of plugins a goal of nav2_msgs/FollowPath ends with: controller, goal checker,
from Iron on progress checker, from Lyrical on path handler. What is sent to Iron and Kilted is as
for Jazzy."""

_GOALS: Final[dict[str, Release]] = {
    "TypeHashNotSupported": "humble",
    "RIHS01_5b662aee1159e1d7e7b5f8fef21f556b8bc67c818c730a68e18bb29b85f66946": "jazzy",
    "RIHS01_0c091793c90a67349df3445771d5d30005daea785137bd6e6bf5d96ea53fb721": "lyrical",
}
"""By the hash in the key of ``send_goal``."""


def bridge_keys(action: str) -> dict[Call, str]:
    """Return the keys that zenoh-bridge-ros2dds gives the services of an action."""
    return {call: f"{action.strip('/')}/_action/{call}" for call in CALLS}


def server_tokens(domain: int, action: str) -> str:
    """Return the key expression of the tokens of an action's services."""
    return f"@ros2_lv/{domain}/*/*/*/SS/*/*/*/{mangled(action)}%_action%$*/**"


def served_keys(
    domain: int, action: str, tokens: Iterable[str], types: Iterable[str] = FOLLOW_PATH
) -> dict[Call, str]:
    """Return the keys of the services named by tokens, for an action of one of these types."""
    kinds: dict[Call, set[str]] = {
        "send_goal": {dds_type(f"{one}_SendGoal") for one in types},
        "cancel_goal": {dds_type(_CANCEL)},
        "get_result": {dds_type(f"{one}_GetResult") for one in types},
    }
    found = dict[Call, str]()
    for token in sorted(tokens):
        parts = token.split("/")
        name, kind, type_hash = parts[9:12] if len(parts) >= 12 else ("", "", "")
        for call in CALLS:
            if name == f"{mangled(action)}%_action%{call}" and kind in kinds[call]:
                found[call] = f"{domain}/{action.strip('/')}/_action/{call}/{kind}/{type_hash}"
    return found


def release_of(send_goal_key: str) -> Release | None:
    """Return the ROS release of a server's goal type, by its rmw_zenoh key; None if unknown."""
    return _GOALS.get(send_goal_key.rpartition("/")[2])
