"""Judge of walks: errors that it must find, walks that it must accept, and its counts."""

import random
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.grid.lattice import CoverageLattice
from tests.benchmarks.judge import check_walk, reachable
from tests.naive import DIRECTIONS, distances, neighbours

# Row 0 is the first line here.
ROOM = ("...", "...", ".#.")
LOOP = [(0, 0), (1, 0), (2, 0), (1, 0), (1, 1), (1, 2), (2, 2), (1, 2), (0, 2), (0, 1)]


def grid(*rows):
    free = np.array([[letter == "." for letter in row] for row in rows])
    return CoverageLattice.from_free(free).steps.copy(), free


def judge(walk, start=(0, 0), end=None, rows=ROOM):
    steps, free = grid(*rows)
    return check_walk(steps, free, np.array(walk, np.int32).reshape(-1, 2), start, end)


def without_step(steps, cell, direction):
    """Return the masks with a thin wall beside ``cell``."""
    row, col = cell
    up, right = DIRECTIONS[direction]
    steps = steps.copy()
    steps[row, col] &= 255 - (1 << direction)
    steps[row + up, col + right] &= 255 - (1 << (direction + 2) % 4)
    return steps


def test_good_walk_passes_and_is_counted():
    for end in (None, (0, 1)):
        verdict = judge(LOOP, end=end)
        assert verdict.legal
        assert verdict.complete
        assert verdict.problems == ()
        assert (verdict.steps, verdict.revisits) == (9, 2)
        assert (verdict.turns_90, verdict.turns_180) == (3, 2)


def test_a_walk_of_one_cell_is_complete_on_one_cell():
    verdict = judge([(0, 0)], end=(0, 0), rows=(".#.",))
    assert verdict.problems == ()
    assert (verdict.steps, verdict.revisits, verdict.turns_90, verdict.turns_180) == (0, 0, 0, 0)


def changed(at, *cells):
    return LOOP[:at] + list(cells) + LOOP[at:]


@pytest.mark.parametrize(
    ("walk", "problem"),
    [
        ([], "the walk is empty"),
        (LOOP[1:], "starts at (1, 0) instead of (0, 0)"),
        (LOOP[:-1], "ends at (0, 2) instead of (0, 1)"),
        (changed(1, (0, 0)), "stands still: step 1, (0, 0) to (0, 0)"),
        (LOOP[:1] + LOOP[2:], "jumps: step 1, (0, 0) to (2, 0)"),
        (changed(5, (2, 1), (1, 1)), "takes a step the mask forbids: step 5, (1, 1) to (2, 1)"),
        (changed(3, (1, 1), (2, 0)), "jumps: step 3, (2, 0) to (1, 1)"),
        (changed(1, (-1, 0), (0, 0)), "outside the grid: (-1, 0)"),
        (changed(7, (2, 3), (2, 2)), "outside the grid: (2, 3)"),
        (changed(9, (0, 3), (0, 2)), "outside the grid: (0, 3)"),
    ],
)
def test_each_kind_of_illegal_walk_is_caught(walk, problem):
    verdict = judge(walk, end=(0, 1))
    assert not verdict.legal
    assert problem in verdict.problems


def test_illegal_walk_is_counted_as_it_is():
    verdict = judge([(0, 0), (-1, 0), (0, 0), (0, 0), (0, 1)])
    assert verdict.problems[:3] == (
        "outside the grid: (-1, 0)",
        "stands still: step 3, (0, 0) to (0, 0)",
        "reachable but never visited: (0, 2)",
    )
    assert (verdict.steps, verdict.revisits) == (4, 2)
    # What is no step makes no turn.
    assert (verdict.turns_90, verdict.turns_180) == (0, 1)


def test_thin_wall_between_free_cells_is_no_way_through():
    steps, free = grid(*ROOM)
    walk = np.array(LOOP)
    verdict = check_walk(without_step(steps, (1, 0), 0), free, walk, (0, 0))
    assert not verdict.legal
    assert verdict.complete
    assert verdict.problems == ("takes a step the mask forbids: step 4, (1, 0) to (1, 1)",)
    # The same wall elsewhere is no business of this walk.
    assert check_walk(without_step(steps, (0, 0), 0), free, walk, (0, 0)).problems == ()


def test_only_reachable_wanted_cells_must_be_covered():
    verdict = judge(LOOP[:-1])
    assert verdict.legal
    assert not verdict.complete
    assert verdict.problems == ("reachable but never visited: (0, 1)",)
    assert judge(LOOP, rows=(*ROOM, "###", "...")).problems == ()
    steps, free = grid(*ROOM)
    free[0, 1] = False
    assert check_walk(steps, free, np.array(LOOP[:-1]), (0, 0)).problems == ()


