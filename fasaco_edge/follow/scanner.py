"""The lidar's beams as points in the robot's frame: x ahead, y to the left of its middle [m]."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fasaco_edge.grid.geometry import Point
from fasaco_edge.wire.messages.scans import LaserScan

# Points further away from the sensor do not matter yet [m].
REACH_M = 3.0
# Number of sectors; in each only the shortest beam counts.
SECTORS = 360
# A sensor is covered or broken if less than this share of its beams is valid.
LEAST_SHARE = 0.1


@dataclass(frozen=True, slots=True)
class Mount:
    """Where the lidar is mounted on the robot.

    Attributes:
        x, y: ahead of the robot's middle, and to its left [m].
        yaw: where its angle 0 points, from ahead to the left [rad].
        upside_down: whether its angles grow clockwise.
    """

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    upside_down: bool = False


def points_of(scan: LaserScan, mount: Mount) -> list[Point] | None:
    """Return the points of a scan within ``REACH_M``, at most ``SECTORS``.

    None for a sensor that sees nothing: less than ``LEAST_SHARE`` of its beams is valid.
    """
    shortest: dict[int, tuple[float, float]] = {}
    measured_beams = 0
    turn = -1.0 if mount.upside_down else 1.0
    for index, measured in enumerate(scan.ranges):
        # NaN, and ranges beyond the sensor's limits, are invalid; minus infinity: too near to
        # measure.
        length = scan.least_m if measured == -math.inf else measured
        if not length >= scan.least_m:
            continue
        measured_beams += 1
        if length > REACH_M or length > scan.most_m:
            continue
        angle = turn * (scan.first_rad + index * scan.step_rad) + mount.yaw
        sector = round(angle * SECTORS / math.tau) % SECTORS
        if sector not in shortest or length < shortest[sector][0]:
            shortest[sector] = length, angle
    if measured_beams < LEAST_SHARE * len(scan.ranges):
        return None
    return [
        (mount.x + length * math.cos(angle), mount.y + length * math.sin(angle))
        for length, angle in shortest.values()
    ]
