"""Small maps and coverages, and what a page shows of them."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from rich.console import Console

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.client.robot_state import Token
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, StampedPose
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.watch.picture import RobotView
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.messages.maps import encode_occupancy_grid
from fasaco_edge.wire.messages.paths import encode_path
from fasaco_edge.wire.messages.poses import encode_pose_stamped
from fasaco_edge.wire.schemas import POSE_STAMPED

NOW = 1_700_000_000.0
ESCAPE = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


def grid_of(
    rows: list[list[int]], metres: float = 1.0, yaw: float = 0.0, x: float = 0.0, y: float = 0.0
) -> OccupancyGrid:
    """Return a grid, the southernmost row first, as it goes over the bus."""
    cells = np.array(rows, np.int8)
    return OccupancyGrid(GridGeometry(*cells.shape, metres, Pose2D(x, y, yaw)), cells)


def console(width: int = 80, *, colours: str | None = "truecolor") -> Console:
    environ = {"TERM": "xterm", "COLUMNS": str(width), "LINES": "24"}
    kind: Any = colours
    return Console(
        force_terminal=True, color_system=kind, width=width, _environ=environ, legacy_windows=False
    )


def plain(line: str) -> str:
    return ESCAPE.sub("", line)


def tell(view: RobotView, topic: str, payload: bytes, attachment: bytes = b"") -> None:
    schema = POSE_STAMPED if topic == "pose" else ""
    view.take(topic, Sample(topic, payload, schema, attachment), NOW)


def status(**members: Any) -> bytes:
    coverage = {"coverable": 40, "covered": 10, "recovered": 3, "remaining": 30}
    path = {"revision": 7, "reason": "map: 2 cells more", "steps": 30, "remaining_steps": 30}
    plan = {"planned_steps": 30, "lower_bound_steps": 29, "gap": 0.0345}
    document = {
        "state": "covering",
        "reason": "path 7",
        "coverage": {**coverage, "fraction": 0.25, "covered_m2": 0.9, "to_cover_m2": 2.7},
        "floor": {"swept_m2": 1.44, "reachable_m2": None, "left": None, "out_of_reach": None},
        "path": {**path, **plan, "line_s": 63.0},
        "ledger": {"age_s": 0.4},
        "mission": {"stage": "covering", "ordered": "itself", "pass": 1, "passes": 1},
        "drive": {"speed_m_s": 0.248, "quarter_turn_s": 1.934, "half_turn_s": None, "turns": 9},
        "latency_ms": {"plan": 4.0, "map_to_path": 9.0, "ingest": 1.0},
    }
    return encode_json(document | members)


def mid_mission() -> RobotView:
    view = RobotView("robot")
    view.take("token", Token("robot", here=True), NOW)
    room = np.zeros((40, 60), np.int8)
    room[[0, -1]] = room[:, [0, -1]] = 100
    tell(view, "map", encode_occupancy_grid(grid_of(room.tolist(), 0.1)))
    covered = np.zeros((8, 12), np.int8)
    covered[:2] = 50
    tell(view, "coverage", encode_occupancy_grid(grid_of(covered.tolist(), 0.5)))
    tell(view, "status", status())
    east = [(0.75 + 0.5 * step, 1.25) for step in range(10)]
    xy = np.array([*east, (5.25, 1.75), (5.25, 2.25)])
    note = encode_json({"revision": 7, "reason": "map: 2 cells more", "steps": 11})
    tell(view, "path", encode_path(xy, np.zeros(len(xy)), "map", 1), note)
    tell(view, "pose", encode_pose_stamped(StampedPose(Pose2D(0.75, 1.25))))
    return view
