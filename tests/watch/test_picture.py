"""Which pixel of the picture shows what."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rich.color import ColorSystem

from fasaco_edge.grid.geometry import Pose2D
from fasaco_edge.watch import picture
from fasaco_edge.watch.glyphs import GlyphSet
from fasaco_edge.watch.picture import (
    AHEAD,
    COVERED,
    FLOOR,
    HEADING,
    NEXT,
    REVISITED,
    ROBOT,
    TO_COVER,
    UNKNOWN,
    WALL,
    Frame,
)
from tests.watch.grids import grid_of, plain


def test_south_is_at_the_bottom():
    """Row 0 of a grid is the southernmost; on a screen the last line is."""
    frame = Frame.over((0.0, 0.0, 3.0, 4.0), 3, 2)
    kinds = picture.ground(
        frame, grid_of([[100, 100, 100], [0, 0, 100], [0, 0, 0], [-1] * 3]), None
    )
    assert kinds.tolist() == [[UNKNOWN] * 3, [FLOOR] * 3, [FLOOR, FLOOR, WALL], [WALL] * 3]


def test_a_thin_wall_stays_however_small_the_picture():
    map_cells = np.zeros((80, 80), np.int8)
    map_cells[:, 41] = 100
    frame = Frame.over((0.0, 0.0, 4.0, 4.0), 8, 4)
    kinds = picture.ground(frame, grid_of(map_cells.tolist(), 0.05), None)
    assert (kinds == WALL).sum(axis=1).tolist() == [1] * 8


def test_coverage_tints_the_floor_and_nothing_else():
    frame = Frame.over((0.0, 0.0, 4.0, 2.0), 4, 1)
    grid = grid_of([[0, 0, 0, 100], [0, 0, -1, 0]])
    coverage = grid_of([[50, 75, 0, 100], [-1, 100, 50, 0]])
    assert picture.ground(frame, grid, coverage).tolist() == [
        [FLOOR, FLOOR, UNKNOWN, TO_COVER],
        [COVERED, REVISITED, TO_COVER, WALL],
    ]
    # Without a map the coverage stands alone.
    coverage = grid_of([[50, 75, 0, 100], [-1, -1, -1, 0]])
    assert picture.ground(frame, None, coverage).tolist() == [
        [UNKNOWN, UNKNOWN, UNKNOWN, TO_COVER],
        [COVERED, REVISITED, TO_COVER, WALL],
    ]
    # A map turned by a quarter counter-clockwise: its columns run north.
    turned = grid_of([[100, 0]], yaw=math.pi / 2, x=1.0)
    assert picture.ground(Frame(0.0, 2.0, 1.0, 1, 1), turned, None).tolist() == [[FLOOR], [WALL]]


def test_the_next_metres_of_the_path_stand_out():
    kinds = np.zeros((4, 10), np.uint8)
    frame = Frame(0.0, 4.0, 1.0, 10, 2)
    xy = np.array([(0.5, 0.5), (8.5, 0.5), (8.5, 2.5)])
    assert picture.draw_path(kinds, frame, xy)
    assert kinds[3].tolist() == [NEXT] * 4 + [AHEAD] * 5 + [0]
    assert kinds[:, 8].tolist() == [0, AHEAD, AHEAD, AHEAD]
    assert np.count_nonzero(kinds) == 11


def test_lanes_closer_than_a_character_end_near_the_robot():
    """Lanes that merge on the screen are cut at NEAR_M along the path."""
    kinds = np.zeros((2, 60), np.uint8)
    xy = np.stack([np.arange(0.25, 50.0, 0.5), np.full(100, 0.5)], axis=-1)
    assert not picture.draw_path(kinds, Frame(0.0, 2.0, 1.0, 60, 1), xy)
    assert np.flatnonzero(kinds[1])[-1] == pytest.approx(picture.NEAR_M, abs=1)


@pytest.mark.parametrize("yaw", [0.0, 1.57, 3.14, -1.57, 7.07, -3.14])
def test_the_robot_is_where_it_is_and_heads_where_it_heads(yaw):
    kinds = np.zeros((8, 8), np.uint8)
    picture.draw_robot(kinds, Frame(0.0, 8.0, 1.0, 8, 4), Pose2D(2.5, 6.5, yaw), 1.1)
    eighth = round(yaw / (math.pi / 4)) % 8
    assert kinds[0:2, 2].tolist() == [HEADING + eighth] * 2
    assert [tuple(at) for at in np.argwhere(kinds == ROBOT)] == [(1, 1), (1, 3), (2, 2)]


@pytest.mark.parametrize("place", [(-50.0, 3.0), (1e9, -1e9), (8.0, 0.0)])
def test_points_outside_the_picture_are_not_drawn(place):
    kinds = np.zeros((8, 8), np.uint8)
    frame = Frame(0.0, 8.0, 1.0, 8, 4)
    picture.draw_robot(kinds, frame, Pose2D(*place), 0.2)
    picture.draw_path(kinds, frame, np.array([place, (place[0] + 1.0, place[1] - 1.0)]))
    assert not kinds.any()


@pytest.mark.parametrize(("columns", "lines"), [(80, 24), (10, 40), (1, 1), (200, 3)])
def test_everything_known_fits_and_pixels_are_square(columns, lines):
    bounds = (-3.2, 1.1, 12.7, 9.0)
    frame = Frame.over(bounds, columns, lines)
    assert frame.left <= bounds[0]
    assert frame.top >= bounds[3]
    assert frame.left + columns * frame.pixel_m >= bounds[2]
    assert frame.top - 2 * lines * frame.pixel_m <= bounds[1]


def test_every_kind_has_a_look():
    kinds = np.arange(picture.LETTER + len(picture.LETTERS), dtype=np.uint8)
    for colours in (ColorSystem.TRUECOLOR, ColorSystem.EIGHT_BIT, None):
        for below in (kinds, kinds[::-1]):
            (line,) = GlyphSet(colours).lines(np.stack([kinds, below]))
            assert len(plain(line)) == len(kinds)
