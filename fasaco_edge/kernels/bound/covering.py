"""A lower bound on the steps of a covering walk.

A walk from ``start`` to ``end`` visits all required cells; start and end count as
required. Each bound below counts some steps that every such walk makes.

*Blocks.* Restrict the walk to one biconnected block B. The walk leaves B by a cut vertex and
returns by the same vertex, so without its excursions it is a walk in B. That walk begins in a, the
start or the cut vertex towards the start, and ends in b, the end or the cut vertex towards the end.
It visits the wanted cells of B: the required cells, and cut vertices with required cells beyond
them. It is open, a != b, only in blocks between start and end. A block whose only wanted cell
is a counts 0. No step lies in two blocks, so the bounds of the blocks add up.

*Independent set.* Let I be wanted cells of B, no two of them neighbours. A step has
at most one end in I, so visits to I share no steps. Each visit has a step before it and one
after it, except the first and the last cell of an open walk. So a closed walk makes
2 |I| steps at I, an open one 2 |I| - [a in I] - [b in I]. Any I is valid: the matching from
which it is derived only determines its size.

*Islands.* Cells joined by steps at I are an island; only islands with wanted cells
count. If there are k > 1, the walk makes further steps between them, none of them at I:
(1) Islands have two colours, and no step joins two of one colour (see ``blocks.find_islands``).
A walk enters and leaves each of the m islands of a colour, which takes 2 m steps, as no step serves
two of these islands. Each end of the walk in one of them saves a step; but if both ends are in the
same island, the walk also leaves that island and returns: 2 m.
(2) The walk's paths from island to island connect all islands, so they weigh no less than a minimum
spanning tree. If the walk is closed, or ends in the island where it began, it crosses every cut at
least twice. Take the cut at the tree's heaviest edge, which is the lightest edge across that cut:
without one of its crossings the other paths still connect the islands, so all paths together weigh
at least tree + heaviest.

*Return.* An open walk and a shortest path from b to a form a closed walk: its bound minus
the distance is a bound.

*Parity.* Each step changes the colour on the chessboard: the colours of a and b determine
whether the number of steps is even.

*End anywhere.* A shortest walk ends in a required cell, the last one it visits. So the bound is the
least of the bounds over all ends: all blocks closed, minus the largest saving by open blocks
between start and end, found from the leaves of the block tree up.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.bound.blocks import (
    Sea,
    biconnected_blocks,
    find_islands,
    measure_from,
    spanning_weight,
    wanted_first,
)
from fasaco_edge.kernels.bound.matching import (
    Bipartite,
    Pairing,
    choose_independent,
    match,
    pairing_for,
)
from fasaco_edge.kernels.jit import inner_kernel, kernel

NO_END = -(2**30)
# Search budget for a larger matching [cells]. On maps of a million cells with scattered obstacles a
# larger budget improved no bound; without a search, bounds were up to four steps lower.
SEARCHED_PER_CELL, SEARCHED_AT_LEAST = 10, 10_000


class BlockBounds(NamedTuple):
    """Bounds of the blocks of a lattice of n cells, and the lattice.

    Attributes:
        steps: step masks, uint8 (n,).
        offsets: int64 (4,), difference of flat index for a step in each direction.
        colour: uint8 (n,), 0 or 1 as on a chessboard.
        wanted: uint8 (n,), 1 for required cells and cut vertices on the way to them.
        block: int32 (n,), number of the last block handled with the cell.
        inside: uint8 (n,), step masks inside that block.
        links: uint8 (n,), step masks inside that block to wanted cells alone.
        pairing: a matching of the block's wanted cells.
        chosen: uint8 (n,), an independent set of these wanted cells.
        island, away: int32 (n,), see ``Sea``.
        open_steps: int32 (n,), bound of the walk over that block which ends in the cell.
    """

    steps: NDArray[np.uint8]
    offsets: NDArray[np.int64]
    colour: NDArray[np.uint8]
    wanted: NDArray[np.uint8]
    block: NDArray[np.int32]
    inside: NDArray[np.uint8]
    links: NDArray[np.uint8]
    pairing: Pairing
    chosen: NDArray[np.uint8]
    island: NDArray[np.int32]
    away: NDArray[np.int32]
    open_steps: NDArray[np.int32]


@kernel
def covering_bound(
    steps: NDArray[np.uint8], required: NDArray[np.uint8], start: int, end: int
) -> int:
    """Return a lower bound on the steps of a walk over all required cells.

    Args:
        steps: step masks, uint8 (rows, cols); symmetric.
        required: uint8 (rows, cols), 1 for cells to visit; cells that cannot be reached from the
            start are ignored.
        start: first flat cell ``row * cols + col`` of the walk.
        end: its last flat cell, reachable; -1 for anywhere.
    """
    bounds = _bounds_for(steps, required)
    bounds.wanted[start] = 1
    # Steps that a walk saves if it ends in the cell or beyond it instead of returning to the cell.
    saved = np.full(steps.size, NO_END, np.int32)
    if end < 0:
        for cell in range(steps.size):
            if bounds.wanted[cell]:
                saved[cell] = 0
    else:
        bounds.wanted[end] = 1
        saved[end] = 0
    blocks = biconnected_blocks(bounds.steps, bounds.offsets, start)
    closed = 0
    for number in range(blocks.first.size - 1):
        cells = blocks.cells[blocks.first[number] : blocks.first[number + 1]]
        count = wanted_first(cells, bounds.wanted)
        if count == 1:
            continue
        top = cells[0]
        bounds.wanted[top] = 1
        around = _bound_block(bounds, cells, count, number + 1)
        closed += around
        for cell in cells[1:count]:
            if saved[cell] > NO_END:
                saved[top] = max(saved[top], saved[cell] + around - bounds.open_steps[cell])
    return int(closed - saved[start])


@inner_kernel
def _bounds_for(steps: NDArray[np.uint8], required: NDArray[np.uint8]) -> BlockBounds:
    rows, cols = steps.shape
    size = rows * cols
    colour = np.empty((rows, cols), np.uint8)
    for row in range(rows):
        for col in range(cols):
            colour[row, col] = (row + col) & 1
    return BlockBounds(
        steps=steps.ravel(),
        offsets=np.array([1, cols, -1, -cols], np.int64),
        colour=colour.ravel(),
        wanted=required.ravel().copy(),
        block=np.zeros(size, np.int32),
        inside=np.empty(size, np.uint8),
        links=np.empty(size, np.uint8),
        pairing=pairing_for(size),
        chosen=np.zeros(size, np.uint8),
        island=np.empty(size, np.int32),
        away=np.empty(size, np.int32),
        open_steps=np.empty(size, np.int32),
    )


@inner_kernel
def _bound_block(bounds: BlockBounds, cells: NDArray[np.int32], count: int, number: int) -> int:
    """Return the bound of a closed walk over a block; write the bounds of open walks.

    Args:
        bounds: the lattice; ``open_steps`` is written for all wanted cells but the top.
        cells: int32, the block's cells: the top, the other wanted ones, the rest.
        count: how many of them are wanted, the top among them.
        number: number of the block, from 1.
    """
    if cells.size == 2:
        bounds.open_steps[cells[1]] = 1
        return 2
    _cut_out(bounds, cells, number)
    pairing, top = bounds.pairing, cells[0]
    graph = Bipartite(cells[:count], bounds.links, bounds.colour, bounds.offsets)
    sea = Sea(
        cells, count, bounds.inside, bounds.offsets, bounds.island, bounds.away, pairing.queue
    )
    match(graph, pairing, SEARCHED_AT_LEAST + SEARCHED_PER_CELL * count)
    for cell in cells[1:count]:
        bounds.open_steps[cell] = 0
    same = 1 if bounds.colour[top] else 0
    closed, first = 0, -1
    for attempt in range(3):
        # Each set is as large as any. The first leaves out as few cells of the top's colour as
        # possible, the second as many; so it leaves out the top if any largest set does. Then the
        # third leaves out the top, and as many cells of the other colour as possible.
        if attempt == 2:
            if bounds.chosen[top]:
                break
            first = pairing.mate[top]
        side = same if attempt == 1 else 1 - same
        closed = max(closed, _bound_by_set(bounds, graph, sea, side, first))
    if count < cells.size:
        measure_from(sea, top)
        for cell in cells[1:count]:
            steps = closed - sea.away[cell]
            bounds.open_steps[cell] = max(bounds.open_steps[cell], steps)
    return closed


@inner_kernel
def _cut_out(bounds: BlockBounds, cells: NDArray[np.int32], number: int) -> None:
    """Write the step masks inside a block, and to its wanted cells."""
    for cell in cells:
        bounds.block[cell] = number
    for cell in cells:
        inside, links = 0, 0
        for direction in range(4):
            if bounds.steps[cell] >> direction & 1:
                after = cell + bounds.offsets[direction]
                if bounds.block[after] == number:
                    inside |= 1 << direction
                    if bounds.wanted[after]:
                        links |= 1 << direction
        bounds.inside[cell], bounds.links[cell] = inside, links


@inner_kernel
def _bound_by_set(bounds: BlockBounds, graph: Bipartite, sea: Sea, side: int, first: int) -> int:
    """Bound walks over a block, as ``_bound_block`` does, by one independent set."""
    colour, chosen, island = bounds.colour, bounds.chosen, sea.island
    size = choose_independent(graph, bounds.pairing, side, first, chosen)
    black, white = find_islands(sea, chosen, colour)
    tree, round_trip = 0, 0
    if black + white > 1:
        if sea.wanted < sea.cells.size:
            tree, heaviest = spanning_weight(sea, black + white)
            round_trip = tree + heaviest
        round_trip = max(round_trip, 2 * black, 2 * white)
    top = graph.cells[0]
    top_colour, top_chosen = int(colour[top]), int(chosen[top])
    for cell in graph.cells[1:]:
        end_colour, end_chosen = int(colour[cell]), int(chosen[cell])
        between = round_trip
        if island[cell] != island[top]:
            ends_white = (top_colour ^ top_chosen ^ 1) + (end_colour ^ end_chosen ^ 1)
            between = max(tree, 2 * white - ends_white, 2 * black - (2 - ends_white))
        steps = 2 * size - top_chosen - end_chosen + between
        steps += (steps + top_colour + end_colour) & 1
        bounds.open_steps[cell] = max(bounds.open_steps[cell], steps)
    closed = 2 * size + round_trip
    return int(closed + (closed & 1))
