"""Grids read as octets: the same as the arrays that others read."""

from __future__ import annotations

import numpy as np
import pytest

from fasaco_edge.errors import FasacoError, MalformedMessage
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.planners.planner import ColonySnapshot
from fasaco_edge.wire.messages.grids import _shortest_decimal, read_field, read_grid, with_update
from fasaco_edge.wire.messages.maps import (
    decode_occupancy_grid,
    encode_map_update,
    encode_occupancy_grid,
)
from fasaco_edge.wire.messages.pheromone import decode_pheromone, encode_pheromone

RANDOM = np.random.default_rng(5)
CELLS = RANDOM.integers(-1, 101, (6, 9)).astype(np.int8)
GRID = OccupancyGrid(GridGeometry(6, 9, 0.05, Pose2D(-1.0, 2.0, 0.25)), CELLS, "map", 7)


def test_a_map_and_its_updates():
    payload = encode_occupancy_grid(GRID)
    octets, decoded = read_grid(payload), decode_occupancy_grid(payload)
    assert octets.geometry == decoded.geometry
    assert bytes(octets.octets) == CELLS.tobytes()
    patch = MapPatch(Window(2, 3, 5, 8), RANDOM.integers(0, 101, (3, 5)).astype(np.int8), "map", 8)
    updated = with_update(octets, encode_map_update(patch))
    assert bytes(updated.octets) == decoded.patched(patch).cells.tobytes()
    assert bytes(octets.octets) == CELLS.tobytes()
    for wrong in (
        MapPatch(Window(4, 3, 7, 8), patch.cells, "map"),
        MapPatch(patch.window, patch.cells, "odom"),
    ):
        with pytest.raises(MalformedMessage):
            with_update(octets, encode_map_update(wrong))


def test_a_field_is_read_as_octets():
    trail = RANDOM.random((4, 5)).astype(np.float32)
    payload = encode_pheromone(
        ColonySnapshot(Window(1, 2, 5, 7), 0.3, trail, 0, 8, 16, 9), "map", 1
    )
    octets, decoded = read_field(payload), decode_pheromone(payload)
    assert octets.geometry == decoded.geometry
    assert bytes(octets.octets) == decoded.levels.tobytes()


def test_a_truncated_grid_is_refused():
    payload = encode_occupancy_grid(GRID)
    for length in range(0, len(payload), 3):
        with pytest.raises(FasacoError):
            read_grid(payload[:length])


def test_the_shortest_decimal_is_numpys():
    powers = (2.0 ** np.arange(-13, 7)).astype(np.float32)
    some = np.exp(RANDOM.uniform(np.log(1e-4), np.log(100.0), 20_000)).astype(np.float32)
    thousandths = (np.arange(1, 10_000) / 1000).astype(np.float32)
    near = np.nextafter(powers, np.float32(0.0)), np.nextafter(powers, np.float32(9e9))
    for value in np.concatenate([powers, *near, some, thousandths]):
        assert _shortest_decimal(float(value)) == float(str(value))
    for odd in (0.0, float("nan"), float("inf"), 3.4028234663852886e38, 1e-45):
        _shortest_decimal(odd)
