"""Large matchings of a bipartite lattice, and the independent sets derived from them.

A lattice is bipartite: every step leads from one colour of a chessboard to the
other. Sources: Karp and Sipser, "Maximum matchings in sparse random graphs",
1981, for a first matching; breadth-first augmenting paths, where the cells of a
search that fails are never searched again (a Hungarian tree, Kuhn 1955); Koenig
1931 for the independent set.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inner_kernel

SINGLE = -1
DEAD = -1


class Bipartite(NamedTuple):
    """Some cells of a lattice of n cells, and the steps between them.

    Attributes:
        cells: int32 (k,), flat cells.
        links: uint8 (n,), mask of the steps from each of these cells to another of them.
        colour: uint8 (n,), 0 or 1; linked cells differ.
        offsets: int64 (4,), difference of flat index for a step in each direction.
    """

    cells: NDArray[np.int32]
    links: NDArray[np.uint8]
    colour: NDArray[np.uint8]
    offsets: NDArray[np.int64]


class Pairing(NamedTuple):
    """A matching, and the memory to find it in.

    Attributes:
        mate: int32 (n,), the cell each cell is matched with, or SINGLE.
        queue: int32 (n,).
        seen: int32 (n,), number of the last search that reached the cell, or DEAD.
        came_by: uint8 (n,), direction by which that search reached it.
        degree: uint8 (n,), number of the cell's links to cells still single.
    """

    mate: NDArray[np.int32]
    queue: NDArray[np.int32]
    seen: NDArray[np.int32]
    came_by: NDArray[np.uint8]
    degree: NDArray[np.uint8]


@inner_kernel
def pairing_for(size: int) -> Pairing:
    """Return memory for lattices of ``size`` cells."""
    return Pairing(
        np.empty(size, np.int32),
        np.empty(size, np.int32),
        np.empty(size, np.int32),
        np.empty(size, np.uint8),
        np.empty(size, np.uint8),
    )


@inner_kernel
def match(graph: Bipartite, pairing: Pairing, budget: int) -> None:
    """Find a maximum matching, or a large one if that takes long.

    Args:
        graph: the cells to match.
        pairing: out; only the entries of the graph's cells are changed.
        budget: begin no more searches after this many cells were searched.
    """
    for cell in graph.cells:
        pairing.mate[cell] = SINGLE
        pairing.seen[cell] = 0
    _match_lone_cells_first(graph, pairing)
    single = np.zeros(2, np.int64)
    for cell in graph.cells:
        if pairing.mate[cell] == SINGLE:
            single[graph.colour[cell]] += 1
    # Each augmenting path has an end of each colour: search from the colour with fewer cells.
    side = 0 if single[0] <= single[1] else 1
    search = 0
    for cell in graph.cells:
        if pairing.mate[cell] == SINGLE and graph.colour[cell] == side:
            if budget <= 0:
                return
            search += 1
            budget -= _augment(graph, pairing, cell, search)


@inner_kernel
def _match_lone_cells_first(graph: Bipartite, pairing: Pairing) -> None:
    """Match cells with one partner left, which loses nothing; else the next cell in order."""
    mate, lone, degree = pairing.mate, pairing.queue, pairing.degree
    waiting = 0
    for cell in graph.cells:
        mask = graph.links[cell]
        degree[cell] = (mask & 1) + (mask >> 1 & 1) + (mask >> 2 & 1) + (mask >> 3)
        if degree[cell] == 1:
            lone[waiting] = cell
            waiting += 1
    for cell in graph.cells:
        while waiting:
            waiting -= 1
            if mate[lone[waiting]] == SINGLE:
                waiting = _match_with_rarest(graph, pairing, lone[waiting], waiting)
        if mate[cell] == SINGLE:
            waiting = _match_with_rarest(graph, pairing, cell, waiting)


@inner_kernel
def _match_with_rarest(graph: Bipartite, pairing: Pairing, cell: int, waiting: int) -> int:
    """Match ``cell`` with the single neighbour of least degree; return the length of the queue."""
    mate, degree = pairing.mate, pairing.degree
    partner, least = SINGLE, 5
    for direction in range(4):
        if graph.links[cell] >> direction & 1:
            after = cell + graph.offsets[direction]
            if mate[after] == SINGLE and degree[after] < least:
                partner, least = after, degree[after]
    if partner == SINGLE:
        return waiting
    mate[cell], mate[partner] = partner, cell
    for end in range(2):
        here = partner if end else cell
        for direction in range(4):
            if graph.links[here] >> direction & 1:
                after = here + graph.offsets[direction]
                degree[after] -= 1
                if degree[after] == 1 and mate[after] == SINGLE:
                    pairing.queue[waiting] = after
                    waiting += 1
    return waiting


@inner_kernel
def _augment(graph: Bipartite, pairing: Pairing, source: int, search: int) -> int:
    """Search an augmenting path from ``source`` and switch it; return the cells searched.

    If there is none, no later path can run through a cell of this search.
    """
    mate, queue, seen = pairing.mate, pairing.queue, pairing.seen
    queue[0] = source
    head, tail = 0, 1
    while head < tail:
        cell = queue[head]
        head += 1
        for direction in range(4):
            if not graph.links[cell] >> direction & 1:
                continue
            after = cell + graph.offsets[direction]
            if seen[after] == search or seen[after] == DEAD:
                continue
            seen[after] = search
            pairing.came_by[after] = direction
            if mate[after] == SINGLE:
                _switch(graph, pairing, source, after)
                return head
            queue[tail] = mate[after]
            tail += 1
    for index in range(1, tail):
        seen[mate[queue[index]]] = DEAD
    return head


@inner_kernel
def _switch(graph: Bipartite, pairing: Pairing, source: int, end: int) -> None:
    """Exchange matched and unmatched links on the path from ``source`` to ``end``."""
    mate, here = pairing.mate, end
    while True:
        before = here - graph.offsets[pairing.came_by[here]]
        released = mate[before]
        mate[here], mate[before] = before, here
        if before == source:
            return
        here = released


@inner_kernel
def choose_independent(
    graph: Bipartite, pairing: Pairing, side: int, first: int, chosen: NDArray[np.uint8]
) -> int:
    """Choose an independent set; return its size.

    Chosen of colour ``side`` are the single cells, ``first``, and the mates of displaced cells.
    Displaced are the cells of the other colour beside a chosen one; all its other cells are chosen.
    So the set is independent whatever the matching is. It is as large as any (Koenig) if the
    matching is maximum and no single cell can be reached from ``first``.

    Args:
        graph: the cells and links.
        pairing: a matching of them.
        side: colour 0 or 1.
        first: a cell of colour ``side`` that must be chosen, or -1.
        chosen: out, uint8 (n,), 1 for the set's cells, 0 for other cells of the graph.
    """
    queue, tail, size = pairing.queue, 0, 0
    for cell in graph.cells:
        chosen[cell] = 0
        if graph.colour[cell] != side:
            chosen[cell] = 1
            size += 1
        elif cell == first or pairing.mate[cell] == SINGLE:
            chosen[cell] = 1
            size += 1
            queue[tail] = cell
            tail += 1
    head = 0
    while head < tail:
        cell = queue[head]
        head += 1
        for direction in range(4):
            if not graph.links[cell] >> direction & 1:
                continue
            after = cell + graph.offsets[direction]
            if not chosen[after]:
                continue
            chosen[after] = 0
            size -= 1
            mate = pairing.mate[after]
            if mate != SINGLE and not chosen[mate]:
                chosen[mate] = 1
                size += 1
                queue[tail] = mate
                tail += 1
    return size
