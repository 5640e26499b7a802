"""Rerun archetypes of messages: metres, z up, rows flipped.

A grid's row 0 has the smallest y, an image's row 0 is its top: every grid is flipped here, and
nowhere else.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge import states
from fasaco_edge.grid.geometry import Bounds, GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.recording import entities
from fasaco_edge.recording.sdk import rr
from fasaco_edge.recording.write.writer import RecordingWriter
from fasaco_edge.states import State
from fasaco_edge.wire.messages.pheromone import PheromoneMessage

Colour = tuple[int, int, int]

ROBOT_COLOUR: Colour = (220, 38, 38)
HEADING_COLOUR: Colour = (250, 204, 21)
COVERED_COLOUR: Colour = (56, 152, 222)
REVISITED_COLOUR: Colour = (245, 140, 40)
SWEPT_COLOUR: Colour = (45, 212, 191)
LABEL_COLOUR: Colour = (255, 255, 255)
# Bright, as labels have the same colours, on a dark background.
START_COLOUR: Colour = (74, 222, 128)
END_COLOUR: Colour = (251, 113, 133)

# Heights [m] only order the layers: the camera looks straight down.
ROBOT_Z, LABEL_Z = 0.06, 0.1
# Size on the screen [points].
MARK_RADIUS = 5.0
MAP_ORDER, FLOOR_ORDER = 0.0, 0.5

# Largest tangent of a bend that counts as straight.
STRAIGHT = 1e-6


@dataclass(frozen=True, slots=True)
class LineStyle:
    """Style of a line: its colour, its height ``z`` [m], its width [points of the screen]."""

    colour: Colour
    z: float
    width: float


WINDOW = LineStyle((219, 39, 119), z=0.055, width=2.0)
# Rooms lie below all that moves; their names have the same colour, on dark labels.
ROOM = LineStyle((251, 146, 60), z=0.015, width=1.0)
OLD_PATH = LineStyle((196, 181, 253), z=0.03, width=0.8)
PATH = LineStyle((124, 58, 237), z=0.04, width=1.2)
DRIVEN = LineStyle((5, 150, 105), z=0.05, width=1.6)
ZONE = LineStyle((37, 99, 235), z=0.052, width=2.0)
KEEP_OUT = LineStyle((234, 88, 12), z=0.053, width=2.4)
LINES = {
    entities.REPLAN_WINDOW: WINDOW,
    entities.ROOMS: ROOM,
    entities.OLD_PATH: OLD_PATH,
    entities.PATH: PATH,
    entities.DRIVEN_PATH: DRIVEN,
    entities.ZONES: ZONE,
    entities.KEEP_OUT: KEEP_OUT,
}


def map_archetype(grid: OccupancyGrid) -> rr.GridMap:
    """Return an occupancy grid in rviz's colours: free white, occupied black, unknown grey."""
    # -1 becomes 255, unknown in the colour map.
    pixels = grid.cells.view(np.uint8)
    return grid_archetype(grid.geometry, pixels, rr.components.Colormap.RvizMap, MAP_ORDER)


def floor_archetype(grid: OccupancyGrid) -> rr.GridMap:
    """Return swept floor as a layer over the map, whose opacity is the swept share of a pixel."""
    tints = np.zeros((256, 4), np.uint8)
    tints[:101, :3] = SWEPT_COLOUR
    tints[:101, 3] = np.linspace(0, entities.SWEPT_OPACITY, 101)
    return grid_archetype(grid.geometry, tints[grid.cells.view(np.uint8)], None, FLOOR_ORDER)


def pheromone_archetype(message: PheromoneMessage) -> rr.GridMap:
    """Return a pheromone field unchanged: one byte per cell, log scale, 0 black."""
    return grid_archetype(
        message.geometry, message.levels, rr.components.Colormap.Inferno, MAP_ORDER
    )


def line_archetype(xy: NDArray[np.float64], style: LineStyle) -> rr.LineStrips3D:
    """Return points [m], float64 (n, 2), as a line; an empty line for fewer than two points.

    ``style_archetype`` has its colour and width, which are logged once.
    """
    points = np.column_stack((xy, np.full(len(xy), style.z)))
    return rr.LineStrips3D.from_fields(strips=[points] if len(points) >= 2 else [])


def label_archetype(bounds: Bounds, text: str) -> rr.Points3D:
    """Return text at the upper edge of a rectangle (x_min, y_min, x_max, y_max) [m]."""
    place = ((bounds[0] + bounds[2]) / 2, bounds[3], LABEL_Z)
    return rr.Points3D([place], radii=0.0, labels=[text], colors=LABEL_COLOUR, show_labels=True)


