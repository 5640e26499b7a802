"""Payloads every decoder must read: rosbags' bytes, with the values in them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.wire import schemas
from tests.wire import oracle
from tests.wire.facts import placed

STAMP_NS = 1_700_000_000_123_456_789
# Half the yaw has sine 0.6 and cosine 0.8: bytes that depend on no library's sine.
YAW = 2 * math.atan2(0.6, 0.8)
GEOMETRY = GridGeometry(3, 5, 0.05, Pose2D(-1.25, 2.5, YAW))
ORIGIN = oracle.turned(-1.25, 2.5, 0.6, 0.8)
CELLS = np.array([[-1, 0, 0, 100, 50], [0, 1, 25, 65, -1], [0, 0, 0, 0, 99]], np.int8)
ROBOT = oracle.turned(1.5, -2.25, 0.6, 0.8)
FLOATS = np.arange(36.0)


@dataclass(frozen=True)
class Vector:
    """A payload, its name, the type it claims to be and what is to be known about it."""

    name: str
    schema: str
    payload: bytes
    facts: dict[str, Any]


def valid_vectors() -> list[Vector]:
    """Return payloads every decoder must read, with the values in them."""
    return [
        *_valid_grids(),
        *_valid_poses(),
        *_valid_twists(),
        *_valid_batteries(),
        *_valid_scans(),
        *_valid_paths(),
        *_valid_tf(),
        *_valid_pheromone(),
    ]


def _stamped(frame: str = "map") -> dict[str, Any]:
    return {"frame": frame, "stamp_ns": STAMP_NS}


def _valid_grids() -> list[Vector]:
    one, cell = GridGeometry(1, 1, 100.0, Pose2D(2e7, -2e7)), np.array([[-1]], np.int8)
    schema, update = schemas.OCCUPANCY_GRID, schemas.OCCUPANCY_GRID_UPDATE
    grid = oracle.to_bytes(schema, oracle.occupancy_grid("map", STAMP_NS, GEOMETRY, CELLS, ORIGIN))
    facts = {**_stamped(), **placed(GEOMETRY), "cells": CELLS.tolist()}
    return [
        Vector("occupancy_grid", schema, grid, facts),
        Vector("occupancy_grid_padded", schema, grid + bytes(1), facts),
        Vector(
            "occupancy_grid_padding_counted", schema, grid[:3] + b"\1" + grid[4:] + bytes(1), facts
        ),
        Vector(
            "occupancy_grid_at_the_limits",
            schema,
            oracle.to_bytes(schema, oracle.occupancy_grid("f" * 256, STAMP_NS, one, cell)),
            {**_stamped("f" * 256), **placed(one), "cells": [[-1]]},
        ),
        Vector(
            "occupancy_grid_update",
            update,
            oracle.to_bytes(update, oracle.update("map", STAMP_NS, (7, 4), CELLS)),
            {**_stamped(), "row": 4, "col": 7, "cells": CELLS.tolist()},
        ),
    ]


def _valid_poses() -> list[Vector]:
    schema = schemas.POSE_STAMPED
    facts = {**_stamped(), "pose": [1.5, -2.25, YAW]}
    cases = [
        Vector(
            f"pose_stamped_{name}",
            schema,
            oracle.to_bytes(schema, oracle.pose_stamped(frame, STAMP_NS, ROBOT)),
            {**facts, "frame": frame},
        )
        for name, frame in (("map", "map"), ("no_frame", ""), ("utf8", "Küche"))
    ]
    schema = schemas.POSE_WITH_COVARIANCE_STAMPED
    message = oracle.pose_with_covariance_stamped("map", STAMP_NS, ROBOT, FLOATS)
    cases.append(Vector("pose_with_covariance", schema, oracle.to_bytes(schema, message), facts))
    for name, spread in (("odometry", FLOATS), ("odometry_spread_unknown", FLOATS * np.nan)):
        message = oracle.odometry("map", STAMP_NS, "base_link", ROBOT, spread, FLOATS[:6], spread)
        payload = oracle.to_bytes(schemas.ODOMETRY, message)
        cases.append(Vector(name, schemas.ODOMETRY, payload, facts))
    return cases


def _valid_twists() -> list[Vector]:
    numbers = [0.25, 0.0, 0.0, 0.0, 0.0, -1.5]
    plain = oracle.to_bytes(schemas.TWIST, oracle.twist(numbers))
    stamped = oracle.twist_stamped("base_link", STAMP_NS, numbers)
    payload = oracle.to_bytes(schemas.TWIST_STAMPED, stamped)
    facts = {"frame": "", "stamp_ns": 0, "twist": [0.25, -1.5]}
    return [
        Vector("twist", schemas.TWIST, plain, facts),
        Vector(
            "twist_stamped",
            schemas.TWIST_STAMPED,
            payload,
            {**facts, "frame": "base_link", "stamp_ns": STAMP_NS},
        ),
    ]


def _valid_batteries() -> list[Vector]:
    schema = schemas.BATTERY_STATE
    cases = [
        ("battery", (0.75, 2, STAMP_NS), {"level": 0.75, "power": "discharging"}),
        (
            "battery_of_cells",
            (1.0, 1, STAMP_NS, 7, "base", "B7"),
            {"level": 1.0, "power": "charging"},
        ),
        ("battery_unknown", (np.nan, 0), {"level": None, "power": "unknown"}),
    ]
    return [
        Vector(
            name,
            schema,
            oracle.to_bytes(schema, oracle.battery(*told)),
            {
                "frame": told[4] if len(told) > 4 else "",
                "stamp_ns": told[2] if len(told) > 2 else 0,
                **facts,
            },
        )
        for name, told, facts in cases
    ]


def _valid_scans() -> list[Vector]:
    schema = schemas.LASER_SCAN
    some, none = [1.0, 2.5, 0.25, 8.0, 3.5], [np.inf, 1.5, np.nan, -np.inf, 0.0]
    cases = [
        ("scan", some, {"stamp_ns": STAMP_NS, "frame": "laser"}),
        ("scan_of_one_beam", some[:1], {}),
        ("scan_without_returns", none, {}),
        ("scan_with_intensities", some, {"intensities": 5}),
    ]
    vectors = []
    for name, ranges, told in cases:
        stamped = {"frame": told.get("frame", ""), "stamp_ns": told.get("stamp_ns", 0)}
        angles = {"first_rad": -1.5, "step_rad": 0.5, "least_m": 0.25, "most_m": 8.0}
        facts = {"ranges": [m if np.isfinite(m) else None for m in ranges]}
        payload = oracle.to_bytes(schema, oracle.scan(ranges, **told))
        vectors.append(Vector(name, schema, payload, {**stamped, **angles, **facts}))
    return vectors


def _valid_paths() -> list[Vector]:
    xy = [[0.5 * step, 0.25 * step] for step in range(4)]
    cases = []
    for name, frames in (
        ("path", ["map"] * 4),
        ("path_of_no_pose", []),
        ("path_of_one_pose", ["map"]),
        ("path_with_unnamed_frames", ["", "map", "", "map"]),
    ):
        points = xy[: len(frames)]
        poses = [
            (frame, STAMP_NS + index, oracle.turned(*point, 0.6, 0.8))
            for index, (frame, point) in enumerate(zip(frames, points, strict=True))
        ]
        payload = oracle.to_bytes(schemas.PATH, oracle.path("map", STAMP_NS, poses))
        facts = {**_stamped(), "xy": points, "yaw": [YAW] * len(points)}
        cases.append(Vector(name, schemas.PATH, payload, facts))
    return cases


def _valid_tf() -> list[Vector]:
    flat = oracle.turned(0.5, -0.25, 0.0, 1.0)
    links = [("map", "odom", STAMP_NS, ROBOT), ("odom", "base_link", STAMP_NS + 1, flat)]
    poses = [[1.5, -2.25, YAW], [0.5, -0.25, 0.0]]
    nameless = [("", "", 0, flat)]
    return [
        Vector(
            name,
            schemas.TF_MESSAGE,
            oracle.to_bytes(schemas.TF_MESSAGE, oracle.transforms(*each)),
            {
                "frames": [frame for frame, *_ in each],
                "children": [child for _, child, *_ in each],
                "stamps_ns": [stamp_ns for *_, stamp_ns, _ in each],
                "poses": at,
            },
        )
        for name, each, at in (
            ("tf", links, poses),
            ("tf_of_nothing", [], []),
            ("tf_without_names", nameless, poses[1:]),
        )
    ]


def pheromone_bytes(levels: Any, trail_min: float, trail_max: float) -> bytes:
    geometry = GridGeometry(2, 3, 0.3, Pose2D(-0.9, 0.6))
    counts = {"cohort": 2, "velocity": 4, "ants": 96, "best_steps": 31}
    message = oracle.pheromone_grid(
        "map",
        STAMP_NS,
        geometry,
        np.array(levels, np.uint8),
        trail_min=trail_min,
        trail_max=trail_max,
        **counts,
    )
    return oracle.to_bytes(schemas.PHEROMONE_GRID, message)


def _valid_pheromone() -> list[Vector]:
    geometry = GridGeometry(2, 3, 0.3, Pose2D(-0.9, 0.6))
    facts = {**_stamped(), **placed(geometry)}
    facts |= {"cohort": 2, "velocity": 4, "ants": 96, "best_steps": 31}
    return [
        Vector(
            name,
            schemas.PHEROMONE_GRID,
            pheromone_bytes(levels, low, high),
            {**facts, "trail_min": low, "trail_max": high, "levels": levels},
        )
        for name, levels, low, high in (
            ("pheromone_grid", [[0, 1, 128], [255, 64, 0]], 0.125, 8.0),
            ("pheromone_grid_of_one_value", [[1, 1, 1], [1, 0, 1]], 0.5, 0.5),
            ("pheromone_grid_not_coverable", [[0, 0, 0], [0, 0, 0]], 0.0, 0.0),
        )
    ]
