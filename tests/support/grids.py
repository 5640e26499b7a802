"""Lattices and maps: drawn by hand, drawn at random, and with passages closed."""

import itertools
import json
import math
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.lattice import CoverageLattice, Footprint
from fasaco_edge.grid.occupancy import OccupancyGrid
from tests import naive

# The paper's grids must not be shipped with this project; they may lie beside the checkout.
BESIDE = Path(__file__).parents[3] / "shared" / "reference"
REFERENCE = Path(os.environ.get("FASACO_REFERENCE", BESIDE))


def lattice(*rows):
    """A lattice from text: the last line is row 0, ``.`` is coverable."""
    return CoverageLattice.from_free(free(*rows))


def free(*rows):
    return np.array([[letter == "." for letter in row] for row in rows[::-1]])


def placed(lattice, row0, col0):
    """The same lattice elsewhere in the map frame."""
    window = lattice.window
    moved = Window(row0, col0, row0 + window.rows, col0 + window.cols)
    return CoverageLattice(moved, lattice.cell_m, lattice.states, lattice.steps)


def with_passages_closed(lattice, share, draw):
    """Close a share of all passages, in both directions, as a thin wall would."""
    steps = lattice.steps.copy()
    for there, back, one, other in (
        (0, 2, np.s_[:, :-1], np.s_[:, 1:]),
        (1, 3, np.s_[:-1], np.s_[1:]),
    ):
        closed = draw.random(steps[one].shape) < share
        steps[one] &= np.where(closed, 15 - (1 << there), 15).astype(np.uint8)
        steps[other] &= np.where(closed, 15 - (1 << back), 15).astype(np.uint8)
    return CoverageLattice(lattice.window, lattice.cell_m, lattice.states, steps)


@st.composite
def problems(draw, max_side=9):
    """A lattice with walls, thin walls and a place in the map frame; a start in it."""
    rows, cols = draw(st.integers(1, max_side)), draw(st.integers(1, max_side))
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    open_floor = random.random((rows, cols)) < draw(st.sampled_from((1.0, 0.9, 0.7)))
    start = int(random.integers(rows)), int(random.integers(cols))
    open_floor[start] = True
    ground = CoverageLattice.from_free(open_floor)
    ground = with_passages_closed(ground, draw(st.sampled_from((0.0, 0.1, 0.4))), random)
    row0, col0 = draw(st.sampled_from(((0, 0), (-3, 2), (40, -17))))
    return placed(ground, row0, col0), (start[0] + row0, start[1] + col0)


# Where a walk ends: "anywhere", "home", or a draw among the cells that can be reached.
ENDS = st.one_of(st.sampled_from(("anywhere", "home")), st.integers(0, 80))


def end_of(drawn, lattice, start):
    """Return the ``end`` of a problem for a value of ``ENDS``."""
    if drawn == "anywhere":
        return None
    if drawn == "home":
        return start
    reachable = sorted(naive.distances(lattice.steps, lattice.local(start)))
    row, col = reachable[drawn % len(reachable)]
    return row + lattice.window.row0, col + lattice.window.col0


def reference(name):
    """A grid of the paper as (lattice, start); None if it is not beside the checkout."""
    grid, about = REFERENCE / f"{name}.npy", REFERENCE / f"{name}.json"
    if not grid.exists():
        return None
    row, col = json.loads(about.read_text())["start"]
    return CoverageLattice.from_free(np.load(grid).astype(bool)), (row, col)


ROOMS = {
    "one cell": (lattice("."), (0, 0)),
    "row": (lattice("......."), (0, 3)),
    "column": (lattice(*"......."), (2, 0)),
    "square": (lattice(*["....."] * 5), (2, 2)),
    "rooms": (
        lattice(
            "............",
            "....#.......",
            "....#.......",
            "....#..#####",
            "###.#.......",
            "....#..#....",
            ".......#....",
        ),
        (0, 0),
    ),
    "comb": (lattice(".........", ".#.#.#.#.", ".#.#.#.#.", ".#.#.#.#."), (3, 4)),
}


# 45 and 30 degrees put pixel corners on cell borders; other angles are random.
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
    """A map of 0x0 up to max_side pixels, mostly free, at a random pose."""
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
    """A part of a map, with its own size and origin, as if less had been seen."""
    geometry = grid.geometry
    x, y = geometry.to_map(col0, row0)
    part = GridGeometry(
        row1 - row0, col1 - col0, geometry.resolution, Pose2D(x, y, geometry.origin.yaw)
    )
    return OccupancyGrid(part, grid.cells[row0:row1, col0:col1].copy())


def seen_around(grid, at, reach_m):
    """The same map, of which only what is near a point is known."""
    col, row = grid.geometry.to_pixels(*at)
    rows, cols = np.indices(grid.cells.shape) + 0.5
    near = np.hypot(rows - row, cols - col) * grid.geometry.resolution < reach_m
    return OccupancyGrid(grid.geometry, np.where(near, grid.cells, -1).astype(np.int8))


def on_raster(geometry):
    """A grid moved onto its raster, by less than the rounding of float32."""
    raster, window = geometry.on_raster()
    right, up = window.col0 + raster.right, window.row0 + raster.up
    corner = GridGeometry(0, 0, raster.resolution, Pose2D(0, 0, raster.yaw)).to_map(right, up)
    return GridGeometry(
        geometry.rows, geometry.cols, raster.resolution, Pose2D(*corner, raster.yaw)
    )


def repainted(draw, occupancy):
    """A map with other values in some pixels, with the same or another meaning."""
    cells = occupancy.cells.copy()
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    share = draw(st.sampled_from([0.0, 0.005, 0.05, 1.0]))
    cells = np.where(random.random(cells.shape) < share, random.choice(VALUES, cells.shape), cells)
    return replace(occupancy, cells=cells.astype(np.int8))


def part_of(draw, whole):
    """A random part of a map, as if only this part had been seen."""
    rows, cols = whole.cells.shape
    row0, row1 = sorted(draw(st.tuples(st.integers(0, rows), st.integers(0, rows))))
    col0, col1 = sorted(draw(st.tuples(st.integers(0, cols), st.integers(0, cols))))
    return cropped(whole, row0, col0, row1, col1)


def displaced(draw, occupancy):
    """A map moved, rotated, or on other pixels."""
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


def assert_answers(problem, path):
    """Check that the walk begins at the start, makes legal steps, and visits all cells to cover."""
    ground = problem.lattice
    walk = [ground.local(cell) for cell in path.cells.tolist()]
    around = naive.neighbours(ground.steps)
    assert walk[0] == ground.local(problem.start)
    assert all(there in around[here].values() for here, there in itertools.pairwise(walk))
    assert {(int(r), int(c)) for r, c in np.argwhere(problem.to_cover)} <= set(walk)
    if problem.end is not None:
        assert walk[-1] == ground.local(problem.end)
    assert path.cells.dtype == np.int32
    assert path.cost_s == naive.walk_us(walk, problem.cost) / 1e6