def mark_archetype(pose: Pose2D, text: str, colour: Colour) -> rr.Points3D:
    """Return a point with a name."""
    place = (pose.x, pose.y, LABEL_Z)
    return rr.Points3D([place], radii=-MARK_RADIUS, labels=[text], colors=colour, show_labels=True)


def style_archetype(style: LineStyle) -> rr.LineStrips3D:
    """Return the style of lines; Rerun takes a width on the screen as a negative radius."""
    return rr.LineStrips3D.from_fields(colors=[style.colour], radii=[-style.width])


def corners(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the corners of a line (n, 2), float64 (k, 2).

    A path over the lattice is mostly straight lanes: the corners are a tenth of its points.
    """
    if len(xy) < 3:
        return xy
    steps = np.diff(xy, axis=0)
    across = steps[:-1, 0] * steps[1:, 1] - steps[:-1, 1] * steps[1:, 0]
    along = (steps[:-1] * steps[1:]).sum(axis=1)
    bends = np.ones(len(xy), bool)
    bends[1:-1] = (np.abs(across) > STRAIGHT * np.abs(along)) | (along <= 0)
    return xy[bends]


def pose_archetype(pose: Pose2D) -> rr.Transform3D:
    """Return the robot's pose, rounded to the millimetre to save space."""
    half = pose.yaw / 2
    return rr.Transform3D.from_fields(
        translation=[round(pose.x, 3), round(pose.y, 3), ROBOT_Z],
        quaternion=[0.0, 0.0, round(math.sin(half), 4), round(math.cos(half), 4)],
    )


def body_archetypes(
    radius_m: float, colour: Colour = ROBOT_COLOUR
) -> tuple[rr.Ellipsoids3D, rr.LineStrips3D]:
    """Return body and heading of a robot, in the robot's frame."""
    body = rr.Ellipsoids3D(
        half_sizes=[[radius_m, radius_m, 0.01]], colors=[colour], fill_mode="solid"
    )
    heading = rr.LineStrips3D(
        [[[0.0, 0.0, 0.03], [1.6 * radius_m, 0.0, 0.03]]], colors=[HEADING_COLOUR], radii=-2.5
    )
    return body, heading


def box_archetype(bounds: Bounds, style: LineStyle) -> rr.LineStrips3D:
    """Return the outline of a rectangle (x_min, y_min, x_max, y_max) [m]."""
    x0, y0, x1, y1 = bounds
    return line_archetype(np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)]), style)


def polygons_archetype(
    polygons: Sequence[tuple[str, NDArray[np.float64]]], style: LineStyle
) -> rr.LineStrips3D:
    """Return the outlines of named polygons, each of corners (n, 2) [m]."""
    closed = [np.vstack([corners, corners[:1]]) for _, corners in polygons]
    strips = [np.column_stack((xy, np.full(len(xy), style.z))) for xy in closed]
    names = [name for name, _ in polygons]
    return rr.LineStrips3D.from_fields(strips=strips, labels=names, show_labels=True)


def grid_archetype(
    geometry: GridGeometry,
    pixels: NDArray[np.uint8],
    colormap: rr.components.Colormap | None,
    order: float,
) -> rr.GridMap:
    """Return pixels, uint8 (rows, cols) or (rows, cols, 4) in RGBA, as a layer of the map."""
    origin = geometry.origin
    # Every message has all components: size and origin change while the map grows, and a static
    # component would hide later ones.
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


SHADES: dict[states.Colour, int] = {
    "grey": 0x6B7280FF,
    "violet": 0x7C3AEDFF,
    "green": 0x059669FF,
    "cyan": 0x2563EBFF,
    "blue": 0x2563EBFF,
    "amber": 0xD97706FF,
    "red": 0xDC2626FF,
}
STATES = {
    entities.MISSION_STATE: {
        **{state.value: SHADES[state.row.colour] for state in State},
        "silent": SHADES["amber"],
    },
    entities.RECORDER_STATE: {
        "recording": SHADES["green"],
        "disk full": SHADES["red"],
        "stalled": SHADES["amber"],
        "stopping": SHADES["grey"],
    },
}


def log_styles(writer: RecordingWriter) -> None:
    """Log the colours of all states and lines, and the up axis."""
    writer.log_static(entities.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    for entity, style in LINES.items():
        writer.log_static(entity, style_archetype(style))
    for entity, colours in STATES.items():
        names = list(colours)
        palette = np.array(list(colours.values()), np.uint32)
        writer.log_static(entity, rr.StateConfiguration(values=names, labels=names, colors=palette))
