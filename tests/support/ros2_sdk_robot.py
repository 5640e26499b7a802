"""Robot by zenoh-ros2-sdk, a foreign library: it sends map and tf, and receives path and coverage.

Run by a Python with this library; it need not have this package:
``python ros2_sdk_robot.py PORT DOMAIN FOLDER``; prints a JSON document.
"""

from __future__ import annotations

import json
import sys
import threading
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import zenoh_ros2_sdk as sdk
from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk.qos import QosDurability, QosProfile

MAP, PATH, TF = "nav_msgs/msg/OccupancyGrid", "nav_msgs/msg/Path", "tf2_msgs/msg/TFMessage"
HEARD = {"/coverage_path": PATH, "/coverage_grid": MAP}
TIMEOUT_S = 30.0


def write_definitions(folder: Path) -> None:
    """Write the .msg files that the library would otherwise fetch from the network."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for schema in (MAP, PATH, TF):
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


class Robot:
    """A robot that stands at (1, 1) [m] in a room of 4 x 3 m."""

    def __init__(self, at: dict[str, int]) -> None:
        self._map = sdk.ROS2Publisher("/map", MAP, **at)
        self._tf = sdk.ROS2Publisher("/tf", TF, **at)
        self._heard: dict[str, Any] = {}
        self._changed = threading.Event()
        latched = QosProfile(durability=QosDurability.TRANSIENT_LOCAL, history_depth=1)
        self._subscribers = [
            sdk.ROS2Subscriber(
                topic, schema, lambda m, t=topic: self._hear(t, m), qos=latched, **at
            )
            for topic, schema in HEARD.items()
        ]

    def drive(self) -> dict[str, Any]:
        """Publish map and place until path and coverage arrive; return these."""
        cells = np.zeros((60, 80), np.int8)
        cells[[0, -1]] = cells[:, [0, -1]] = 100
        info = self._make(
            "nav_msgs/msg/MapMetaData",
            map_load_time=self._time(),
            width=80,
            height=60,
            resolution=0.05,
            origin=self._make(
                "geometry_msgs/msg/Pose",
                position=self._point("Point", 0.0),
                orientation=self._turn(),
            ),
        )
        self._map.publish(header=self._header("map"), info=info, data=cells.ravel())
        link = self._make(
            "geometry_msgs/msg/Transform",
            translation=self._point("Vector3", 1.0),
            rotation=self._turn(),
        )
        stamped = self._make(
            "geometry_msgs/msg/TransformStamped",
            header=self._header("map"),
            child_frame_id="base_link",
            transform=link,
        )
        for _ in range(int(TIMEOUT_S / 0.1)):
            self._tf.publish(transforms=[stamped])
            if self._changed.wait(0.1):
                return self._heard
        raise SystemExit(f"received only {list(self._heard)}")

    def close(self) -> None:
        """Leave the graph."""
        for each in (*self._subscribers, self._map, self._tf):
            each.close()

    def _hear(self, topic: str, message: Any) -> None:
        if topic != "/coverage_path" or message.poses:
            self._heard[topic] = message
        if self._heard.keys() == HEARD.keys():
            self._changed.set()

    def _make(self, schema: str, **fields: Any) -> Any:
        return sdk.ZenohSession.get_instance().store.types[schema](**fields)

    def _time(self) -> Any:
        return self._make("builtin_interfaces/msg/Time", sec=7, nanosec=1)

    def _header(self, frame: str) -> Any:
        return self._make("std_msgs/msg/Header", stamp=self._time(), frame_id=frame)

    def _point(self, kind: str, at: float) -> Any:
        return self._make(f"geometry_msgs/msg/{kind}", x=at, y=at, z=0.0)

    def _turn(self) -> Any:
        return self._make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)


def main(port: int, domain: int, folder: Path) -> dict[str, Any]:
    """Return the graph and the messages received."""
    at = {"domain_id": domain, "router_port": port}
    sdk.ZenohSession.get_instance(router_port=port)
    write_definitions(folder)
    sdk.get_registry().messages_dir = folder
    topics = dict(sdk.get_topic_names_and_types(**at))
    info = sdk.get_topic_info("/coverage_path", verbose=True, **at)
    robot = Robot(at)
    heard = robot.drive()
    robot.close()
    sdk.ZenohSession.get_instance().close()
    path, grid = heard["/coverage_path"], heard["/coverage_grid"]
    return {
        "version": version("zenoh-ros2-sdk"),
        "topics": topics,
        "publishers": [[each.node_namespace, each.node_name] for each in info.publishers],
        "path": {
            "frame": path.header.frame_id,
            "stamp": [path.header.stamp.sec, path.header.stamp.nanosec],
            "xy": [[pose.pose.position.x, pose.pose.position.y] for pose in path.poses],
        },
        "grid": {
            "frame": grid.header.frame_id,
            "size": [grid.info.width, grid.info.height],
            "resolution": round(float(grid.info.resolution), 6),
            "values": sorted({int(value) for value in grid.data}),
        },
    }


if __name__ == "__main__":
    print(json.dumps(main(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]))))
