"""The direction of walls: found on drawn buildings, the same for the same pixels, or none."""

from __future__ import annotations

import math
import tracemalloc

import numpy as np
import pytest

from fasaco_edge.grid import walls
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.map_files import find_map, read_map
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.grid.rotation import rotated_geometry, rotated_points
from fasaco_edge.grid.walls import wall_direction

UNKNOWN, FREE, WALL = -1, 0, 100


def grid_of(cells, unit: float = 0.05, yaw: float = 0.0) -> OccupancyGrid:
    geometry = GridGeometry(*cells.shape, unit, Pose2D(-3.0, 2.0, yaw))
    return OccupancyGrid(geometry, np.ascontiguousarray(cells, np.int8))


def hall(*rooms, unit: float = 0.05, thick_m: float = 0.1, size_m: float = 24.0):
    """Return pixels of rooms (angle [deg], width, height, x, y [m]) within walls."""
    side = round(size_m / unit)
    y, x = (np.mgrid[:side, :side] + 0.5) * unit
    cells = np.full((side, side), UNKNOWN, np.int8)
    for angle_deg, width, height, x0, y0 in rooms:
        cos, sin = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
        u, v = abs(cos * (x - x0) + sin * (y - y0)), abs(cos * (y - y0) - sin * (x - x0))
        inside = (u <= width / 2) & (v <= height / 2)
        beside = (u <= width / 2 + thick_m) & (v <= height / 2 + thick_m)
        cells[beside & (cells != FREE)] = WALL
        cells[inside] = FREE
    return cells


def room(angle_deg: float, **options):
    return hall((angle_deg, 9.0, 6.0, 12.0, 12.0), **options)


@pytest.mark.parametrize("thick_m", [0.05, 0.3])
@pytest.mark.parametrize("angle_deg", [-44, -30, -12, -3, -1, 2, 4, 7.5, 18, 26.6, 33, 41, 44.4])
def test_the_angle_of_a_room(angle_deg, thick_m):
    found = wall_direction(grid_of(room(angle_deg, thick_m=thick_m)))
    assert found.angle_deg == pytest.approx(angle_deg, abs=0.4)
    assert found.rotation_deg == found.angle_deg
    # But for its corners all of its 30 m point there.
    assert found.share > 0.85
    assert 20.0 < found.wall_m < 30.0


@pytest.mark.parametrize("unit", [0.01, 0.02, 0.1])
def test_the_angle_is_the_same_on_other_pixels(unit):
    size_m = 12.0 if unit < 0.02 else 24.0
    cells = hall((25.0, 8.0, 5.0, size_m / 2, size_m / 2), unit=unit, size_m=size_m)
    found = wall_direction(grid_of(cells, unit))
    assert found.angle_deg == pytest.approx(25.0, abs=0.4)
    assert 17.0 < found.wall_m < 26.0


def test_the_yaw_of_a_map_counts_in_full():
    # Not rounded: the walls' own pixels are level once the map is turned back.
    for own, yaw, expected in ((0, 0.3, 0.3), (0, 2.0, 2.0 - math.pi / 2), (0, math.pi, 0.0)):
        found = wall_direction(grid_of(room(own), yaw=yaw))
        assert found.angle_deg == pytest.approx(math.degrees(expected), abs=1e-9)
    found = wall_direction(grid_of(room(20.0), yaw=0.3))
    assert found.angle_deg == pytest.approx(20.0 + math.degrees(0.3), abs=0.4)
    assert wall_direction(grid_of(room(-17.0), yaw=0.3)).rotation_deg == 0.0


@pytest.mark.parametrize("angle_deg", [0.0, 0.25, -0.25, 90.25])
def test_a_small_angle_gives_no_rotation(angle_deg):
    found = wall_direction(grid_of(room(angle_deg)))
    assert abs(found.angle_deg) < 0.5
    assert found.rotation_deg == 0.0


