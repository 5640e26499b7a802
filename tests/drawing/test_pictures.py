"""Pictures show what they are given, where it is, whatever its size."""

import numpy as np
import pytest

from fasaco_edge.drawing import palette
from fasaco_edge.drawing.pictures import draw_mission, draw_walk
from fasaco_edge.drawing.plot import MAX_HEIGHT, MAX_WIDTH, MapLayer
from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid

FOOTPRINT = Footprint(cell_m=0.5, robot_radius_m=0.2)
CORNER = Pose2D(-2.0, -1.0)


def room(origin=CORNER):
    """A room of 6 x 4 m at 0.1 m, a block in its upper left corner as seen with y up."""
    cells = np.zeros((40, 60), np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    cells[28:38, 2:14] = 100
    return OccupancyGrid(GridGeometry(40, 60, 0.1, origin), cells)


def line(*corners):
    """Return the cells of a walk along straight lines between corners (row, col)."""
    cells = [corners[0]]
    for corner in corners[1:]:
        while cells[-1] != corner:
            row, col = cells[-1]
            cells.append((row + np.sign(corner[0] - row), col + np.sign(corner[1] - col)))
    return np.array(cells, np.int32)


def places(image, colour, tolerance=6):
    """Return where (x, y) in the picture a colour is, (n, 2)."""
    difference = np.abs(np.asarray(image, np.int16) - np.array(colour, np.int16)).max(axis=2)
    return np.argwhere(difference <= tolerance)[:, ::-1]


def drawing_area(image):
    """Return (x0, y0, x1, y1) of the frame around the plot."""
    frame = places(image, palette.RULE, tolerance=0)
    rows, counts = np.unique(frame[:, 1], return_counts=True)
    top, bottom = rows[counts == counts.max()][[0, -1]]
    edge = frame[frame[:, 1] == top][:, 0]
    return edge.min(), top, edge.max(), bottom


def inside(points, area):
    x0, y0, x1, y1 = area
    return points[
        (points[:, 0] > x0) & (points[:, 0] < x1) & (points[:, 1] > y0) & (points[:, 1] < y1)
    ]


def relative(points, area):
    """Return the middle of ``points`` in the drawing area, from 0 to 1, y upwards."""
    x0, y0, x1, y1 = area
    x, y = inside(points, area).mean(axis=0)
    return (x - x0) / (x1 - x0), (y1 - y) / (y1 - y0)


@pytest.fixture(scope="module")
def picture():
    grid = room()
    lattice = CoverageLattice.from_map(grid, FOOTPRINT)
    walk = line((-1, -3), (-1, 6), (4, 6), (4, 0))
    return draw_walk(lattice, walk, grid=grid, title="A room", lines=["not mirrored"])


def test_a_walk_is_not_mirrored(picture):
    area = drawing_area(picture)
    # The map spans 6 x 4 m and a margin of 0.5 m: 7 x 5 m in all.
    x, y = relative(places(picture, palette.START), area)
    assert x == pytest.approx((-1.25 + 2.5) / 7, abs=0.02)
    assert y == pytest.approx((-0.25 + 1.5) / 5, abs=0.02)
    x, y = relative(places(picture, palette.END), area)
    assert x == pytest.approx((0.25 + 2.5) / 7, abs=0.02)
    assert y == pytest.approx((2.25 + 1.5) / 5, abs=0.02)


def test_a_map_is_not_mirrored(picture):
    x0, y0, x1, y1 = drawing_area(picture)
    width, height = x1 - x0, y1 - y0

    def colour_at(x, y):
        return picture.getpixel(
            (x0 + round((x + 2.5) / 7 * width), y1 - round((y + 1.5) / 5 * height))
        )

    assert colour_at(-1.2, 2.3) == palette.OCCUPIED
    assert colour_at(3.2, 2.3) != palette.OCCUPIED
    assert colour_at(-1.2, -0.4) != palette.OCCUPIED
    assert colour_at(-2.3, 1.0) == palette.UNKNOWN


def test_the_line_changes_colour_from_start_to_end(picture):
    area = drawing_area(picture)
    first, last = palette.gradient(np.array([0.0, 1.0])).tolist()
    _, start_y = relative(places(picture, first, 10), area)
    _, end_y = relative(places(picture, last, 10), area)
    assert start_y < 0.35
    assert end_y > 0.65


def test_the_map_may_be_turned():
    # Turned by a quarter to the left: what was upper left is lower left.
    grid = room(Pose2D(2.0, -3.0, np.pi / 2))
    lattice = CoverageLattice.from_map(grid, FOOTPRINT)
    picture = draw_walk(lattice, line((0, 0), (0, 1)), grid=grid, title="Turned", lines=[])
    area = drawing_area(picture)
    dark = inside(places(picture, palette.OCCUPIED, 0), area)
    x0, y0, x1, y1 = area
    left, low = dark[:, 0] < (x0 + x1) / 2, dark[:, 1] > (y0 + y1) / 2
    assert np.count_nonzero(left & low) > 1.5 * np.count_nonzero(left & ~low)
    assert np.count_nonzero(left & low) > 1.5 * np.count_nonzero(~left & low)


def test_revisited_missed_and_unreachable_cells_look_different():
    free = np.ones((5, 9), bool)
    free[:, 6] = False
    lattice = CoverageLattice.from_free(free)
    walk = line((0, 0), (0, 4), (0, 0), (2, 0))
    picture = draw_walk(lattice, walk, grid=None, title="", lines=[])
    area = drawing_area(picture)
    again = relative(places(picture, palette.REVISITED[0]), area)
    left_out = relative(places(picture, palette.LEFT_OUT), area)
    unreachable = relative(places(picture, palette.UNREACHABLE), area)
    assert again[0] < left_out[0] + 0.1 < unreachable[0]
    assert again[1] < 0.3
    assert unreachable[0] > 0.75


@pytest.mark.parametrize(
    "shape", [(1, 1), (1, 2), (1, 400), (400, 1), (3, 5), (250, 250), (40, 2500)]
)
def test_sizes_are_bounded(shape):
    lattice = CoverageLattice.from_free(np.ones(shape, bool), cell_m=0.3)
    walk = line((0, 0), (shape[0] - 1, 0), (shape[0] - 1, shape[1] - 1))
    picture = draw_walk(lattice, walk, grid=None, title="size", lines=["one", "two"])
    assert picture.mode == "RGB"
    assert 300 < picture.width <= MAX_WIDTH + 60
    assert 100 < picture.height <= MAX_HEIGHT + 250
    assert len(picture.getcolors(maxcolors=2**24)) > 10
    assert len(places(picture, palette.START)) > 20


def test_a_mission_shows_visits_trail_start_and_end():
    grid = room()
    lattice = CoverageLattice.from_map(grid, FOOTPRINT)
    visits = np.zeros(lattice.states.shape, np.uint16)
    driven = np.array([(-1.25, -0.25), (3.25, -0.25), (3.25, 2.25), (0.3, 2.2)])
    for row, col, times in ((-1, 0, 1), (4, 6, 7)):
        visits[lattice.local((row, col))] = times
    picture = draw_mission(grid, lattice, driven, visits, title="Mission", lines=["", "caption"])
    area = drawing_area(picture)
    x, y = relative(places(picture, palette.START), area)
    assert (x, y) == pytest.approx((1.25 / 7, 1.25 / 5), abs=0.02)
    x, y = relative(places(picture, palette.END), area)
    assert (x, y) == pytest.approx((2.8 / 7, 3.7 / 5), abs=0.02)
    x, y = relative(places(picture, palette.REVISITED[-1]), area)
    assert (x, y) == pytest.approx((5.75 / 7, 3.75 / 5), abs=0.03)
    x, y = relative(places(picture, palette.COVERED, 1), area)
    assert (x, y) == pytest.approx((2.75 / 7, 1.25 / 5), abs=0.03)
    assert len(inside(places(picture, palette.LEFT_OUT), area)) > 1000


@pytest.mark.parametrize("yaw", [0.0, 0.6])
def test_a_mission_shows_floor_that_was_not_swept_where_it_is(yaw):
    grid = room()
    lattice = CoverageLattice.from_map(grid, FOOTPRINT)
    visits = np.zeros(lattice.states.shape, np.uint16)
    # A raster of its own: a square of 0.5 m around (2, 0.5).
    mask = np.zeros((30, 40), bool)
    mask[10:20, 20:30] = True
    corner = GridGeometry(30, 40, 0.05, Pose2D(0.0, 0.0, yaw)).to_map(25, 15)
    geometry = GridGeometry(30, 40, 0.05, Pose2D(2.0 - corner[0], 0.5 - corner[1], yaw))
    layer = MapLayer(geometry, mask)
    driven = np.array([(-1.25, -0.25), (-1.0, -0.25)])
    picture = draw_mission(grid, lattice, driven, visits, title="", lines=[], unswept=layer)
    area = drawing_area(picture)
    found = inside(places(picture, palette.UNSWEPT), area)
    assert relative(found, area) == pytest.approx((4.5 / 7, 2.0 / 5), abs=0.01)
    # As large as it is, and in the key.
    metre_px = (area[2] - area[0]) / 7
    assert len(found) == pytest.approx(layer.area_m2 * metre_px**2, rel=0.1)
    assert layer.area_m2 == pytest.approx(0.25)
    assert len(places(picture, palette.UNSWEPT)) > len(found) + 100


def test_a_line_beside_the_cells_is_drawn_where_it_is():
    grid = room()
    lattice = CoverageLattice.from_map(grid, FOOTPRINT)
    line_xy = np.array([(-1.5, -0.5), (3.2, 1.9)])
    walk = line((-1, -3), (-1, 6))
    picture = draw_walk(lattice, walk, grid=grid, title="", lines=[], line_xy=line_xy)
    area = drawing_area(picture)
    assert relative(places(picture, palette.START), area) == pytest.approx((1 / 7, 1 / 5), abs=0.02)
    end = relative(places(picture, palette.END), area)
    assert end == pytest.approx((5.7 / 7, 3.4 / 5), abs=0.02)


@pytest.mark.parametrize("driven", [[(0.0, 0.0)], [(50.0, 0.0), (-50.0, 3.0)]])
def test_missions_that_hardly_drove_or_left_the_map(driven):
    grid = room()
    lattice = CoverageLattice.from_map(grid, FOOTPRINT)
    visits = np.zeros(lattice.states.shape, np.uint16)
    picture = draw_mission(grid, lattice, np.array(driven), visits, title="", lines=[])
    assert len(inside(places(picture, palette.START), drawing_area(picture))) > 20


@pytest.mark.parametrize("cell_m", [0.004, 0.3, 1.0, 7.0, 30_000.0])
def test_the_scale_bar_is_a_round_length_to_scale(cell_m):
    lattice = CoverageLattice.from_free(np.ones((6, 30), bool), cell_m)
    picture = draw_walk(lattice, line((0, 0), (0, 1)), grid=None, title="", lines=[])
    x0, _, x1, bottom = drawing_area(picture)
    ink = places(picture, palette.INK, 0)
    below = ink[(ink[:, 1] > bottom) & (ink[:, 0] < x0 + 250)]
    row = next(row for row in np.unique(below[:, 1]) if np.count_nonzero(below[:, 1] == row) > 60)
    across = np.sort(below[below[:, 1] == row][:, 0])
    bar = across[: np.argmax(np.append(np.diff(across), 2) > 1) + 1]
    # One margin cell on each side of thirty.
    metres = (bar.max() - bar.min()) / (x1 - x0) * 32 * cell_m
    mantissa = metres / 10.0 ** np.floor(np.log10(metres * 1.02))
    assert min(abs(mantissa - step) / step for step in (1, 2, 5)) < 0.02
    assert 60 < bar.max() - bar.min() < 250


def test_letters_the_font_lacks_are_spelt_out():
    def sheet(text):
        plot = draw_walk(
            CoverageLattice.from_free(np.ones((1, 1), bool)),
            line((0, 0)),
            grid=None,
            title=text,
            lines=[text],
        )
        return plot.tobytes()

    assert sheet("3 m² × 2 – café ≥ 漢") == sheet("3 m2 x 2 - cafe >= ?")
    assert sheet("90 ° · a") != sheet("90 ? ? a")


def test_long_captions_are_wrapped():
    lattice = CoverageLattice.from_free(np.ones((1, 1), bool))
    heights = [
        draw_walk(lattice, line((0, 0)), grid=None, title="t", lines=["word " * words]).height
        for words in (1, 100)
    ]
    assert heights[1] > heights[0] + 40
