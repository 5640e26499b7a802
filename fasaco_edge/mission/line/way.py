"""Way: a line that leads to a place without sweeping, with few corners.

A diagonal walk over cells is a staircase: its turns on the spot take twice as long as the driving.

Lead-out: the first step of a robot whose disc does not fit where it stands, because it is off its
line, its pose is noisy, or a wall is thicker on the newest map. The step leads away from obstacles
that are too near, and comes nearer to none.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.fine_raster import map_to_raster
from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import Pose2D, Window
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.floor.bits import unpacked
from fasaco_edge.kernels.floor.capsule import is_clear
from fasaco_edge.kernels.floor.turning import turn_seconds
from fasaco_edge.kernels.lattice.reach import shortest_walk
from fasaco_edge.mission.config import Sweeping
from fasaco_edge.mission.line.polyline import Points

# A straight part of a way spans at most this many corners of the walk, enough to cross a hall.
MOST_SPANNED = 40
# A detour stays within DETOUR_M [m] of its ends, and begins within BESIDE_PX [pixels] of them.
DETOUR_M, BESIDE_PX = 2.0, 2.0
# A robot nearer to an obstacle than this share of its radius has a wrong pose.
LEAST_SHARE = 0.5
# A lead-out ends at one of this many nearest places where the disc fits.
NEAREST_PLACES = 64
# Precision of a radius [pixels].
RADIUS_ERROR_PX = 0.125


def is_clear_between(floor: FloorMap, a: Points, b: Points, radius: float | None = None) -> bool:
    """Return whether the robot can drive straight between two points, (2,): y, x [pixels].

    ``radius``: radius of a smaller disc [pixels]; None for the robot's disc.
    """
    if math.isnan(b[0]):
        return False
    if radius is None:
        radius = floor.discs.radius_m / floor.geometry.resolution
    return bool(is_clear(floor.blocked, a[0], a[1], b[0], b[1], radius))


def sees_on(floor: FloorMap, a: Points, b: Points) -> bool:
    """Return whether the robot can drive straight between two points, (2,): x, y [m]."""
    ends = [np.array(map_to_raster(floor.geometry, *point.tolist())) for point in (a, b)]
    return is_clear_between(floor, ends[0], ends[1])


def comes_nearer(a: Points, b: Points, beside: Points, start: Points | None = None) -> bool:
    """Return whether a straight way enters a disc, or leads deeper into one.

    Args:
        a, b: its ends, (2,).
        beside: the discs, float64 (k, 3): centres and radii, in the units of the ends.
        start: the robot's place, which may be in a disc; None for ``a``.
    """
    edge, to = b - a, beside[:, :2] - a
    share = np.clip(to @ edge / max(float(edge @ edge), 1e-12), 0.0, 1.0)
    nearest = np.hypot(*(to - share[:, None] * edge).T)
    at_start = np.hypot(*(beside[:, :2] - (a if start is None else start)).T)
    return bool((nearest < np.minimum(beside[:, 2], at_start) - 1e-6).any())


def corner_past(a: Points, b: Points, beside: Points) -> Points | None:
    """Return the corner of a way from ``a`` to ``b`` past discs; None if it comes nearer to one.

    The way to the corner is at right angles to the direction of the nearest disc.

    Args:
        a, b, beside: as for ``comes_nearer``; at least one disc.
    """
    away = a - beside[np.argmin(np.hypot(*(beside[:, :2] - a).T)), :2]
    across = b - a - away * ((b - a) @ away / max(float(away @ away), 1e-12))
    corner: Points = a + across
    is_nearer = comes_nearer(a, corner, beside) or comes_nearer(corner, b, beside, a)
    return None if is_nearer else corner


def discs_on(floor: FloorMap, beside: NDArray[np.float64] | None) -> Points:
    """Return the discs of ``Route.beside`` on the raster, float64 (k, 3): y, x, radius [pixels]."""
    near, unit_m = () if beside is None else beside.tolist(), floor.geometry.resolution
    discs = [(*map_to_raster(floor.geometry, x, y), radius_m / unit_m) for x, y, radius_m in near]
    return np.array(discs, np.float64).reshape(-1, 3)


def shortened(
    points: Points, floor: FloorMap, beside: NDArray[np.float64] | None = None
) -> NDArray[np.intp]:
    """Return the indices of the points of a way that skips corners wherever the floor is clear.

    Args:
        points: float64 (n, 2), n >= 1: y, x [pixels]; its straight parts are clear.
        floor: the floor.
        beside: discs that the new way keeps clear of, as ``Route.beside``; None for none.
    """
    discs = discs_on(floor, beside)

    def may_skip(a: Points, b: Points) -> bool:
        return is_clear_between(floor, a, b) and not comes_nearer(a, b, discs)

    kept, last = [0], len(points) - 1
    while kept[-1] < last:
        at = kept[-1]
        farthest = min(at + MOST_SPANNED, last)
        while farthest > at + 1 and not may_skip(points[at], points[farthest]):
            farthest -= 1
        kept.append(farthest)
    return np.array(kept, np.intp)


def corners_between(floor: FloorMap, a: Points, b: Points) -> Points:
    """Return the corners of a short way between two points, round the obstacles between them.

    Args:
        floor: the floor.
        a, b: points, (2,): y, x [pixels], at which the robot's disc fits.

    Returns:
        float64 (n, 2), both points excluded; n is 0 if no way is found within ``DETOUR_M`` around
        them, or they are farther apart than that.
    """
    margin = math.ceil(DETOUR_M / floor.geometry.resolution)
    none = np.empty((0, 2))
    if np.isnan([a, b]).any() or np.abs(b - a).max() > margin:
        return none
    low, high = np.floor(np.minimum(a, b)) - margin, np.ceil(np.maximum(a, b)) + margin + 1.0
    around = Window(*low.astype(int).tolist(), *high.astype(int).tolist())
    part = around.intersection(floor.geometry.window)
    if part is None:
        return none
    places = unpacked(floor.places[part.row0 : part.row1], floor.geometry.cols)
    places = places[:, part.col0 : part.col1]
    corner = np.array((part.row0, part.col0))
    ends = [_place_beside(floor, places, point, corner) for point in (a, b)]
    if ends[0] is None or ends[1] is None:
        return none
    steps = CoverageLattice.from_free(places).steps
    walk = shortest_walk(steps, ends[0], ends[1])
    if not len(walk):
        return none
    points = np.concatenate([a[None], (walk + corner).astype(np.float64), b[None]])
    points = points[shortened(points, floor)]
    is_way = all(is_clear_between(floor, *ends) for ends in pairwise(points))
    return points[1:-1] if is_way else none


def _place_beside(
    floor: FloorMap, places: NDArray[np.bool_], point: Points, corner: NDArray[np.int64]
) -> tuple[int, int] | None:
    """Return the nearest place with a clear straight way to a point; None for none."""
    near = np.argwhere(places)
    apart = ((near + corner - point) ** 2).sum(axis=1)
    near = near[apart <= BESIDE_PX**2]
    order = np.argsort(apart[apart <= BESIDE_PX**2], kind="stable")
    for row, col in near[order].tolist():
        place = np.array((row, col), np.float64) + corner
        if is_clear_between(floor, point, place):
            return row, col
    return None


def way_s(walk: NDArray[np.int32], pose: Pose2D, floor: FloorMap, sweeping: Sweeping) -> float:
    """Return how long the way along a walk takes [s].

    Includes a half turn at each end, as the robot may face the other way.

    Args:
        walk: int32 (n, 2), n >= 1, cells (row, col), each a legal step from the previous one.
        pose: pose of the robot, in or near the first cell.
        floor, sweeping: floor and sweeping of the mission.
    """
    points, _ = floor.stands.line(walk)
    here = np.array(map_to_raster(floor.geometry, pose.x, pose.y))
    points = np.concatenate([here[None], points])
    edges = np.diff(points[shortened(points, floor)], axis=0)
    way_m = float(np.hypot(*edges.T).sum()) * floor.geometry.resolution
    headings = np.arctan2(*edges.T)
    turns = np.abs((np.diff(headings) + math.pi) % math.tau - math.pi)
    turning = sweeping.line.turning
    turning_s = sum(turn_seconds(turning, turn) for turn in (*turns.tolist(), math.pi, math.pi))
    return way_m / sweeping.line.speed_m_s + turning_s


def fitting_radius(floor: FloorMap, here: Points) -> float:
    """Return the radius of the largest disc that fits at a point, up to the robot's [pixels].

    Args:
        floor: the floor.
        here: (2,): y, x [pixels].
    """
    most = floor.discs.radius_m / floor.geometry.resolution
    if is_clear_between(floor, here, here):
        return most
    fits, too_large = 0.0, most
    while too_large - fits > RADIUS_ERROR_PX:
        middle = (fits + too_large) / 2
        if is_clear_between(floor, here, here, middle):
            fits = middle
        else:
            too_large = middle
    return fits


def leads_out(floor: FloorMap, here: Points, to: Points) -> bool:
    """Return whether a straight lead-out to a point exists for a robot whose disc does not fit.

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
    part = Window(*low.tolist(), *high.tolist()).intersection(floor.geometry.window)
    if part is None:
        return none
    places = unpacked(floor.places[part.row0 : part.row1], floor.geometry.cols)
    corner = np.array((part.row0, part.col0))
    near = (np.argwhere(places[:, part.col0 : part.col1]) + corner).astype(np.float64)
    order = np.argsort(((near - here) ** 2).sum(axis=1), kind="stable")[:NEAREST_PLACES]
    for place in near[order]:
        if is_clear_between(floor, here, place, radius):
            return np.array([place])
    return none
