"""Names of the message types on the bus, and how a Zenoh encoding carries them."""

from __future__ import annotations

from typing import Final

OCCUPANCY_GRID: Final = "nav_msgs/msg/OccupancyGrid"
OCCUPANCY_GRID_UPDATE: Final = "map_msgs/msg/OccupancyGridUpdate"
POSE_STAMPED: Final = "geometry_msgs/msg/PoseStamped"
POSE_WITH_COVARIANCE_STAMPED: Final = "geometry_msgs/msg/PoseWithCovarianceStamped"
ODOMETRY: Final = "nav_msgs/msg/Odometry"
PATH: Final = "nav_msgs/msg/Path"
PHEROMONE_GRID: Final = "fasaco_msgs/msg/PheromoneGrid"

CDR: Final = "application/cdr"
JSON: Final = "application/json"


def cdr_encoding(schema: str) -> str:
    """Return the Zenoh encoding of a CDR message, ``application/cdr;<schema>``."""
    return f"{CDR};{schema}"


def schema_of(encoding: str) -> str | None:
    """Return the schema a Zenoh encoding names; None where it names none, as under ROS 2."""
    mime, _, schema = encoding.partition(";")
    return schema if mime == CDR and schema else None
