"""Rooms drawn pixel by pixel, the cells where a robot fits, and messages encoded by rosbags."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fasaco_edge.daemon.ledger.writer import PERIOD_S
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from tests.support.outsider import Outsider
from tests.wire import oracle

RESOLUTION_M = 0.05
TOOL_M = 0.3
RADIUS_M = 0.18
FREE, WALL, UNKNOWN = 0, 100, -1

Pixels = NDArray[np.int8]
Cell = tuple[int, int]


def room(width_m: float, height_m: float) -> Pixels:
    """Return an empty room within walls one pixel thick, its outer corner at the origin."""
    rows, cols = round(height_m / RESOLUTION_M), round(width_m / RESOLUTION_M)
    pixels = np.full((rows, cols), FREE, np.int8)
    pixels[[0, -1]] = WALL
    pixels[:, [0, -1]] = WALL
    return pixels


def fill(pixels: Pixels, x0: float, y0: float, x1: float, y1: float, value: int) -> Pixels:
    """Return ``pixels`` with a rectangle, given in metres, of ``value``."""
    filled = pixels.copy()
    columns, rows = _span(x0, x1), _span(y0, y1)
    filled[rows, columns] = value
    return filled


def pillared_room() -> Pixels:
    """Return a room of 4 x 3 m with a pillar in it."""
    return fill(room(4.0, 3.0), 2.0, 1.0, 2.4, 1.4, WALL)


def two_rooms(*, door: bool) -> Pixels:
    """Return two rooms of 3 x 3 m; between them a wall, with a door of 1 m or without."""
    closed = fill(room(6.0, 3.0), 3.0, 0.0, 3.1, 3.0, WALL)
    return fill(closed, 3.0, 1.0, 3.1, 2.0, FREE) if door else closed


def coverable_cells(pixels: Pixels) -> set[Cell]:
    """Return the cells (row, col) at whose centre the robot's disc touches free pixels only."""
    rows, cols = pixels.shape
    bad = [(float(c), float(r)) for r, c in np.argwhere(pixels != FREE)]
    # A ring of pixels around the map stands for the unknown area outside.
    bad += [(float(c), float(r)) for r in (-1, rows) for c in range(-1, cols + 1)]
    bad += [(float(c), float(r)) for c in (-1, cols) for r in range(rows)]
    return {
        cell
        for cell in _cells_over(pixels)
        if all(_distance(cell, pixel) > RADIUS_M for pixel in bad)
    }


def cells_of(points: NDArray[np.float64], cell_m: float = TOOL_M) -> list[Cell]:
    """Return the cell (row, col) of each point (x, y) [m]."""
    return [(math.floor(y / cell_m), math.floor(x / cell_m)) for x, y in points]


def map_bytes(pixels: Pixels, stamp_ns: int = 1, frame: str = "map") -> bytes:
    """Return the room as a nav_msgs/OccupancyGrid, by rosbags."""
    rows, cols = pixels.shape
    geometry = GridGeometry(rows, cols, RESOLUTION_M, Pose2D(0.0, 0.0))
    message = oracle.occupancy_grid(frame, stamp_ns, geometry, pixels)
    return oracle.to_bytes("nav_msgs/msg/OccupancyGrid", message)


def update_bytes(
    pixels: Pixels, x0: float, y0: float, x1: float, y1: float, frame: str = "map"
) -> bytes:
    """Return a rectangle of ``pixels``, given in metres, as a map_msgs/OccupancyGridUpdate."""
    columns, rows = _span(x0, x1), _span(y0, y1)
    message = oracle.update(frame, 1, (columns.start, rows.start), pixels[rows, columns])
    return oracle.to_bytes("map_msgs/msg/OccupancyGridUpdate", message)


def pose_bytes(x: float, y: float, frame: str = "map", yaw: float = 0.0) -> bytes:
    """Return a geometry_msgs/PoseStamped, by rosbags."""
    message = oracle.pose_stamped(frame, 1, oracle.pose(Pose2D(x, y, yaw)))
    return oracle.to_bytes("geometry_msgs/msg/PoseStamped", message)


