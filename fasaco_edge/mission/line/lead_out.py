"""Lead-out: the first step of a robot whose disc does not fit where it stands.

A robot is a little off its line, poses are noisy, and walls get thicker from map to map. The step
leads away from obstacles that are too near, and comes nearer to none.
"""

from __future__ import annotations

import math

import numpy as np

from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import Window
from fasaco_edge.kernels.floor.bits import unpacked
from fasaco_edge.mission.line.polyline import Points
from fasaco_edge.mission.line.way import is_clear_between

# A robot nearer to an obstacle than this share of its radius has a wrong pose.
LEAST_SHARE = 0.5
# Number of nearest places tried for one with a straight, free way.
TRIED = 64
# Precision of a radius [pixels].
RADIUS_PX = 0.125


def fitting_radius(floor: FloorMap, here: Points) -> float:
    """Return the radius of the largest disc that fits at a point, the robot's at most [pixels].

    Args:
        floor: the floor.
        here: (2,): y, x [pixels].
    """
    most = floor.discs.radius_m / floor.geometry.resolution
    if is_clear_between(floor, here, here):
        return most
    fits, too_large = 0.0, most
    while too_large - fits > RADIUS_PX:
        middle = (fits + too_large) / 2
        if is_clear_between(floor, here, here, middle):
            fits = middle
        else:
            too_large = middle
    return fits


def leads_out(floor: FloorMap, here: Points, to: Points) -> bool:
    """Return whether ``lead_out`` leads a robot whose disc does not fit straight to a point.

    Args:
        floor: the floor.
        here, to: the robot's position and the point, (2,): y, x [pixels].
    """
    radius, most = fitting_radius(floor, here), floor.discs.radius_m / floor.geometry.resolution
    if not LEAST_SHARE * most <= radius < most or math.dist(here, to) > 2 * most:
        return False
    return is_clear_between(floor, to, to) and is_clear_between(floor, here, to, radius)


def lead_out(floor: FloorMap, here: Points) -> Points:
    """Return the place where the robot's disc fits again, float64 (1, 2): y, x [pixels].

    The result is empty, (0, 2), if the disc fits at ``here``, or if no straight way within the
    robot's diameter leads to such a place without coming nearer to an obstacle.

    Args:
        floor: the floor.
        here: the robot's position, (2,): y, x [pixels].
    """
    none, most = np.empty((0, 2)), floor.discs.radius_m / floor.geometry.resolution
    radius = fitting_radius(floor, here)
    if not LEAST_SHARE * most <= radius < most:
        return none
    low, high = np.floor(here - 2 * most).astype(int), np.ceil(here + 2 * most).astype(int) + 1
    whole = Window(0, 0, floor.geometry.rows, floor.geometry.cols)
    part = Window(*low.tolist(), *high.tolist()).intersection(whole)
    if part is None:
        return none
    places = unpacked(floor.places[part.row0 : part.row1], floor.geometry.cols)
    corner = np.array((part.row0, part.col0))
    near = (np.argwhere(places[:, part.col0 : part.col1]) + corner).astype(np.float64)
    order = np.argsort(((near - here) ** 2).sum(axis=1), kind="stable")[:TRIED]
    for place in near[order]:
        if is_clear_between(floor, here, place, radius):
            return np.array([place])
    return none
