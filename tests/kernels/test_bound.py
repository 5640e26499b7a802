"""The bound against shortest walks found by dynamic programming, and against known ones."""

import itertools

import numpy as np
import pytest

from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.kernels.bound.covering import covering_bound
from tests import naive
from tests.support.grids import ROOMS, lattice, with_passages_closed

ANYWHERE = -1
PLENTY = 10**6


def bound(ground, start, end=None, required=None):
    """The bound for cells (row, col) of a lattice; all coverable ones if not told which."""
    cols = ground.steps.shape[1]
    asked = np.zeros(ground.steps.shape, np.uint8)
    for cell in np.argwhere(ground.coverable).tolist() if required is None else required:
        asked[tuple(cell)] = 1
    flat_end = ANYWHERE if end is None else end[0] * cols + end[1]
    return covering_bound(ground.steps, asked, start[0] * cols + start[1], flat_end)


def shortest_walks(steps, cells):
    """The steps of a shortest walk from the first of ``cells`` over all, by where it ends.

    Held and Karp, 1962: over each set of cells, ending in each one of them.
    """
    away = [naive.distances(steps, cell) for cell in cells]
    between = np.array([[row[cell] for cell in cells] for row in away])
    count = len(cells)
    shortest = np.full((1 << count, count), PLENTY)
    shortest[1, 0] = 0
    sets = np.arange(1 << count)
    sizes = sum(sets >> bit & 1 for bit in range(count))
    for size, last in itertools.product(range(1, count), range(1, count)):
        before = sets[(sizes == size) & (sets >> last & 1 == 0)]
        shortest[before | 1 << last, last] = (shortest[before] + between[last]).min(axis=1)
    return {end: min(shortest[-1] + [row[end] for row in away]) for end in away[0]}


def drawn_task(random, most=10):
    """A lattice with thin walls, a start, and at most ``most`` cells to visit, start first.

    All that can be reached; or what lies around one or two cells, as in the course of a
    mission; or cells anywhere.
    """
    floor = random.random(random.integers(2, 8, 2)) < random.choice((1.0, 0.85, 0.6))
    floor[0, 0] = True
    closed = random.choice((0.0, 0.0, 0.2, 0.4))
    ground = with_passages_closed(CoverageLattice.from_free(floor), closed, random)
    row, col = random.choice(np.argwhere(floor)).tolist()
    reachable = sorted(naive.distances(ground.steps, (row, col)))
    count = int(random.integers(1, most))
    if len(reachable) <= most:
        count = most
    centres = [naive.distances(ground.steps, tuple(random.choice(reachable))) for _ in "12"]
    spread = random.choice((0.5, 0.5, 20.0))
    place = {
        cell: min(away[cell] for away in centres) + spread * random.random() for cell in reachable
    }
    chosen = set(sorted(reachable, key=place.get)[:count]) - {(row, col)}
    return ground, [(row, col), *sorted(chosen)][:most], reachable


def test_no_walk_beats_the_bound_and_most_shortest_walks_meet_it():
    random = np.random.default_rng(2024)
    gaps = {(kind, known): [] for kind in ("anywhere", "home", "given") for known in (True, False)}
    for _ in range(500):
        ground, cells, reachable = drawn_task(random)
        walks = shortest_walks(ground.steps, cells)
        end = reachable[random.integers(len(reachable))]
        shortest = {
            "anywhere": (None, min(walks.values())),
            "home": (cells[0], walks[cells[0]]),
            "given": (end, walks[end]),
        }
        for kind, (goal, steps) in shortest.items():
            least = bound(ground, cells[0], goal, cells)
            assert 0 <= least <= steps, (kind, ground.steps, cells, goal)
            gaps[kind, len(cells) == len(reachable)].append(steps - least)
    # How often the bound is the optimum: with nothing covered yet, and with some.
    for kind, untouched, begun in (
        ("anywhere", 0.97, 0.87),
        ("home", 0.97, 0.74),
        ("given", 0.97, 0.72),
    ):
        assert np.mean(np.array(gaps[kind, True]) == 0) > untouched
        assert np.mean(np.array(gaps[kind, False]) == 0) > begun


@pytest.mark.parametrize("required", [None, []])
def test_a_start_without_steps_takes_none(required):
    ground = lattice("#.#")
    assert bound(ground, (0, 1), None, required) == 0
    assert bound(ground, (0, 1), (0, 1), required) == 0


@pytest.mark.parametrize(("rows", "cols"), [(2, 2), (4, 6), (5, 5), (7, 3), (5, 8)])
def test_rectangles_have_their_known_optima(rows, cols):
    ground = lattice(*["." * cols] * rows)
    cells = rows * cols
    assert bound(ground, (0, 0)) == cells - 1
    assert bound(ground, (0, 0), (0, 0)) == cells + cells % 2
    # From a cell of the minor colour no walk visits each cell of an odd rectangle once.
    assert bound(ground, (0, 1)) == cells - 1 + cells % 2
    # The colours of start and end decide whether the steps are even.
    assert bound(ground, (0, 0), (1, 1)) == cells - 1 + (cells - 1) % 2


@pytest.mark.parametrize(
    ("room", "end", "steps"),
    [
        ("row", None, 9),
        ("row", (0, 3), 12),
        ("row", (0, 0), 9),
        ("column", None, 8),
        ("comb", (3, 4), 46),
    ],
)
def test_trees_have_their_known_optima(room, end, steps):
    assert bound(*ROOMS[room], end) == steps


def test_the_way_over_covered_ground_counts():
    ground = lattice(*["." * 30] * 10)
    pocket = [(8, 27), (8, 28), (9, 27), (9, 28)]
    assert bound(ground, (0, 0), None, pocket) == 35 + 3
    assert bound(ground, (0, 0), (0, 0), pocket) == 35 + 3 + 36
    assert bound(ground, (0, 0), (0, 2), pocket) >= 35 + 2 + 33
    # Both ends stand together and far from the pocket: there and back, less the step between.
    assert bound(ground, (0, 0), (0, 5), pocket) >= 2 * 35 - 5
    assert bound(ground, (0, 0), (0, 2), []) == 2


def drawn(*rows):
    """The bound from S to E (anywhere if there is none) over all o; the last line is row 0."""
    letters = {letter: [] for letter in "SEo."}
    for row, line in enumerate(rows[::-1]):
        for col, letter in enumerate(line):
            letters[letter].append((row, col))
    end = letters["E"][0] if letters["E"] else None
    ground = CoverageLattice.from_free(np.ones((len(rows), len(rows[0])), bool))
    return bound(ground, letters["S"][0], end, letters["o"])


def test_a_walk_that_ends_in_its_first_island_returns_to_it():
    assert drawn("oooS..", ".oE.oo") == 12


def test_the_colours_of_start_and_end_give_the_parity_of_steps():
    assert drawn("o..oo.", "...oS.", "....oo") == 11


def test_unreachable_cells_do_not_count_in_the_bound():
    ground = lattice("..#..", "..#..")
    assert bound(ground, (0, 0)) == 3
    assert bound(ground, (0, 0), (0, 0)) == 4


def test_a_ring_costs_steps_between_its_islands():
    # Half of the 16 cells are independent, no more: 16 steps. But no closed walk of 16 exists.
    ring = lattice(".....", "..##.", ".##..", ".....")
    assert bound(ring, (0, 0), (0, 0)) == 18
