"""What the bound is made of, against twins: blocks, matchings, independent sets, islands."""

import itertools
from collections import Counter

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.kernels.bound import blocks, matching
from fasaco_edge.kernels.bound.blocks import (
    Sea,
)
from fasaco_edge.kernels.bound.matching import (
    SINGLE,
    Bipartite,
)
from tests import naive
from tests.support.examples import examples
from tests.support.grids import problems
from tests.support.inner import entry

biconnected_blocks = entry(blocks.biconnected_blocks)
find_islands = entry(blocks.find_islands)
measure_from = entry(blocks.measure_from)
spanning_weight = entry(blocks.spanning_weight)
wanted_first = entry(blocks.wanted_first)
choose_independent = entry(matching.choose_independent)
match = entry(matching.match)
pairing_for = entry(matching.pairing_for)

PLENTY = 10**6


def flat_links(steps, kept):
    """The links between kept cells, by flat index."""
    cols = steps.shape[1]
    around = naive.neighbours(steps)
    return {
        row * cols + col: {
            there[0] * cols + there[1] for there in around[row, col].values() if there in kept
        }
        for row, col in kept
    }


def connected(links, without=()):
    """The connected parts of a graph, as sets."""
    parts, left = [], set(links) - set(without)
    while left:
        part, ring = set(), {min(left)}
        while ring:
            part |= ring
            ring = {there for here in ring for there in links[here]} - part - set(without)
        parts.append(part)
        left -= part
    return parts


def offsets_of(steps):
    return np.array([1, steps.shape[1], -1, -steps.shape[1]])


def masks(links, cells, offsets, size):
    """Masks of the links between ``cells``, uint8 (size,)."""
    mask = np.zeros(size, np.uint8)
    for here, (direction, offset) in itertools.product(cells, enumerate(offsets.tolist())):
        if here + offset in links[here] & set(cells):
            mask[here] |= 1 << direction
    return mask


def naive_blocks(links):
    """Two steps from a cell are of one block if their ends hang together without the cell."""
    blocks = {frozenset((here, there)) for here in links for there in links[here]}
    for cell in links:
        for part in connected(links, without=[cell]):
            joined = {
                block for block in blocks if any({cell, end} <= block for end in part & links[cell])
            }
            if joined:
                blocks = blocks - joined | {frozenset().union(*joined)}
    return blocks


@examples(150)
@given(task=problems(max_side=7))
def test_twin_finds_the_same_blocks(task):
    ground, start = task
    row, col = ground.local(start)
    root = row * ground.steps.shape[1] + col
    links = flat_links(ground.steps, naive.distances(ground.steps, (row, col)))
    found = biconnected_blocks(ground.steps.ravel(), offsets_of(ground.steps), root)
    blocks = [
        found.cells[one:other].tolist() for one, other in itertools.pairwise(found.first.tolist())
    ]
    assert all(len(set(block)) == len(block) for block in blocks)
    assert Counter(map(frozenset, blocks)) == Counter(naive_blocks(links))
    for number, (top, *below) in enumerate(blocks):
        if top != root:
            (part,) = (part for part in connected(links, without=[top]) if root in part)
            assert not part & set(below)
        # What lies beyond a cell comes before the blocks the cell is below in.
        assert not any(later[0] in below for later in blocks[number:])


def test_wanted_cells_come_first_behind_the_top():
    cells = np.array([5, 3, 1, 4, 0, 2], np.int32)
    assert wanted_first(cells, np.array([1, 0, 0, 1, 1, 0], np.uint8)) == 4
    assert cells[0] == 5
    assert sorted(cells[1:4].tolist()) == [0, 3, 4]
    assert sorted(cells[4:].tolist()) == [1, 2]


def most_pairs(links, cells, colour):
    """The size of a maximum matching, by one path after the other."""
    mate = {}

    def matched(here, seen):
        for there in links[here] & cells - seen:
            seen.add(there)
            if there not in mate or matched(mate[there], seen):
                mate[there] = here
                return True
        return False

    return sum(matched(here, set()) for here in sorted(cells) if colour[here] == 0)


@st.composite
def graphs(draw):
    """Some cells of a lattice: links of the lattice, the cells, and all as the kernels have it."""
    ground, _ = draw(problems(max_side=7))
    everywhere = {tuple(cell) for cell in np.argwhere(ground.coverable).tolist()}
    links = flat_links(ground.steps, everywhere)
    cells = draw(st.sets(st.sampled_from(sorted(links)))) if draw(st.booleans()) else set(links)
    colour = (np.indices(ground.steps.shape).sum(axis=0) % 2).astype(np.uint8).ravel()
    offsets = offsets_of(ground.steps)
    inside = masks(links, sorted(cells), offsets, colour.size)
    order = np.array(draw(st.permutations(sorted(cells))), np.int32)
    return links, cells, Bipartite(order, inside, colour, offsets)


def independent(links, chosen):
    return not any(links[cell] & chosen for cell in chosen)


