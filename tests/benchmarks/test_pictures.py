"""Pictures of walks and pheromone show their input at the right places."""

import numpy as np
import pytest

from fasaco_edge.drawing import palette
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.planners.planner import ColonySnapshot
from tests.benchmarks.pictures import LabelledWalk, draw_pheromone, draw_walks
from tests.drawing.test_pictures import places

LINES = ["a caption"]


def walk(label, lattice, *cells):
    return LabelledWalk(label, "", lattice, np.array(cells, np.int32))


def there_and_back(label, lattice, row):
    out = [(row, col) for col in range(8)]
    return walk(label, lattice, *out, *out[-2::-1])


def test_each_walk_has_its_place():
    lattice = CoverageLattice.from_free(np.ones((8, 8), bool))
    walks = [there_and_back(str(row), lattice, row) for row in (0, 7, 7)]
    picture = draw_walks(walks, title="three", lines=LINES)
    again = places(picture, palette.REVISITED[0])
    middle = np.array(picture.size) / 2
    left, top = again[:, 0] < middle[0], again[:, 1] < middle[1]
    for part in (left & top, ~left & top, left & ~top):
        assert np.count_nonzero(part) > 500
    # Row 0 lies at the bottom of the first panel, row 7 at the top of the second.
    assert again[left & top][:, 1].mean() > again[~left & top][:, 1].mean() + 100
    # The fourth place is empty; the key does not reach it.
    assert not (~left & (again[:, 1] > middle[1] + 40) & (again[:, 1] < middle[1] + 300)).any()


@pytest.mark.parametrize(("last", "marked"), [((0, 0), False), ((0, 1), True)])
def test_the_end_is_marked_where_it_is_not_the_start(last, marked):
    lattice = CoverageLattice.from_free(np.ones((2, 3), bool))
    cells = [(0, 0), (0, 1), (0, 0)] if last == (0, 0) else [(0, 0), (0, 1)]
    picture = draw_walks([walk("only", lattice, *cells)], title="one", lines=LINES)
    marks = places(picture, palette.END)
    in_key = marks[:, 1] > picture.height - 90
    assert bool(in_key.any()) is marked
    assert bool((~in_key).any()) is marked


def test_pheromone_is_not_mirrored_and_goes_from_least_to_most():
    free = np.ones((6, 10), bool)
    free[0, 0] = False
    lattice = CoverageLattice.from_free(free)
    trail = np.where(free, 0.1, 0.0).astype(np.float32)
    trail[5, 9] = 0.3
    snapshot = ColonySnapshot(lattice.window, lattice.cell_m, trail, 7, 1, 1000, 60)
    picture = draw_pheromone(lattice, snapshot, title="pheromone", lines=LINES)
    least, most = palette.gradient(np.array([0.0, 1.0])).tolist()
    strong = places(picture, most)
    strong = strong[strong[:, 1] < picture.height - 80]
    low = places(picture, least)
    low = low[low[:, 1] < picture.height - 80]
    assert len(low) > 40 * len(strong)
    assert strong[:, 0].mean() > low[:, 0].max() - 80
    assert strong[:, 1].mean() < low[:, 1].min() + 80
    blocked = places(picture, palette.OCCUPIED, 0)
    assert blocked[:, 0].mean() < low[:, 0].mean()


def test_uniform_pheromone_can_be_drawn():
    lattice = CoverageLattice.from_free(np.ones((3, 4), bool))
    trail = np.full((3, 4), 0.1, np.float32)
    snapshot = ColonySnapshot(lattice.window, lattice.cell_m, trail, 0, 8, 10, 12)
    picture = draw_pheromone(lattice, snapshot, title="even", lines=LINES)
    assert len(places(picture, palette.gradient(np.zeros(1))[0])) > 1000
