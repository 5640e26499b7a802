"""Lattices to plan on: drawn by hand, drawn at random, and with passages closed."""

import json
import os
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import CoverageLattice
from tests import naive

# The paper's own grids are not ours to ship: looked for beside the checkout.
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
    """The end as a problem has it."""
    if drawn == "anywhere":
        return None
    if drawn == "home":
        return start
    reachable = sorted(naive.distances(lattice.steps, lattice.local(start)))
    row, col = reachable[drawn % len(reachable)]
    return row + lattice.window.row0, col + lattice.window.col0


def reference(name):
    """A grid of the paper as (lattice, start), or None where it is not at hand."""
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
