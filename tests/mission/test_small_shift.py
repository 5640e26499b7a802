"""Shifts of a map by a few pixels, and changes that are none."""

import numpy as np
import pytest

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.mission.coverage.loop_closure import small_shift
from tests.mission.line_robot import CONFIG, PIXEL_M
from tests.mission.test_reached_cells import changed, two_rooms


def shifted(before, after, right=0.0, up=0.0, yaw=0.0):
    """The shift found between two maps, the second one moved by so many pixels, or None."""
    grids = [
        OccupancyGrid(GridGeometry(*pixels.shape, PIXEL_M, origin), np.ascontiguousarray(pixels))
        for pixels, origin in (
            (before, Pose2D(0.0, 0.0)),
            (after, Pose2D(right * PIXEL_M, up * PIXEL_M, yaw)),
        )
    ]
    found = small_shift(*grids, CONFIG.footprint)
    return None if found is None else (found.end.x / PIXEL_M, found.end.y / PIXEL_M)


@pytest.mark.parametrize("shift", [(1, 0), (-3, 2), (4, -4), (2.8, 0.0)])
def test_a_map_that_was_shifted(shift):
    assert shifted(two_rooms(is_open=True), two_rooms(is_open=True), *shift) == pytest.approx(
        np.rint(shift)
    )


def test_a_map_with_walls_of_many_pixels():
    walls = np.pad(two_rooms(is_open=True), 8, constant_values=100)
    assert shifted(walls, walls, 3, 1) == pytest.approx((3, 1))


def noisy(pixels, seed):
    """The same with walls that are a pixel thicker in places, and specks."""
    rng = np.random.default_rng(seed)
    cells = pixels.copy()
    beside = np.zeros(cells.shape, bool)
    for axis, by in ((0, 1), (0, -1), (1, 1), (1, -1)):
        beside |= np.roll(pixels == 100, by, axis)
    cells[beside & (rng.random(cells.shape) < 0.3)] = 100
    cells[rng.random(cells.shape) < 0.01] = 100
    return cells


def furnished():
    pixels = two_rooms(is_open=True)
    pixels[10:20, 20:34] = pixels[30:44, 80:90] = 100
    return pixels


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (two_rooms(is_open=True), two_rooms(is_open=True)),
        (two_rooms(is_open=True), changed("closed")),
        (two_rooms(is_open=True), changed("unknown")),
        (two_rooms(is_open=True), furnished()),
        (furnished(), two_rooms(is_open=True)),
        (noisy(two_rooms(is_open=True), 1), noisy(two_rooms(is_open=True), 2)),
        (two_rooms(is_open=True), np.zeros((52, 124), np.int8)),
        (two_rooms(is_open=True), np.full((52, 124), 100, np.int8)),
    ],
    ids=["same", "door", "unknown", "furniture", "none", "noise", "no walls", "no floor"],
)
def test_a_map_that_was_not(before, after):
    assert shifted(before, after) is None


def test_noise_hides_no_shift():
    assert shifted(
        noisy(two_rooms(is_open=True), 1), noisy(two_rooms(is_open=True), 2), 3, 0
    ) == pytest.approx((3, 0))
