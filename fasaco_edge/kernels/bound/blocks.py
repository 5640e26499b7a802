"""Biconnected blocks of a lattice, which stay connected if any one cell is removed; their islands.

Source: Hopcroft and Tarjan, "Algorithm 447: efficient algorithms for graph
manipulation", 1973, depth first without recursion. Two blocks share at most one
cell, a cut vertex; a step joins two cells of exactly one block; a block of two
cells is a bridge.

An island is a set of cells of a block, joined by steps at an independent set. A step between two
islands touches no cell of the set, so a bound that counts the steps at the set's cells does not
count it yet. This module finds the least number of such steps.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inner_kernel
from fasaco_edge.kernels.lattice.areas import root


class Blocks(NamedTuple):
    """The blocks that can be reached from a root, each after all blocks beyond it.

    Attributes:
        cells: int32, the blocks' flat cells one block after the other. The first cell of a
            block is its top, by which every walk from the root enters it.
        first: int32 (blocks + 1,), where each block begins in ``cells``.
    """

    cells: NDArray[np.int32]
    first: NDArray[np.int32]


@inner_kernel
def biconnected_blocks(steps: NDArray[np.uint8], offsets: NDArray[np.int64], root: int) -> Blocks:
    """Return the blocks reached from the flat cell ``root``; none if it has no step.

    Args:
        steps: step masks, uint8 (n,); symmetric.
        offsets: int64 (4,), difference of flat index for a step in each direction.
        root: where the search begins.
    """
    most = 1
    for mask in steps:
        most += mask != 0
    # Every cell except the root is below the top of exactly one block.
    cells, first = np.empty(2 * most, np.int32), np.empty(most + 1, np.int32)
    open_cells = np.empty(most, np.int32)
    rank, low = np.zeros(steps.size, np.int32), np.empty(steps.size, np.int32)
    tried, came_by = np.zeros(steps.size, np.uint8), np.empty(steps.size, np.uint8)
    blocks, filled, waiting, ranks = 0, 0, 0, 1
    here = root
    rank[here] = low[here] = 1
    while True:
        direction = tried[here]
        if direction < 4:
            tried[here] += 1
            if not steps[here] >> direction & 1:
                continue
            after = here + offsets[direction]
            if rank[after]:
                low[here] = min(low[here], rank[after])
                continue
            ranks += 1
            rank[after] = low[after] = ranks
            came_by[after] = direction
            open_cells[waiting] = after
            waiting += 1
            here = after
            continue
        if here == root:
            break
        before = here - offsets[came_by[here]]
        if low[here] < rank[before]:
            low[before] = min(low[before], low[here])
        else:
            # No cell from here on reaches above ``before``: a block ends there.
            first[blocks] = filled
            blocks += 1
            cells[filled] = before
            filled += 1
            cell = -1
            while cell != here:
                waiting -= 1
                cell = open_cells[waiting]
                cells[filled] = cell
                filled += 1
        here = before
    first[blocks] = filled
    return Blocks(cells[:filled], first[: blocks + 1])


@inner_kernel
def wanted_first(cells: NDArray[np.int32], wanted: NDArray[np.uint8]) -> int:
    """Move the wanted cells of a block to the front, after its top; return their number.

    Args:
        cells: int32 (k,), a block's cells, the top first; the top always counts as wanted.
        wanted: uint8 (n,), 1 for wanted cells.
    """
    count = 1
    for index in range(1, cells.size):
        if wanted[cells[index]]:
            cells[index], cells[count] = cells[count], cells[index]
            count += 1
    return count


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


@inner_kernel
def find_islands(sea: Sea, chosen: NDArray[np.uint8], colour: NDArray[np.uint8]) -> tuple[int, int]:
    """Number the islands with a wanted cell; return the number of islands of each colour.

    An island's colour is that of its chosen cells. They agree: a step from a chosen cell leads to a
    cell of the other colour that is not chosen, and a step from there that belongs to the island
    leads to a chosen cell again. A wanted cell that is not chosen and has no chosen neighbour is an
    island by itself, and counts with the opposite colour. So in an island all cells of its colour
    are chosen. Two islands of one colour are never one step apart: one end of the step would have
    that colour, so it would be chosen, and would join them.

    Args:
        sea: the block; ``island`` is written for its cells.
        chosen: uint8 (n,), the independent set; all its cells are wanted.
        colour: uint8 (n,), 0 or 1; neighbours differ.
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


@inner_kernel
def spanning_weight(sea: Sea, islands: int) -> tuple[int, int]:
    """Return the weight of a minimum spanning tree over islands, and of its heaviest edge.

    Weights are distances in steps through cells of no island. It is enough to look at neighbours in
    the Voronoi diagram (Mehlhorn, "A faster approximation algorithm for the Steiner problem in
    graphs", 1988), in the order of their weight (Kruskal).
    """
    tail = _spread(sea)
    parent = np.arange(islands)
    total, heaviest, head = 0, 0, 0
    while head < tail:
        # Cells at a distance of ``ring`` steps: first steps within the ring, then outward.
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


@inner_kernel
def measure_from(sea: Sea, source: int) -> None:
    """Write each cell's distance from ``source`` [steps] into ``away``, and clear the islands."""
    for cell in sea.cells:
        sea.island[cell] = NO_ISLAND
    sea.island[source] = 0
    _spread(sea)


@inner_kernel
def _spread(sea: Sea) -> int:
    """Assign each cell to its nearest island; return the number of cells in the queue, in order."""
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


@inner_kernel
def _join(sea: Sea, parent: NDArray[np.int64], cell: int, away: int) -> int:
    """Join the islands of ``cell`` and of neighbours at ``away`` steps; return how many joins."""
    joined = 0
    for direction in range(4):
        if sea.steps[cell] >> direction & 1:
            after = cell + sea.offsets[direction]
            if sea.away[after] == away and sea.island[after] != sea.island[cell]:
                one, other = root(parent, sea.island[cell]), root(parent, sea.island[after])
                if one != other:
                    parent[one] = other
                    joined += 1
    return joined