def test_maps_nearly_alike_do_not_turn_by_45_and_by_minus_45():
    angles = {wall_direction(grid_of(room(44.9 + 0.05 * step))).angle_deg for step in range(5)}
    angles |= {
        wall_direction(grid_of(room(0), yaw=turns * math.pi / 4)).angle_deg for turns in (1, 3)
    }
    assert angles == {45.0}


def test_most_walls_decide():
    large, small = (12.0, 8.0, 7.0, 7.0), (8.0, 5.0, 17.0, 16.0)
    for angles in ((0.0, 25.0), (25.0, 0.0), (30.0, 12.0)):
        rooms = ((angle, *place) for angle, place in zip(angles, (large, small), strict=True))
        found = wall_direction(grid_of(hall(*rooms)))
        assert found.angle_deg == pytest.approx(angles[0], abs=0.5)
        assert found.share < 0.8


def test_the_axes_are_left_only_for_more_walls():
    # Wings as large: the one along the axes of the map frame, whatever its pixels' axes are.
    for yaw in (0.0, 0.5):
        own = -math.degrees(yaw)
        cells = hall((own, 9.0, 6.0, 7.0, 7.0), (own + 25.0, 9.4, 6.2, 17.0, 16.0))
        found = wall_direction(grid_of(cells, yaw=yaw))
        assert found.angle_deg == pytest.approx(0.0, abs=0.4)


def test_the_rim_counts_on_a_map_of_what_is_free():
    cells = room(25.0)
    cells[cells == WALL] = UNKNOWN
    found = wall_direction(grid_of(cells))
    assert found.angle_deg == pytest.approx(25.0, abs=0.3)
    assert found.is_of_rim
    # Where there are walls, what is not yet known beside them has no part in it.
    cells = room(25.0)
    cells[:, 270:] = UNKNOWN
    found = wall_direction(grid_of(cells))
    assert found.angle_deg == pytest.approx(25.0, abs=0.4)
    assert found.share > 0.85
    assert not found.is_of_rim


def _round_hall():
    y, x = np.mgrid[:400, :400] - 199.5
    return np.where(np.hypot(x, y) < 150, FREE, WALL)


def _cave():
    """Return smooth noise, cut in half."""
    noise = np.random.default_rng(1).standard_normal((400, 400))
    rows, cols = np.fft.fftfreq(400)[:, None], np.fft.rfftfreq(400)
    kept = np.exp(-((12.0 * math.pi) ** 2) * (rows**2 + cols**2))
    return np.where(np.fft.irfft2(np.fft.rfft2(noise) * kept) > 0, FREE, WALL)


def _diagonal():
    cells = np.full((60, 60), WALL)
    np.fill_diagonal(cells[5:45, 5:45], FREE)
    return cells


SHAPELESS = {
    "round hall": _round_hall(),
    "cave": _cave(),
    "noise": np.where(np.random.default_rng(3).random((300, 300)) < 0.3, WALL, FREE),
    "dust": np.where(np.random.default_rng(3).random((300, 300)) < 0.003, WALL, FREE),
    "nothing known": np.full((40, 30), UNKNOWN),
    "a row": np.zeros((1, 30)),
    "a free diagonal": _diagonal(),
}


@pytest.mark.parametrize("name", SHAPELESS)
def test_without_straight_walls_there_is_no_direction(name):
    assert wall_direction(grid_of(SHAPELESS[name])) is None


