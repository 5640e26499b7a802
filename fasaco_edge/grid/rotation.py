"""Rotations about the map frame's origin, which align a building's walls with the lattice's axes.

Instead of the lattice, the map below it is rotated: pixels keep their values, and only their
placement changes.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Point, Polygon, Pose2D


def rotated_point(x: float, y: float, by_deg: float) -> Point:
    """Return a point x, y [m] rotated by ``by_deg`` [deg]."""
    cos, sin = math.cos(math.radians(by_deg)), math.sin(math.radians(by_deg))
    return cos * x - sin * y, sin * x + cos * y


def rotated_points(points: NDArray[np.float64], by_deg: float) -> NDArray[np.float64]:
    """Return points x, y [m], float64 (n, 2), rotated by ``by_deg`` [deg]."""
    cos, sin = math.cos(math.radians(by_deg)), math.sin(math.radians(by_deg))
    x, y = points[:, 0], points[:, 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=1)


def rotated_polygon(polygon: Polygon, by_deg: float) -> Polygon:
    """Return a polygon rotated by ``by_deg`` [deg]."""
    return tuple(rotated_point(x, y, by_deg) for x, y in polygon)


def rotated_pose(pose: Pose2D, by_deg: float) -> Pose2D:
    """Return a pose rotated by ``by_deg`` [deg]."""
    return Pose2D(*rotated_point(pose.x, pose.y, by_deg), pose.yaw + math.radians(by_deg))


def rotated_geometry(geometry: GridGeometry, by_deg: float) -> GridGeometry:
    """Return the placement of a grid rotated by ``by_deg`` [deg].

    Rotated by minus their angle, the walls of a building are parallel to the axes.
    """
    return replace(geometry, origin=rotated_pose(geometry.origin, by_deg))
