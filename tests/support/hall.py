"""A hall, and a robot that is driven over it cell by cell."""

from __future__ import annotations

from typing import Any

import pytest

from fasaco_edge.daemon.ledger.writer import PERIOD_S
from tests.support.outsider import Outsider
from tests.support.rooms import TOOL_M, WALL, Pixels, map_bytes, pose_bytes, room

HALL = room(6.0, 4.5)


def pillars() -> Pixels:
    """Return the hall with thick pillars, and lanes between them."""
    pixels = HALL.copy()
    for row in range(10):
        for col in range(10):
            pixels[14 + row : -8 : 24, 14 + col : -8 : 24] = WALL
    return pixels


def lanes(count: int) -> list[tuple[float, float]]:
    """Return the centres of the hall's cells (x, y) [m] as a robot drives over them."""
    cells = [(row, col) for row in range(1, 14) for col in range(1, 19)]
    snake = [(row, col if row % 2 else 19 - col) for row, col in cells]
    return [((col + 0.5) * TOOL_M, (row + 0.5) * TOOL_M) for row, col in snake[:count]]


def drive(outsider: Outsider, points: list[tuple[float, float]]) -> dict[str, Any]:
    """Drive over points of the hall; return the status that has counted them all."""
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


def begin(outsider: Outsider, pixels: Pixels = HALL, at: int = 0) -> dict[str, Any]:
    """Give map and pose; return a status that has seen the robot on a path."""
    place = lanes(at + 1)[at]
    outsider.put("map", map_bytes(pixels))
    outsider.put("pose", pose_bytes(*place))
    outsider.wait_status(lambda status: status["state"] in ("covering", "done"))
    return outsider.wait_status(lambda status: status["coverage"]["covered"] > 0)


def wait_written(outsider: Outsider, since: float) -> None:
    """Wait until all that was covered at a time [s, uptime] is on disk."""
    outsider.wait_status(
        lambda status: (
            status["ledger"]["age_s"] is not None
            and status["uptime_s"] - status["ledger"]["age_s"] > since + PERIOD_S
        )
    )
