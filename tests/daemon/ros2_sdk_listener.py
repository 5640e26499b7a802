"""Lists topics and hears path and coverage by zenoh-ros2-sdk, a library of somebody else.

Run by the Python that has it, which need not have this package:
``python ros2_sdk_listener.py PORT DOMAIN FOLDER``; prints a JSON document.
"""

from __future__ import annotations

import json
import sys
import threading
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rosbags.typesys import Stores, get_typestore

TYPES = {"/coverage_path": "nav_msgs/msg/Path", "/coverage_grid": "nav_msgs/msg/OccupancyGrid"}
TIMEOUT_S = 20.0


def write_definitions(folder: Path) -> None:
    """Write the .msg files the library would fetch from the network."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for schema in TYPES.values():
        text, _ = store.generate_msgdef(schema, ros_version=2)
        first, *others = text.split("=" * 80 + "\n")
        sections = {schema: first}
        for other in others:
            name, _, definition = other.removeprefix("MSG: ").partition("\n")
            sections[name if "/msg/" in name else name.replace("/", "/msg/")] = definition
        for name, definition in sections.items():
            file = folder / f"{name}.msg"
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(definition)


def main(port: int, domain: int, folder: Path) -> dict[str, Any]:
    """Return what there is to hear."""
    import zenoh_ros2_sdk as sdk
    from zenoh_ros2_sdk.qos import QosDurability, QosProfile

    at = {"domain_id": domain, "router_port": port}
    sdk.ZenohSession.get_instance(router_port=port)
    write_definitions(folder)
    sdk.get_registry().messages_dir = folder
    topics = dict(sdk.get_topic_names_and_types(**at))
    info = sdk.get_topic_info("/coverage_path", verbose=True, **at)
    heard: dict[str, Any] = {}
    everything = threading.Event()

    def hear(topic: str, message: Any) -> None:
        heard[topic] = message
        if heard.keys() == TYPES.keys():
            everything.set()

    latched = QosProfile(durability=QosDurability.TRANSIENT_LOCAL, history_depth=1)
    subscribers = [
        sdk.ROS2Subscriber(topic, schema, lambda m, t=topic: hear(t, m), qos=latched, **at)
        for topic, schema in TYPES.items()
    ]
    assert everything.wait(TIMEOUT_S), f"heard only {list(heard)}"
    path, grid = heard["/coverage_path"], heard["/coverage_grid"]
    document = {
        "version": version("zenoh-ros2-sdk"),
        "topics": topics,
        "publishers": [[each.node_namespace, each.node_name] for each in info.publishers],
        "path": {
            "frame": path.header.frame_id,
            "xy": [[pose.pose.position.x, pose.pose.position.y] for pose in path.poses],
        },
        "grid": {
            "frame": grid.header.frame_id,
            "size": [grid.info.width, grid.info.height],
            "resolution": round(float(grid.info.resolution), 6),
            "values": sorted({int(value) for value in grid.data}),
        },
    }
    for subscriber in subscribers:
        subscriber.close()
    sdk.ZenohSession.get_instance().close()
    return document


if __name__ == "__main__":
    print(json.dumps(main(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]))))