def test_only_the_first_of_many_problems_are_listed():
    verdict = judge([(0, 0)] * 6)
    assert verdict.problems == (
        *(f"stands still: step {step}, (0, 0) to (0, 0)" for step in (1, 2, 3)),
        "stands still: 2 more",
        *(f"reachable but never visited: {cell}" for cell in ((0, 1), (0, 2), (1, 0))),
        "reachable but never visited: 4 more",
    )
    assert (verdict.steps, verdict.revisits, verdict.turns_90, verdict.turns_180) == (5, 5, 0, 0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"start": (3, 0)}, r"start \(3, 0\) lies outside the 3 x 3 grid"),
        ({"start": (0, -1)}, r"start \(0, -1\)"),
        ({"end": (0, 3)}, r"end \(0, 3\)"),
        ({"walk": np.zeros((2, 3), np.int32)}, r"integers \(n, 2\)"),
        ({"walk": np.zeros((2, 2))}, r"integers \(n, 2\), got float64"),
        ({"wanted": np.ones((3, 2), bool)}, "uint8 and wanted bool"),
        ({"wanted": np.ones((3, 3), np.uint8)}, "uint8 and wanted bool"),
    ],
)
def test_malformed_question_is_refused(change, words):
    steps, free = grid(*ROOM)
    question = {"steps": steps, "wanted": free, "walk": np.array(LOOP), "start": (0, 0)}
    with pytest.raises(ValueError, match=words):
        check_walk(**question | change)


@pytest.mark.parametrize(("row", "col"), [(0, 0), (1, 1), (2, 2), (0, 2)])
@pytest.mark.parametrize("direction", range(4))
def test_mask_with_a_one_way_step_or_one_off_the_grid_is_refused(row, col, direction):
    steps, free = grid(*ROOM)
    steps[row, col] ^= 1 << direction
    up, right = DIRECTIONS[direction]
    both = sorted([(row, col), (row + up, col + right)])
    with pytest.raises(ValueError, match="allowed one way only") as refused:
        check_walk(steps, free, np.array(LOOP), (0, 0))
    assert f"between {both[0]} and {both[1]} " in str(refused.value)


def random_lattice(seed):
    """Return the masks of a random grid with some thin walls, and a free cell."""
    rng = random.Random(seed)
    shape = rng.randint(1, 12), rng.randint(1, 12)
    free = np.array([[rng.random() < 0.7 for _ in range(shape[1])] for _ in range(shape[0])])
    free.flat[rng.randrange(free.size)] = True
    steps = CoverageLattice.from_free(free).steps
    for row, col in np.argwhere(free).tolist():
        for direction in range(4):
            if steps[row, col] >> direction & 1 and rng.random() < 0.1:
                steps = without_step(steps, (row, col), direction)
    row, col = rng.choice(np.argwhere(free).tolist())
    return steps, free, (row, col), rng


@given(seed=st.integers(0, 10**6))
def test_reachable_cells_are_those_a_search_finds(seed):
    steps, _, start, _ = random_lattice(seed)
    found = {(row, col) for row, col in np.argwhere(reachable(steps, start)).tolist()}
    assert found == set(distances(steps, start))


@given(seed=st.integers(0, 10**6), length=st.integers(0, 150))
def test_figures_are_those_of_a_naive_count(seed, length):
    steps, free, start, rng = random_lattice(seed)
    around = neighbours(steps)
    walk = [start]
    while len(walk) <= length and around[start]:
        walk.append(rng.choice(list(around[walk[-1]].values())))
    verdict = check_walk(steps, free, np.array(walk, np.uint16), start, walk[-1])
    moves = [(after[0] - here[0], after[1] - here[1]) for here, after in pairwise(walk)]
    corners = [
        (DIRECTIONS.index(after) - DIRECTIONS.index(before)) % 4
        for before, after in pairwise(moves)
    ]
    missed = set(distances(steps, start)) - set(walk)
    assert verdict.legal
    assert verdict.complete is (not missed)
    assert bool(verdict.problems) is bool(missed)
    assert verdict.steps == len(moves)
    assert verdict.revisits == len(walk) - len(set(walk))
    assert verdict.turns_90 == corners.count(1) + corners.count(3)
    assert verdict.turns_180 == corners.count(2)


def test_long_way_through_a_serpentine_is_reached_and_judged():
    # 125,000 cells one after the other.
    free = np.ones((499, 500), bool)
    free[1::4, :-1] = free[3::4, 1:] = False
    walk = [
        (row, col)
        for row in range(499)
        for col in (range(500) if row % 4 == 0 else range(499, -1, -1))
        if free[row, col]
    ]
    steps = CoverageLattice.from_free(free).steps
    verdict = check_walk(steps, free, np.array(walk), (0, 0), walk[-1])
    assert verdict.problems == ()
    assert (verdict.revisits, verdict.turns_90, verdict.turns_180) == (0, 498, 0)
