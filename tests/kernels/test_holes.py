"""Rays from holes, and the sides they are passed on, against homology over two elements."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.kernels.local_search.holes import rays
from fasaco_edge.kernels.local_search.proposals import improve
from tests.kernels.grounds import (
    PRICES,
    Task,
    cells_of,
    guarded,
    steps_taken,
    stream,
    tasks,
    walk_on,
)
from tests.support.examples import examples
from tests.support.grids import ROOMS, lattice

EAST, NORTH = 0, 1
EVERYWHERE = np.empty(0, np.int32)


def throw(task):
    ground = task.ground()
    crossed = guarded(ground.bound, np.int64, 5)
    holes = rays(ground, crossed)
    return ground, holes, crossed


def links_of(ground):
    """All steps, each as its south-western cell and its direction, with the cells it links."""
    return {
        (cell, direction): (cell, cell + int(ground.offsets[direction]))
        for cell in range(ground.bound)
        for direction in (EAST, NORTH)
        if ground.steps[cell] >> direction & 1
    }


class Space:
    """What a set of chains spans over the two-element field; a chain is a set of steps."""

    def __init__(self, links):
        self.bit = {link: 1 << index for index, link in enumerate(links)}
        self.basis = {}

    def left_of(self, chain):
        """What is left of a chain when all that is spanned is taken out: 0 if it is spanned."""
        word = 0
        for link in chain:
            word ^= self.bit[link]
        while word and word.bit_length() in self.basis:
            word ^= self.basis[word.bit_length()]
        return word

    def add(self, chain):
        """Span a chain more; tell whether it is a new one."""
        word = self.left_of(chain)
        if word:
            self.basis[word.bit_length()] = word
        return word != 0


def squares_of(links, width):
    """The unit squares that have all four steps, as chains."""
    for cell, _ in links:
        around = {(cell, EAST), (cell, NORTH), (cell + 1, NORTH), (cell + width, EAST)}
        if (cell, EAST) in links and around <= links.keys():
            yield frozenset(around)


def loops_of(links):
    """A loop for each step beyond a spanning forest: a base of all loops."""
    way = {}
    for root in {cell for ends in links.values() for cell in ends}:
        if root in way:
            continue
        way[root], ring = frozenset(), [root]
        while ring:
            cell = ring.pop()
            for link, ends in links.items():
                if cell in ends and (other := sum(ends) - cell) not in way:
                    way[other] = way[cell] ^ {link}
                    ring.append(other)
    return [
        loop for link, (one, other) in links.items() if (loop := way[one] ^ way[other] ^ {link})
    ]


def crossing(crossed, loop):
    total = 0
    for cell, direction in loop:
        if direction == NORTH:
            total ^= int(crossed[cell])
    return total


@examples(150)
@given(task=tasks(7), seed=st.integers(0, 2**32))
def test_rays_cancel_out_just_for_loops_that_are_sums_of_squares(task, seed):
    ground, holes, crossed = throw(task)
    links = links_of(ground)
    squares, loops = Space(links), loops_of(links)
    whole = set(squares_of(links, task.width))
    assert all(squares.add(square) for square in whole)
    # A loop more for each hole: that many classes there are to be in.
    assert holes == len(loops) - len(whole)
    random = np.random.default_rng(seed)
    sums = [[loop for loop in loops if random.random() < share] for share in (0.1, 0.3, 0.5)]
    for parts in ([loop] for loop in loops), sums:
        for some in parts:
            loop = frozenset()
            for part in some:
                loop ^= part
            assert (crossing(crossed, loop) == 0) == (squares.left_of(loop) == 0)


@pytest.mark.parametrize(
    ("ground", "holes"),
    [
        (ROOMS["one cell"][0], 0),
        (ROOMS["row"][0], 0),
        (ROOMS["column"][0], 0),
        (ROOMS["square"][0], 0),
        (ROOMS["comb"][0], 0),
        (lattice("...", ".#.", "..."), 1),
        (lattice("....", ".##.", ".##.", "...."), 1),
        # Two blocked cells that touch at a corner are round one hole.
        (lattice("....", ".#..", "..#.", "...."), 1),
        (lattice(".....", ".#.#.", "....."), 2),
        (lattice(".....", ".###.", ".#.#.", ".###.", "....."), 1),
        # On the rim, open to the outside.
        (lattice("...", "..#", "..."), 0),
    ],
)
def test_holes_are_counted(ground, holes):
    task = Task(ground.steps, ground.coverable, [])
    assert throw(task)[1] == holes


def link_between(ground, one, other):
    return min(one, other), 0 if abs(one - other) == 1 else 1


def chain_of(ground, cells):
    """The steps that are walked an odd number of times."""
    times = steps_taken(cells)
    return frozenset(link_between(ground, *ends) for ends in times if times[ends] % 2)


@examples(80)
@given(task=tasks(), prices=st.sampled_from((PRICES[1], PRICES[3])), seed=st.integers(0, 2**32))
def test_local_search_never_changes_the_side_a_hole_is_passed_on(task, prices, seed):
    ground = task.ground()
    walk, links = walk_on(ground, task.cells(), prices), links_of(ground)
    squares = Space(links)
    for square in squares_of(links, task.width):
        squares.add(square)
    before = chain_of(ground, cells_of(walk))
    for heat in (0, 3 * prices.step_us):
        improve(ground, walk, prices, EVERYWHERE, heat, 2000, stream(seed))
        assert not squares.left_of(before ^ chain_of(ground, cells_of(walk)))
