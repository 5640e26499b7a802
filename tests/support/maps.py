"""Maps and footprints at random, with origins of every kind."""

import math
from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from fasaco_edge.grid.geometry import GridGeometry, Pose2D
from fasaco_edge.grid.lattice import Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid

# 45 and 30 degrees put pixel corners on cell borders; the rest are as they come.
YAWS = st.one_of(
    st.sampled_from([0.0, math.pi / 2, math.pi, -math.pi / 4, math.pi / 6]),
    st.floats(-math.pi, math.pi),
)
VALUES = (-1, 0, 10, 25, 26, 50, 64, 65, 100)
RESOLUTIONS = st.sampled_from([0.05, 0.1, 0.25, float(np.float32(0.05)), 0.07])


def grid(cells, resolution=0.1, x=0.0, y=0.0, yaw=0.0):
    cells = np.asarray(cells, np.int8)
    return OccupancyGrid(GridGeometry(*cells.shape, resolution, Pose2D(x, y, yaw)), cells)


@st.composite
def occupancy_grids(draw, max_side=14):
    """A map of 0x0 up to max_side pixels, mostly free, placed and turned somewhere."""
    rows, cols = draw(st.integers(0, max_side)), draw(st.integers(0, max_side))
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    walls = draw(st.sampled_from([0.0, 0.02, 0.1]))
    values = random.choice([0, 10, 25], size=(rows, cols))
    obstacles = random.choice([100, 65, 64, 26, -1], size=(rows, cols))
    cells = np.where(random.random((rows, cols)) < walls, obstacles, values)
    place = st.one_of(st.sampled_from([0.0, 0.3, -0.9]), st.floats(-5, 5))
    return grid(cells, draw(RESOLUTIONS), draw(place), draw(place), draw(YAWS))


@st.composite
def footprints(draw, resolution):
    """Cells of 1 to 6 pixels; a robot narrower, as wide or wider than its tool."""
    cell_m = resolution * draw(st.sampled_from([1.0, 2.0, 3.0, 4.3, 6.0]))
    return Footprint(cell_m, cell_m * draw(st.sampled_from([0.1, 0.35, 0.5, 0.6, 1.1])))


def cropped(grid, row0, col0, row1, col1):
    """The same map, of which less has been seen: another size and origin."""
    geometry = grid.geometry
    x, y = geometry.to_map(col0, row0)
    part = GridGeometry(
        row1 - row0, col1 - col0, geometry.resolution, Pose2D(x, y, geometry.origin.yaw)
    )
    return OccupancyGrid(part, grid.cells[row0:row1, col0:col1].copy())


def on_raster(geometry):
    """The same grid where its raster has it: off by less than rounding to float32 may be."""
    raster, window = geometry.on_raster()
    right, up = window.col0 + raster.right, window.row0 + raster.up
    corner = GridGeometry(0, 0, raster.resolution, Pose2D(0, 0, raster.yaw)).to_map(right, up)
    return GridGeometry(
        geometry.rows, geometry.cols, raster.resolution, Pose2D(*corner, raster.yaw)
    )


def repainted(draw, occupancy):
    """Some pixels have got other values; of the same meaning or not."""
    cells = occupancy.cells.copy()
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    share = draw(st.sampled_from([0.0, 0.005, 0.05, 1.0]))
    cells = np.where(random.random(cells.shape) < share, random.choice(VALUES, cells.shape), cells)
    return replace(occupancy, cells=cells.astype(np.int8))


def part_of(draw, whole):
    """As much of the building as has been seen."""
    rows, cols = whole.cells.shape
    row0, row1 = sorted(draw(st.tuples(st.integers(0, rows), st.integers(0, rows))))
    col0, col1 = sorted(draw(st.tuples(st.integers(0, cols), st.integers(0, cols))))
    return cropped(whole, row0, col0, row1, col1)


def displaced(draw, occupancy):
    """The map lies elsewhere, or is turned, or is told in other pixels."""
    geometry, origin = occupancy.geometry, occupancy.geometry.origin
    pixels = draw(st.sampled_from([3.0, -2.0, 1000.0, 0.5, 0.37, 1e-5]))
    match draw(st.sampled_from(["along x", "along y", "turned", "scaled"])):
        case "along x":
            origin = Pose2D(*geometry.to_map(pixels, 0), origin.yaw)
        case "along y":
            origin = Pose2D(*geometry.to_map(0, pixels), origin.yaw)
        case "turned":
            origin = Pose2D(origin.x, origin.y, draw(YAWS))
        case _:
            return replace(
                occupancy, geometry=replace(geometry, resolution=geometry.resolution / 2)
            )
    return replace(occupancy, geometry=replace(geometry, origin=origin))
