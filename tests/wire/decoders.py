"""One decoder per message type, as the tests that go over all types call them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from fasaco_edge.wire import schemas
from fasaco_edge.wire.messages.base import decode_scan, decode_velocity
from fasaco_edge.wire.messages.battery import decode_battery
from fasaco_edge.wire.messages.maps import decode_map_update, decode_occupancy_grid
from fasaco_edge.wire.messages.paths import decode_path
from fasaco_edge.wire.messages.pheromone import decode_pheromone
from fasaco_edge.wire.messages.poses import Transform, decode_pose, decode_transforms
from fasaco_edge.wire.schemas import POSE_SCHEMAS, TWIST_SCHEMAS


def decode_and_look(payload: bytes) -> tuple[Transform, ...]:
    """Return transforms that all lie in the plane."""
    transforms = decode_transforms(payload)
    for transform in transforms:
        transform.planar()
    return transforms


DECODERS: dict[str, Callable[[bytes], object]] = {
    schemas.OCCUPANCY_GRID: decode_occupancy_grid,
    schemas.OCCUPANCY_GRID_UPDATE: decode_map_update,
    schemas.PATH: decode_path,
    schemas.PHEROMONE_GRID: decode_pheromone,
    schemas.TF_MESSAGE: decode_and_look,
    schemas.BATTERY_STATE: decode_battery,
    schemas.LASER_SCAN: decode_scan,
    **{schema: partial(decode_pose, schema=schema) for schema in POSE_SCHEMAS},
    **{schema: partial(decode_velocity, schema=schema) for schema in TWIST_SCHEMAS},
}
