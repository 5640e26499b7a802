"""Islands: what a walk over a block can reach along steps that touch an independent set.

A step between two islands touches no cell of the set, so a bound that counts the
steps at the set's cells does not count it yet. This file finds the islands and
what it costs at least to drive between them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import kernel

NO_ISLAND = -1


class Sea(NamedTuple):
    """A block with islands in it, on a lattice of n cells.

    Attributes:
        cells: int32 (k,), the block's cells; the first ``wanted`` of them must be visited.
        steps: uint8 (n,), step masks of these cells inside the block.
        offsets: int64 (4,), difference of flat index for a step in each direction.
        island: int32 (n,), number of a cell's island, or NO_ISLAND.
        away: int32 (n,), steps from the nearest island.
        queue: int32 (n,).
    """

    cells: NDArray[np.int32]
    wanted: int
    steps: NDArray[np.uint8]
    offsets: NDArray[np.int64]
    island: NDArray[np.int32]
    away: NDArray[np.int32]
    queue: NDArray[np.int32]


@kernel
def find_islands(sea: Sea, chosen: NDArray[np.uint8], colour: NDArray[np.uint8]) -> tuple[int, int]:
    """Number the islands with a wanted cell; return how many there are of each colour.

    An island's colour is that of its chosen cells. They agree: a step from a
    chosen cell leads to a cell of the other colour that is not chosen, and a step from
    there that belongs to the island leads to a chosen cell again. A wanted cell with no
    chosen neighbour is an island by itself, of the colour it has not. So in an island
    all cells of its colour are chosen. Two islands of one colour are never one step
    apart: one end of the step would have that colour, so be chosen, and join them.

    Args:
        sea: the block; ``island`` is written for its cells.
        chosen: uint8 (n,), the independent set, wanted cells all.
        colour: uint8 (n,), 0 or 1, differing along each step.
    """
    for cell in sea.cells:
        sea.island[cell] = NO_ISLAND
    islands = np.zeros(2, np.int64)
    for source in sea.cells[: sea.wanted]:
        if sea.island[source] != NO_ISLAND:
            continue
        number = islands[0] + islands[1]
        islands[colour[source] if chosen[source] else 1 - colour[source]] += 1
        sea.island[source] = number
        sea.queue[0] = source
        head, tail = 0, 1
        while head < tail:
            cell = sea.queue[head]
            head += 1
            for direction in range(4):
                if not sea.steps[cell] >> direction & 1:
                    continue
                after = cell + sea.offsets[direction]
                if sea.island[after] == NO_ISLAND and (chosen[cell] or chosen[after]):
                    sea.island[after] = number
                    sea.queue[tail] = after
                    tail += 1
    return islands[0], islands[1]


@kernel
def spanning_weight(sea: Sea, islands: int) -> tuple[int, int]:
    """Return the weight of a minimum spanning tree over islands, and of its heaviest edge.

    Weights are distances in steps through cells of no island. It is enough to look at
    neighbours in the Voronoi diagram (Mehlhorn, "A faster approximation algorithm for
    the Steiner problem in graphs", 1988); met in the order of their weight (Kruskal).
    """
    tail = _spread(sea)
    parent = np.arange(islands)
    total, heaviest, head = 0, 0, 0
    while head < tail:
        # All cells that are ``ring`` steps away: first the steps within the ring.
        ring, begin = sea.away[sea.queue[head]], head
        while head < tail and sea.away[sea.queue[head]] == ring:
            head += 1
        for further in range(2):
            weight = 2 * ring + 1 + further
            for index in range(begin, head):
                joined = _join(sea, parent, sea.queue[index], ring + further)
                if joined:
                    total += joined * weight
                    heaviest = max(heaviest, weight)
    return total, heaviest


@kernel
def measure_from(sea: Sea, source: int) -> None:
    """Write into ``away`` how many steps each cell is from ``source``; islands are forgotten."""
    for cell in sea.cells:
        sea.island[cell] = NO_ISLAND
    sea.island[source] = 0
    _spread(sea)


@kernel
def _spread(sea: Sea) -> int:
    """Give every cell its nearest island; return how many cells the queue holds, in order."""
    tail = 0
    for cell in sea.cells:
        if sea.island[cell] != NO_ISLAND:
            sea.away[cell] = 0
            sea.queue[tail] = cell
            tail += 1
    head = 0
    while head < tail:
        cell = sea.queue[head]
        head += 1
        for direction in range(4):
            if sea.steps[cell] >> direction & 1:
                after = cell + sea.offsets[direction]
                if sea.island[after] == NO_ISLAND:
                    sea.island[after] = sea.island[cell]
                    sea.away[after] = sea.away[cell] + 1
                    sea.queue[tail] = after
                    tail += 1
    return tail


@kernel
def _join(sea: Sea, parent: NDArray[np.int64], cell: int, away: int) -> int:
    """Join the islands of ``cell`` and of neighbours ``away`` from theirs; return how many."""
    joined = 0
    for direction in range(4):
        if sea.steps[cell] >> direction & 1:
            after = cell + sea.offsets[direction]
            if sea.away[after] == away and sea.island[after] != sea.island[cell]:
                one, other = _root(parent, sea.island[cell]), _root(parent, sea.island[after])
                if one != other:
                    parent[one] = other
                    joined += 1
    return joined


@kernel
def _root(parent: NDArray[np.int64], island: int) -> int:
    while parent[island] != island:
        parent[island] = parent[parent[island]]
        island = parent[island]
    return island
