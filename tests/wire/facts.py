"""What the indexes of protocol/vectors say of a message, said of any message."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fasaco_edge.grid.geometry import GridGeometry, StampedPose
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.wire.messages.base import LaserScan, Velocity
from fasaco_edge.wire.messages.battery import BatteryState
from fasaco_edge.wire.messages.paths import PathMessage
from fasaco_edge.wire.messages.pheromone import PheromoneMessage


def placed(geometry: GridGeometry) -> dict[str, Any]:
    origin = geometry.origin
    return {
        "rows": geometry.rows,
        "cols": geometry.cols,
        "resolution": geometry.resolution,
        "origin": [origin.x, origin.y, origin.yaw],
    }


def facts_of(message: Any) -> dict[str, Any]:
    if isinstance(message, tuple):
        poses = [transform.planar() for transform in message]
        return {
            "frames": [transform.frame for transform in message],
            "children": [transform.child for transform in message],
            "stamps_ns": [transform.stamp_ns for transform in message],
            "poses": [[pose.x, pose.y, pose.yaw] for pose in poses],
        }
    facts: dict[str, Any] = {"frame": message.frame, "stamp_ns": message.stamp_ns}
    match message:
        case OccupancyGrid():
            facts |= {**placed(message.geometry), "cells": message.cells.tolist()}
        case MapPatch():
            corner = {"row": message.window.row0, "col": message.window.col0}
            facts |= {**corner, "cells": message.cells.tolist()}
        case StampedPose():
            facts["pose"] = [message.pose.x, message.pose.y, message.pose.yaw]
        case Velocity():
            facts["twist"] = [message.speed_m_s, message.turn_rad_s]
        case BatteryState():
            facts |= {"level": message.level, "power": message.power}
        case LaserScan():
            names = ("first_rad", "step_rad", "least_m", "most_m")
            facts |= {name: getattr(message, name) for name in names}
            facts["ranges"] = [m if math.isfinite(m) else None for m in message.ranges]
        case PathMessage():
            facts |= {"xy": message.xy.tolist(), "yaw": message.yaw.tolist()}
        case PheromoneMessage():
            names = ("cohort", "velocity", "ants", "best_steps", "trail_min", "trail_max")
            facts |= {**placed(message.geometry), "levels": message.levels.tolist()}
            facts |= {name: getattr(message, name) for name in names}
    return facts


def check_facts(said: dict[str, Any], facts: dict[str, Any]) -> None:
    assert said.keys() == facts.keys(), said
    for name, value in facts.items():
        if isinstance(value, list) and all(isinstance(leaf, int | float) for leaf in _flat(value)):
            # One ulp of an arctangent is not a matter of the contract.
            np.testing.assert_allclose(_flat(said[name]), _flat(value), rtol=1e-15, atol=1e-15)
        else:
            assert said[name] == value, name


def _flat(value: Any) -> list[Any]:
    if not isinstance(value, list):
        return [value]
    return [leaf for item in value for leaf in _flat(item)]
