"""Whether the follower's map shows something at a place."""

import math

import numpy as np

from fasaco_edge.follow.scanner import KNOWN_M, KnownMap
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid
from fasaco_edge.wire.messages.maps import encode_map_update, encode_occupancy_grid


def map_with(cells, yaw=0.0, frame="map"):
    geometry = GridGeometry(*cells.shape, 0.05, Pose2D(1.0, 2.0, yaw))
    return geometry, encode_occupancy_grid(OccupancyGrid(geometry, cells, frame, 1))


def test_the_map_shows_places_near_occupied_pixels_at_any_yaw():
    cells = np.zeros((40, 60), np.int8)
    cells[20, 30], cells[5, 5], cells[6, 50] = 100, 25, -1
    for yaw in (0.0, 0.7):
        geometry, payload = map_with(cells, yaw)
        known = KnownMap(25)
        assert known.frame is None
        assert not known.shows(*geometry.to_map(30.5, 20.5))
        known.take_map(payload)
        assert known.frame == "map"
        near, far = KNOWN_M / 0.05 - 0.01, KNOWN_M / 0.05 + 1.5
        for angle in np.linspace(0.0, math.tau, 8, endpoint=False):
            right, up = math.cos(angle), math.sin(angle)
            assert known.shows(*geometry.to_map(30.5 + near * right, 20.5 + near * up))
            right, up = right / max(abs(right), abs(up)), up / max(abs(right), abs(up))
            assert not known.shows(*geometry.to_map(30.5 + far * right, 20.5 + far * up))
        # Neither free nor unknown pixels are obstacles; beside the map there are none.
        assert not known.shows(*geometry.to_map(5.5, 5.5))
        assert not known.shows(*geometry.to_map(50.5, 6.5))
        assert not known.shows(*geometry.to_map(-90.0, 20.0))
        assert not known.shows(*geometry.to_map(30.0, 90.0))


def test_updates_change_it():
    geometry, payload = map_with(np.zeros((40, 60), np.int8))
    known = KnownMap(25)
    patch = MapPatch(Window(10, 10, 12, 13), np.full((2, 3), 100, np.int8))
    known.take_update(encode_map_update(patch))  # without a map it says nothing
    known.take_map(payload)
    place = geometry.to_map(11.5, 11.0)
    assert not known.shows(*place)
    known.take_update(encode_map_update(patch))
    assert known.shows(*place)
    known.take_map(payload)
    assert not known.shows(*place)
