"""Names of the message types on the bus; a Zenoh encoding carries them as its schema."""

from __future__ import annotations

from typing import Final

OCCUPANCY_GRID: Final = "nav_msgs/msg/OccupancyGrid"
OCCUPANCY_GRID_UPDATE: Final = "map_msgs/msg/OccupancyGridUpdate"
POSE_STAMPED: Final = "geometry_msgs/msg/PoseStamped"
POSE_WITH_COVARIANCE_STAMPED: Final = "geometry_msgs/msg/PoseWithCovarianceStamped"
ODOMETRY: Final = "nav_msgs/msg/Odometry"
TF_MESSAGE: Final = "tf2_msgs/msg/TFMessage"
PATH: Final = "nav_msgs/msg/Path"
TWIST: Final = "geometry_msgs/msg/Twist"
TWIST_STAMPED: Final = "geometry_msgs/msg/TwistStamped"
BATTERY_STATE: Final = "sensor_msgs/msg/BatteryState"
LASER_SCAN: Final = "sensor_msgs/msg/LaserScan"
DIAGNOSTIC_ARRAY: Final = "diagnostic_msgs/msg/DiagnosticArray"
PHEROMONE_GRID: Final = "fasaco_msgs/msg/PheromoneGrid"

POSE_SCHEMAS = (POSE_STAMPED, POSE_WITH_COVARIANCE_STAMPED, ODOMETRY)
"""Message types of a robot's pose."""
TWIST_SCHEMAS = (TWIST, TWIST_STAMPED)
"""Message types of a base's velocities."""