def slow_direction(cells) -> tuple[float, float]:
    """Return angle [deg] and share, vector by vector, of pixels of 0.05 m without yaw."""
    kernel = np.array([1])
    for shift in walls.SHIFTS:
        kernel = np.convolve(kernel, [1] + [0] * (shift - 1) + [1])
    reach = len(kernel) // 2
    spread = [(i - reach, j - reach) for i in range(len(kernel)) for j in range(len(kernel))]
    vectors: dict[tuple[int, int], list[int]] = {}
    for (row, col), value in np.ndenumerate(cells):
        for axis, (i, j) in enumerate(((row, col + 1), (row + 1, col))):
            if i == len(cells) or j == len(cells[0]) or {value, cells[i, j]} != {FREE, WALL}:
                continue
            # Both ends of the edge between the two pixels.
            for end in ((row + 1, col + 1), (i, j)):
                for up, right in spread:
                    weight = int(kernel[up + reach] * kernel[right + reach])
                    at = vectors.setdefault((end[0] + up, end[1] + right), [0, 0])
                    at[axis] += weight if value == FREE else -weight
    votes = [
        (math.degrees(math.atan2(y, x)), round(math.hypot(x, y)), x, y)
        for x, y in vectors.values()
        if x * x + y * y >= walls.LEAST_SQUARE
    ]

    def near(middle: float, width: float):
        """Return the votes whose bin is that near, and by what quarter-turn they are off."""
        for degrees, length, x, y in votes:
            off = round(degrees * 2) / 2 - middle
            if abs(off - 90 * round(off / 90)) <= width:
                yield round(off / 90) % 4, length, x, y

    def found(middle: float) -> int:
        return sum(length for _, length, _, _ in near(middle, 7.0))

    middle = max((step / 2 for step in range(-90, 90)), key=found)
    middle = 0.0 if walls.BETTER * found(0.0) >= found(middle) else middle
    before = math.inf
    while middle != before:
        total = complex(0, 0)
        for quarters, _, x, y in near(middle, 10.0):
            total += complex(x, y) * (1, -1j, -1, 1j)[quarters]
        angle_deg = math.degrees(math.atan2(total.imag, total.real))
        before, middle = middle, round(angle_deg * 2) / 2
    return round(angle_deg, 1), round(found(middle) / sum(vote[1] for vote in votes), 3)


@pytest.mark.parametrize("seed", range(8))
def test_twin_finds_the_same_direction(seed):
    rng = np.random.default_rng(seed)
    angle_deg, thick_m = rng.uniform(3.0, 42.0) * (-1) ** seed, (0.05, 0.2)[seed // 4]
    cells = hall((angle_deg, 2.2, 1.6, 1.5, 1.5), size_m=3.0, thick_m=thick_m)
    cells[rng.random(cells.shape) < 0.01] = WALL
    found = wall_direction(grid_of(cells))
    assert (found.angle_deg, found.share) == slow_direction(cells)


def test_the_direction_does_not_depend_on_the_tiles(monkeypatch):
    grid = read_map(find_map("basement"))
    expected = [
        wall_direction(one) for one in (grid, grid_of(room(30.0)), grid_of(room(30.0), 0.02))
    ]
    for tile in (64, 101):
        monkeypatch.setattr(walls, "TILE", tile)
        found = [
            wall_direction(one) for one in (grid, grid_of(room(30.0)), grid_of(room(30.0), 0.02))
        ]
        assert found == expected


def test_a_map_turned_by_quarters_has_the_same_walls():
    cells = room(17.0)
    for quarters in (1, 2, 3):
        found = wall_direction(grid_of(np.rot90(cells, quarters)))
        assert found == wall_direction(grid_of(cells))
    mirrored = wall_direction(grid_of(cells[::-1]))
    assert mirrored.angle_deg == -wall_direction(grid_of(cells)).angle_deg


def test_a_large_map_takes_little_memory():
    grid = grid_of(np.tile(read_map(find_map("office")).cells, (16, 16)))
    tracemalloc.start()
    try:
        assert wall_direction(grid).angle_deg == 0.0
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    # The map has 7.1 million pixels; a float64 of each would be 57 MB.
    assert most < 16e6


def test_points_stay_where_they_are_on_a_turned_grid():
    geometry = GridGeometry(30, 40, 0.05, Pose2D(3.0, -2.0, 0.2))
    turned = rotated_geometry(geometry, 25.0)
    assert turned.origin.yaw == pytest.approx(0.2 + math.radians(25.0))
    pixels = [(0.0, 0.0), (40.0, 0.0), (7.5, 21.0)]
    points, there = (np.array([one.to_map(*at) for at in pixels]) for one in (geometry, turned))
    assert rotated_points(points, 25.0) == pytest.approx(there)
    assert rotated_points(there, -25.0) == pytest.approx(points)
    assert rotated_geometry(geometry, 0.0) == geometry
