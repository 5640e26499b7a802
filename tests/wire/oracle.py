"""ROS messages as another library writes and reads them: rosbags, the judge of our bytes."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.host.resources import folder
from fasaco_edge.wire import schemas

STORE = get_typestore(Stores.ROS2_JAZZY)
for _schema in (schemas.OCCUPANCY_GRID_UPDATE, schemas.PHEROMONE_GRID):
    _definition = folder("protocol") / "msg" / f"{_schema.rsplit('/', 1)[1]}.msg"
    STORE.register(get_types_from_msg(_definition.read_text(), _schema))

TRIGGER_RESPONSE = "std_srvs/msg/Trigger_Response"
STORE.register(get_types_from_msg("bool success\nstring message\n", TRIGGER_RESPONSE))

SECOND_NS = 1_000_000_000
FRAMES = ("", "m", "ma", "map", "odom", "robot1", "robot1/map", "Fußboden", "地図", "x" * 256)


def to_bytes(schema: str, message: object) -> bytes:
    return bytes(STORE.serialize_cdr(message, schema, little_endian=True))


def from_bytes(schema: str, payload: bytes) -> Any:
    return STORE.deserialize_cdr(payload, schema)


def make(schema: str, **fields: object) -> Any:
    return STORE.types[schema](**fields)


def time(stamp_ns: int) -> Any:
    sec, nanosec = divmod(stamp_ns, SECOND_NS)
    return make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)


def header(frame: str, stamp_ns: int) -> Any:
    return make("std_msgs/msg/Header", stamp=time(stamp_ns), frame_id=frame)


def pose(where: Pose2D) -> Any:
    sin, cos = float(np.sin(where.yaw / 2)), float(np.cos(where.yaw / 2))
    return make(
        "geometry_msgs/msg/Pose",
        position=make("geometry_msgs/msg/Point", x=where.x, y=where.y, z=0.0),
        orientation=make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=sin, w=cos),
    )


def occupancy_grid(frame: str, stamp_ns: int, geometry: GridGeometry, cells: Any) -> Any:
    info = make(
        "nav_msgs/msg/MapMetaData",
        map_load_time=time(stamp_ns),
        resolution=geometry.resolution,
        width=geometry.cols,
        height=geometry.rows,
        origin=pose(geometry.origin),
    )
    head = header(frame, stamp_ns)
    return make(schemas.OCCUPANCY_GRID, header=head, info=info, data=cells.ravel())


def update(frame: str, stamp_ns: int, corner: tuple[int, int], cells: Any) -> Any:
    return make(
        schemas.OCCUPANCY_GRID_UPDATE,
        header=header(frame, stamp_ns),
        x=corner[0],
        y=corner[1],
        width=cells.shape[1],
        height=cells.shape[0],
        data=cells.ravel(),
    )


def pose_stamped(frame: str, stamp_ns: int, where: Any) -> Any:
    return make(schemas.POSE_STAMPED, header=header(frame, stamp_ns), pose=where)


def pose_with_covariance(where: Any, covariance: Any) -> Any:
    return make("geometry_msgs/msg/PoseWithCovariance", pose=where, covariance=covariance)


def pose_with_covariance_stamped(frame: str, stamp_ns: int, where: Any, covariance: Any) -> Any:
    return make(
        schemas.POSE_WITH_COVARIANCE_STAMPED,
        header=header(frame, stamp_ns),
        pose=pose_with_covariance(where, covariance),
    )


def twist(numbers: Any) -> Any:
    x, y, z, roll, pitch, yaw = (float(value) for value in numbers)
    vector = partial(make, "geometry_msgs/msg/Vector3")
    return make(schemas.TWIST, linear=vector(x=x, y=y, z=z), angular=vector(x=roll, y=pitch, z=yaw))


def scan(ranges: Any, first_rad: float, step_rad: float) -> Any:
    """Return a sensor_msgs/LaserScan without intensities."""
    return make(
        schemas.LASER_SCAN,
        header=header("", 0),
        angle_min=first_rad,
        angle_max=first_rad + step_rad * (len(ranges) - 1),
        angle_increment=step_rad,
        range_min=0.25,
        range_max=8.0,
        time_increment=0.0,
        scan_time=0.0,
        ranges=np.array(ranges, np.float32),
        intensities=np.ones(0, np.float32),
    )


def odometry(
    frame: str, stamp_ns: int, child: str, where: Any, covariance: Any, numbers: Any, spread: Any
) -> Any:
    """Return a nav_msgs/Odometry; ``numbers`` are those of its twist."""
    return make(
        schemas.ODOMETRY,
        header=header(frame, stamp_ns),
        child_frame_id=child,
        pose=pose_with_covariance(where, covariance),
        twist=make(
            "geometry_msgs/msg/TwistWithCovariance", twist=twist(numbers), covariance=spread
        ),
    )


def path(frame: str, stamp_ns: int, poses: list[tuple[str, int, Any]]) -> Any:
    """Return a nav_msgs/Path of poses, each with its own frame and stamp."""
    return make(
        schemas.PATH, header=header(frame, stamp_ns), poses=[pose_stamped(*each) for each in poses]
    )


def transforms(*each: tuple[str, str, int, Any]) -> Any:
    """Return a tf2_msgs/TFMessage; of each transform frame, child, stamp [ns] and pose."""
    return make(
        schemas.TF_MESSAGE,
        transforms=[
            make(
                "geometry_msgs/msg/TransformStamped",
                header=header(frame, stamp_ns),
                child_frame_id=child,
                transform=make(
                    "geometry_msgs/msg/Transform",
                    translation=make(
                        "geometry_msgs/msg/Vector3",
                        x=where.position.x,
                        y=where.position.y,
                        z=where.position.z,
                    ),
                    rotation=where.orientation,
                ),
            )
            for frame, child, stamp_ns, where in each
        ],
    )
