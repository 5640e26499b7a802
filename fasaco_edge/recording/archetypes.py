"""Messages as what rerun draws: metres, z up, rows turned over.

A grid's row 0 has the smallest y, an image's row 0 is its top: every grid is
flipped here, and nowhere else.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.recording.sdk import rr
from fasaco_edge.wire.coverage import BLOCKED, COVERED, RECOVERED, TO_COVER
from fasaco_edge.wire.pheromone import PheromoneMessage

Colour = tuple[int, int, int]
Bounds = tuple[float, float, float, float]

PATH_COLOUR: Colour = (124, 58, 237)
OLD_PATH_COLOUR: Colour = (196, 181, 253)
TRAIL_COLOUR: Colour = (5, 150, 105)
ROBOT_COLOUR: Colour = (220, 38, 38)
HEADING_COLOUR: Colour = (250, 204, 21)
CHANGE_COLOUR: Colour = (219, 39, 119)
COVERED_COLOUR: Colour = (56, 152, 222)
RECOVERED_COLOUR: Colour = (245, 140, 40)
BLOCKED_COLOUR: Colour = (120, 120, 130)

# Heights [m] only say what lies on what: the eye looks down from far above.
CHANGE_Z, OLD_PATH_Z, PATH_Z, TRAIL_Z, ROBOT_Z = 0.02, 0.03, 0.04, 0.05, 0.06
MAP_ORDER, COVERAGE_ORDER = 0.0, 1.0

# Widths in points of the screen, which rerun takes as negative radii.
PATH_RADIUS, OLD_PATH_RADIUS, TRAIL_RADIUS = -1.2, -0.8, -1.6


def map_archetype(grid: OccupancyGrid) -> rr.GridMap:
    """Return an occupancy grid in rviz's colours: free white, occupied black, unknown grey."""
    # -1 seen as 255 is what the colour map takes for unknown.
    pixels = grid.cells.view(np.uint8)
    return _grid(grid.geometry, pixels, rr.components.Colormap.RvizMap, MAP_ORDER)


def coverage_archetype(grid: OccupancyGrid) -> rr.GridMap:
    """Return a coverage grid to lie over the map: covered, re-covered and blocked cells tinted."""
    tints = np.zeros((256, 4), np.uint8)
    tints[COVERED] = (*COVERED_COLOUR, 120)
    tints[RECOVERED] = (*RECOVERED_COLOUR, 140)
    tints[BLOCKED] = (*BLOCKED_COLOUR, 40)
    return _grid(grid.geometry, tints[grid.cells.view(np.uint8)], None, COVERAGE_ORDER)


def pheromone_archetype(message: PheromoneMessage) -> rr.GridMap:
    """Return a pheromone field as it came: one byte per cell, log scale, 0 black."""
    return _grid(message.geometry, message.levels, rr.components.Colormap.Inferno, MAP_ORDER)


def path_archetype(
    xy: NDArray[np.float64], colour: Colour, z: float, radius: float
) -> rr.LineStrips3D:
    """Return a path, points [m] float64 (n, 2), as a line; nothing for fewer than two points."""
    points = np.column_stack((xy, np.full(len(xy), z)))
    strips = [points] if len(points) >= 2 else []
    return rr.LineStrips3D(strips, colors=[colour] * len(strips), radii=[radius] * len(strips))


def pose_archetype(pose: Pose2D) -> rr.Transform3D:
    """Return the robot's place."""
    turn = rr.RotationAxisAngle([0.0, 0.0, 1.0], pose.yaw)
    return rr.Transform3D(translation=[pose.x, pose.y, ROBOT_Z], rotation=turn)


def body_archetypes(radius_m: float) -> tuple[rr.Ellipsoids3D, rr.LineStrips3D]:
    """Return a robot of ``radius_m`` [m] around its own origin: the body, and its heading."""
    body = rr.Ellipsoids3D(
        half_sizes=[[radius_m, radius_m, 0.01]], colors=[ROBOT_COLOUR], fill_mode="solid"
    )
    heading = rr.LineStrips3D(
        [[[0.0, 0.0, 0.03], [1.6 * radius_m, 0.0, 0.03]]], colors=[HEADING_COLOUR], radii=-2.5
    )
    return body, heading


def change_archetype(bounds: Bounds) -> rr.LineStrips3D:
    """Return the outline of a rectangle (x_min, y_min, x_max, y_max) [m] of the map."""
    x0, y0, x1, y1 = bounds
    corners = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)])
    return path_archetype(corners, CHANGE_COLOUR, CHANGE_Z, TRAIL_RADIUS)


def coverage_fractions(grid: OccupancyGrid) -> tuple[float, float]:
    """Return which fractions of the coverable cells are covered, and covered more than once."""
    counts = np.bincount(grid.cells.view(np.uint8).ravel(), minlength=256)
    recovered = int(counts[RECOVERED])
    covered = int(counts[COVERED]) + recovered
    coverable = int(counts[TO_COVER]) + covered
    return (covered / coverable, recovered / coverable) if coverable else (0.0, 0.0)


def _grid(
    geometry: GridGeometry,
    pixels: NDArray[np.uint8],
    colormap: rr.components.Colormap | None,
    order: float,
) -> rr.GridMap:
    origin = geometry.origin
    # All of it with every message: size and origin change while the map grows, and
    # what was once logged static would hide what comes later.
    return rr.GridMap(
        data=pixels[::-1].tobytes(),
        format=rr.components.ImageFormat(
            width=geometry.cols,
            height=geometry.rows,
            color_model="L" if pixels.ndim == 2 else "RGBA",
            channel_datatype="U8",
        ),
        cell_size=geometry.resolution,
        translation=[origin.x, origin.y, 0.0],
        quaternion=[0.0, 0.0, math.sin(origin.yaw / 2), math.cos(origin.yaw / 2)],
        colormap=colormap,
        draw_order=order,
    )
