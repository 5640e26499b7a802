"""Curver: fits curves to the line just ahead, for a robot that cannot turn on the spot.

The line further ahead may still change, and becomes a curve when the robot comes near. A curve
continues the previous curve, or begins at the robot's pose if the line changes there. Curves are
not polished.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.fine_raster import RobotDiscs, raster_to_map
from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.kernels.floor.bits import WORD, Bits, packed, unpacked
from fasaco_edge.kernels.floor.places import disc_rows, places_of
from fasaco_edge.kernels.floor.sweeps import NEVER
from fasaco_edge.mission.line.line_ahead import LineAhead
from fasaco_edge.mission.line.polyline import CURVED, Points
from fasaco_edge.mission.line.way import LEAST_SHARE, fitting_radius
from fasaco_edge.planners.curve_config import CurveConfig
from fasaco_edge.planners.curves import Curve, curve_along

# Once the curve ahead is shorter than AHEAD_M [m], the next piece of the line becomes a curve. The
# piece is PIECE_M [m] and PIECE_RADII turning radii long.
AHEAD_M, PIECE_M, PIECE_RADII = 6.0, 6.0, 6.0
# Share of a piece's curve that is kept; the rest is made again together with the next piece.
KEPT_SHARE = 0.6
# If a turn does not fit at the end of the curve, the curve is made anew from AGAIN_M ahead of the
# robot. The end of a curve shorter than LEAST_M has no certain direction [m].
AGAIN_M, LEAST_M = 0.5, 0.1
# The robot has left its curve if its heading is off by ASTRAY_RAD [rad], or its position by
# ASTRAY_M [m]. The curve then begins at the robot's pose, but not again within MOVED_M.
ASTRAY_RAD, ASTRAY_M, MOVED_M = math.radians(35.0), 0.1, 0.05
# Segments of the published line shorter than this have no direction of their own [m].
SHORT_M = 2e-3
# At a bend sharper than this, a robot that can drive backward reverses its direction [rad].
REVERSAL_RAD = math.radians(120.0)
# A curve stays within BESIDE_RADII turning radii and BESIDE_M [m] of its line.
BESIDE_RADII, BESIDE_M = 5.0, 1.0
# If the robot's disc does not fit at its pose, for instance after a pose error, the largest disc
# that fits there is used for the curve within this distance of the pose [m].
LEAVES_M = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """A part of a floor's raster, as ``planners.curves.Ground``, with the floor to sweep."""

    geometry: GridGeometry
    discs: RobotDiscs
    blocked: Bits
    places: Bits
    to_sweep: NDArray[np.bool_]

    @classmethod
    def around(
        cls, points: Points, floor: FloorMap, ahead: LineAhead, margin: float, *, leaves: bool
    ) -> _Part:
        """Return the part around points, float64 (n, 2): y, x [pixels].

        ``leaves``: whether the first point is the robot's place, at which its disc may not fit.
        """
        whole = floor.geometry
        (row0, col0), (row1, col1) = points.min(axis=0) - margin, points.max(axis=0) + margin
        box = Window(int(row0), int(col0) // WORD * WORD, int(row1) + 1, int(col1) + 1)
        part = box.intersection(whole.window)
        assert part is not None
        origin = Pose2D(*whole.to_map(float(part.col0), float(part.row0)), whole.origin.yaw)
        geometry = GridGeometry(part.rows, part.cols, whole.resolution, origin)
        rows = slice(part.row0, part.row1)
        words = slice(part.col0 // WORD, -(-part.col1 // WORD))
        counts = ahead.tally.sweeps.counts[rows, part.col0 : part.col1]
        places, blocked = floor.places[rows, words].copy(), floor.blocked[rows, words].copy()
        radius = fitting_radius(floor, points[0]) if leaves else math.inf
        if LEAST_SHARE * floor.discs.radius_m <= radius * whole.resolution < floor.discs.radius_m:
            near = unpacked(places_of(blocked, disc_rows(radius)), part.cols)
            away = np.arange(part.rows)[:, None] + part.row0, np.arange(part.cols) + part.col0
            squares = (away[0] - points[0][0]) ** 2 + (away[1] - points[0][1]) ** 2
            near &= squares * whole.resolution**2 <= LEAVES_M**2
            places |= packed(near, beyond=False)
        return cls(geometry, floor.discs, blocked, places, counts < NEVER)


class Curver:
    """Replaces pieces of the line by curves.

    Args:
        config: limits of the robot, and prices of its curves.
    """

    def __init__(self, config: CurveConfig) -> None:
        self._config = config
        # The robot's place when it last left its curve, x, y [m].
        self._astray_at = (math.inf, math.inf)

    def curve(self, ahead: LineAhead, floor: FloorMap, pose: Pose2D) -> bool:
        """Make a curve of the next piece, if it is due; return whether the line has changed.

        Args:
            ahead: the line.
            floor: the floor under it.
            pose: pose of the robot.
        """
        count = len(ahead.line)
        curved = ahead.line.first_below(CURVED)
        if curved > 1 and self._has_left(ahead, floor, pose):
            curved = 0
        piece_m = PIECE_M + PIECE_RADII * self._config.radius_m
        lengths = ahead.lengths(AHEAD_M + 2.0 * piece_m)
        if (
            count < 2
            or curved == count
            or (curved and lengths[min(curved, len(lengths)) - 1] > AHEAD_M)
        ):
            return False
        # Begin at the end of the curve; if a turn does not fit, further back, or at the robot.
        begins = [curved - 1] if curved > 1 and lengths[curved - 1] >= LEAST_M else []
        near = int(np.searchsorted(lengths, AGAIN_M))
        begins += [near] if 1 < near < curved - 1 else []
        best: tuple[int, int, Curve] | None = None
        for first in (*begins, 0):
            end = int(np.searchsorted(lengths, lengths[first] + piece_m)) + 1
            end = min(max(end, first + 2), count)
            curve = self._piece(ahead, floor, pose, first, end)
            if best is None or curve.spots < best[2].spots:
                best = first, end, curve
            if not curve.spots:
                break
        assert best is not None
        self._put(ahead, floor, *best)
        return True

    def yaw(self, xy: Points, pose: Pose2D) -> NDArray[np.float64]:
        """Return the robot's heading at points of its line, float64 (n,) [rad].

        Args:
            xy: float64 (n, 2): x, y [m], from the robot on.
            pose: pose of the robot.
        """
        if len(xy) < 2:
            return np.full(len(xy), pose.yaw)
        ways = np.diff(xy, axis=0)
        along = np.arctan2(ways[:, 1], ways[:, 0])
        # Short segments get the direction of the next segment.
        numbers = np.where(np.hypot(*ways.T) < SHORT_M, len(ways) - 1, np.arange(len(ways)))
        along = along[np.minimum.accumulate(numbers[::-1])[::-1]]
        is_back = np.zeros(len(ways), np.bool_)
        if self._config.reverses:
            bends = np.abs(np.remainder(np.diff(along) + np.pi, 2.0 * np.pi) - np.pi)
            begins_back = math.cos(float(along[0]) - pose.yaw) < 0.0
            changes = np.concatenate([[begins_back], bends > REVERSAL_RAD])
            is_back = np.cumsum(changes) % 2 == 1
        yaw = along + np.pi * is_back
        return np.append(yaw, yaw[-1])

    def _has_left(self, ahead: LineAhead, floor: FloorMap, pose: Pose2D) -> bool:
        """Return whether the robot has left its curve; False near the place where it last did."""
        beside, here = ahead.beside, (pose.x, pose.y)
        edge_m = math.dist(*ahead.line.points[:2]) * floor.geometry.resolution
        if beside is None or edge_m < SHORT_M or math.dist(here, self._astray_at) < MOVED_M:
            return False
        yaw = pose.yaw - floor.geometry.origin.yaw
        turned = abs(math.remainder(beside.heading - yaw, math.pi))
        has_left = turned > ASTRAY_RAD or abs(beside.left_m) > ASTRAY_M
        if has_left:
            self._astray_at = here
        return has_left

    def _piece(
        self, ahead: LineAhead, floor: FloorMap, pose: Pose2D, first: int, end: int
    ) -> Curve:
        points = ahead.line.points[:end].copy()
        if not first:
            points[0] = ahead.place
        xy = raster_to_map(floor.geometry, points)
        yaw = pose.yaw
        if first:
            # Take the heading of the segment before ``first``, as the line may bend at that point.
            yaw = float(self.yaw(xy[: first + 1], pose)[-1])
        margin = (BESIDE_RADII * self._config.radius_m + BESIDE_M) / floor.geometry.resolution
        part = _Part.around(points[first:], floor, ahead, margin, leaves=not first)
        return curve_along(
            xy[first:], part, part.to_sweep, self._config, start_yaw=yaw, is_end_fixed=True
        )

    def _put(self, ahead: LineAhead, floor: FloorMap, first: int, end: int, curve: Curve) -> None:
        """Replace the points of a piece by its curve, except for the last part before the end."""
        kept = len(curve.poses)
        if end < len(ahead.line):
            ways = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(curve.xy, axis=0).T))])
            on_line = np.flatnonzero(curve.legs > 0)
            early = on_line[ways[on_line] <= KEPT_SHARE * ways[-1]]
            late = on_line[:1] if not len(early) else early[-1:]
            if len(late):
                kept = int(late[0]) + 1
                # Keep the rest of the segment on which the last kept pose lies.
                end = first + int(curve.legs[kept - 1]) + 1
        ahead.put_curve(first, end, curve.xy[:kept])
