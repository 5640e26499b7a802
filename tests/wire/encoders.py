"""One encoder per message type: from what its decoder returns back to bytes.

A type that is only ever read may be missing here; its decoder is then judged alone.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from fasaco_edge.grid.geometry import Window
from fasaco_edge.planners.planner import ColonySnapshot
from fasaco_edge.wire import schemas
from fasaco_edge.wire.messages.base import encode_scan, encode_velocity
from fasaco_edge.wire.messages.battery import encode_battery
from fasaco_edge.wire.messages.maps import encode_map_update, encode_occupancy_grid
from fasaco_edge.wire.messages.paths import PathMessage, encode_path
from fasaco_edge.wire.messages.pheromone import PheromoneMessage, encode_pheromone
from fasaco_edge.wire.messages.poses import encode_pose_stamped
from fasaco_edge.wire.schemas import TWIST_SCHEMAS


def _path(path: PathMessage) -> bytes:
    return encode_path(path.xy, path.yaw, path.frame, path.stamp_ns)


def _pheromone(message: PheromoneMessage) -> bytes:
    """Encode the field at the map's origin: a colony knows no other place for its lattice."""
    geometry = message.geometry
    snapshot = ColonySnapshot(
        Window(0, 0, geometry.rows, geometry.cols),
        geometry.resolution,
        message.trail(),
        message.cohort,
        message.velocity,
        message.ants,
        message.best_steps,
    )
    return encode_pheromone(snapshot, message.frame, message.stamp_ns)


ENCODERS: dict[str, Callable[[Any], bytes]] = {
    schemas.OCCUPANCY_GRID: encode_occupancy_grid,
    schemas.OCCUPANCY_GRID_UPDATE: encode_map_update,
    schemas.PATH: _path,
    schemas.PHEROMONE_GRID: _pheromone,
    schemas.POSE_STAMPED: encode_pose_stamped,
    schemas.BATTERY_STATE: encode_battery,
    schemas.LASER_SCAN: encode_scan,
    **{schema: partial(encode_velocity, schema=schema) for schema in TWIST_SCHEMAS},
}