@examples(200)
@given(drawn=graphs(), side=st.integers(0, 1))
def test_twin_finds_no_larger_matching_or_independent_set(drawn, side):
    links, cells, graph = drawn
    pairing, chosen = pairing_for(graph.links.size), np.zeros(graph.links.size, np.uint8)
    match(graph, pairing, PLENTY)
    mate = {cell: int(pairing.mate[cell]) for cell in cells if pairing.mate[cell] != SINGLE}
    assert all(there in links[here] & cells and mate[there] == here for here, there in mate.items())
    pairs = most_pairs(links, cells, graph.colour)
    assert len(mate) == 2 * pairs
    size = choose_independent(graph, pairing, side, -1, chosen)
    largest = set(np.flatnonzero(chosen).tolist())
    assert independent(links, largest)
    assert len(largest) == size == len(cells) - pairs
    for cell in cells:
        # A cell of this side is in the set only if it is in every largest one.
        if graph.colour[cell] == side:
            needed = most_pairs(links, cells - {cell}, graph.colour) == pairs
            assert (cell in largest) == needed


@examples(100)
@given(drawn=graphs(), side=st.integers(0, 1), data=st.data())
def test_a_chosen_set_is_independent_after_any_matching(drawn, side, data):
    links, cells, graph = drawn
    pairing, chosen = pairing_for(graph.links.size), np.zeros(graph.links.size, np.uint8)
    match(graph, pairing, 0)
    for cell in data.draw(st.lists(st.sampled_from(sorted(cells)))) if cells else ():
        # Forget some pairs.
        if pairing.mate[cell] != SINGLE:
            pairing.mate[pairing.mate[cell]] = SINGLE
            pairing.mate[cell] = SINGLE
    sided = [cell for cell in sorted(cells) if graph.colour[cell] == side]
    first = data.draw(st.sampled_from([-1, *sided]))
    size = choose_independent(graph, pairing, side, first, chosen)
    found = set(np.flatnonzero(chosen).tolist())
    assert len(found) == size
    assert independent(links, found)
    assert first == -1 or first in found


def naive_islands(links, wanted, chosen):
    """Cells that hang together by steps at chosen cells, where one of them is wanted."""
    at_chosen = {
        here: {there for there in around if here in chosen or there in chosen}
        for here, around in links.items()
    }
    return [part for part in connected(at_chosen) if part & wanted]


def naive_spanning(links, islands):
    """Weights of a minimum spanning tree's edges: the nearest island, again and again (Prim)."""
    weights, reached, left = [], set(islands[0]), list(islands[1:])
    while left:
        away, ring, steps = dict.fromkeys(reached, 0), reached, 0
        while ring:
            steps += 1
            ring = {there for here in ring for there in links[here]} - away.keys()
            away |= dict.fromkeys(ring, steps)
        nearest = min(left, key=lambda island: min(away[cell] for cell in island))
        weights.append(min(away[cell] for cell in nearest))
        reached |= nearest
        left.remove(nearest)
    return weights


@examples(200)
@given(task=problems(max_side=8), seed=st.integers(0, 2**32), share=st.sampled_from((0.1, 0.5, 1)))
def test_twin_finds_the_same_islands_and_spanning_weight(task, seed, share):
    ground, start = task
    random = np.random.default_rng(seed)
    links = flat_links(ground.steps, naive.distances(ground.steps, ground.local(start)))
    wanted = {cell for cell in sorted(links) if random.random() < share} or {min(links)}
    chosen = set()
    for cell in random.permutation(sorted(wanted)).tolist():
        if random.random() < 0.8 and not links[cell] & chosen:
            chosen.add(cell)
    size, offsets = ground.steps.size, offsets_of(ground.steps)
    colour = (np.indices(ground.steps.shape).sum(axis=0) % 2).astype(np.uint8).ravel()
    cells = np.array(sorted(wanted) + sorted(set(links) - wanted), np.int32)
    inside = masks(links, sorted(links), offsets, size)
    room = [np.empty(size, np.int32) for _ in range(3)]
    sea = Sea(cells, len(wanted), inside, offsets, *room)
    is_chosen = np.zeros(size, np.uint8)
    is_chosen[sorted(chosen)] = 1
    count = find_islands(sea, is_chosen, colour)
    islands = naive_islands(links, wanted, chosen)
    numbers = [{int(sea.island[cell]) for cell in island} for island in islands]
    assert sorted(numbers, key=min) == [{number} for number in range(len(islands))]
    assert sum(count) == len(islands)
    for island in islands:
        assert len({int(colour[cell]) for cell in island & chosen}) <= 1
    weights = naive_spanning(links, islands)
    assert spanning_weight(sea, len(islands)) == (sum(weights), max(weights, default=0))
    measure_from(sea, min(links))
    away = naive.distances(ground.steps, divmod(min(links), ground.steps.shape[1]))
    for (row, col), steps in away.items():
        assert sea.away[row * ground.steps.shape[1] + col] == steps