def covariant_bytes(x: float, y: float) -> bytes:
    """Return a geometry_msgs/PoseWithCovarianceStamped without a known covariance."""
    where, unknown = oracle.pose(Pose2D(x, y)), np.full(36, np.nan)
    message = oracle.pose_with_covariance_stamped("map", 1, where, unknown)
    return oracle.to_bytes("geometry_msgs/msg/PoseWithCovarianceStamped", message)


def odometry_bytes(x: float, y: float) -> bytes:
    """Return a nav_msgs/Odometry."""
    where, zeros = oracle.pose(Pose2D(x, y)), np.zeros(36)
    message = oracle.odometry("map", 1, "base_link", where, zeros, np.zeros(6), zeros)
    return oracle.to_bytes("nav_msgs/msg/Odometry", message)


def _span(low: float, high: float) -> slice:
    return slice(round(low / RESOLUTION_M), round(high / RESOLUTION_M))


def _cells_over(pixels: Pixels) -> Iterator[Cell]:
    rows, cols = (math.ceil(size * RESOLUTION_M / TOOL_M) for size in pixels.shape)
    return ((row, col) for row in range(rows) for col in range(cols))


def _distance(cell: Cell, pixel: tuple[float, float]) -> float:
    """Return the distance of a cell's centre from the nearest point of a pixel [m]."""
    x, y = (cell[1] + 0.5) * TOOL_M / RESOLUTION_M, (cell[0] + 0.5) * TOOL_M / RESOLUTION_M
    left, bottom = pixel
    beside = max(left - x, 0.0, x - left - 1.0)
    above = max(bottom - y, 0.0, y - bottom - 1.0)
    return RESOLUTION_M * math.hypot(beside, above)


HALL = room(6.0, 4.5)


def pillars() -> Pixels:
    """Return the hall with thick pillars, and lanes between them."""
    pixels = HALL.copy()
    for row in range(10):
        for col in range(10):
            pixels[14 + row : -8 : 24, 14 + col : -8 : 24] = WALL
    return pixels


def lanes(count: int) -> list[tuple[float, float]]:
    """Return the centres (x, y) [m] of the hall's cells in driving order."""
    cells = [(row, col) for row in range(1, 14) for col in range(1, 19)]
    snake = [(row, col if row % 2 else 19 - col) for row, col in cells]
    return [((col + 0.5) * TOOL_M, (row + 0.5) * TOOL_M) for row, col in snake[:count]]


def drive(outsider: Outsider, points: list[tuple[float, float]]) -> dict[str, Any]:
    """Drive over points of the hall; return a status that includes all of them."""
    for x, y in points:
        outsider.put("pose", pose_bytes(x, y))
    x, y = points[-1]
    return outsider.wait_status(
        lambda status: (
            (status["pose"] or {}).get("x") == pytest.approx(x, abs=1e-3)
            and status["pose"]["y"] == pytest.approx(y, abs=1e-3)
            and status["coverage"] is not None
        )
    )


def show_room(outsider: Outsider, pixels: Pixels, *pose: float) -> None:
    """Publish a map and a pose, see ``pose_bytes``."""
    outsider.put("map", map_bytes(pixels))
    outsider.put("pose", pose_bytes(*pose))


def begin(outsider: Outsider, pixels: Pixels = HALL, at: int = 0) -> dict[str, Any]:
    """Publish map and pose; return a status of the robot on a path."""
    show_room(outsider, pixels, *lanes(at + 1)[at])
    outsider.wait_status(lambda status: status["state"] in ("covering", "done"))
    return outsider.wait_status(lambda status: status["coverage"]["covered"] > 0)


def wait_written(outsider: Outsider) -> None:
    """Wait until the ledger is written, one period after the start."""
    outsider.wait_status(
        lambda status: (
            status["ledger"]["age_s"] is not None
            and status["uptime_s"] - status["ledger"]["age_s"] > PERIOD_S
        )
    )
