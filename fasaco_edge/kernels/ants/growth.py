"""Walks that grow cell by cell on a flat lattice, and the way out of their dead ends.

Cells are flat indices ``row * cols + col``; n of them. A walk is an int32 array
with a count beside it; one that outgrows its array is counted on but no longer
written, so that the caller can give it more room and ask again.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import kernel


class Graph(NamedTuple):
    """Where walks go.

    Attributes:
        steps: step masks, uint8 (n,).
        wanted: uint8 (n,), 1 where a visit is asked for.
        open_steps: uint8 (n + 2 * cols,), bit ``1 << direction`` where a step leads to a
            wanted cell; cell c stands at index ``c + cols``. The margins spare a test
            whether a neighbour exists.
        offsets: int64 (4,), difference of flat index for a step in each direction.
    """

    steps: NDArray[np.uint8]
    wanted: NDArray[np.uint8]
    open_steps: NDArray[np.uint8]
    offsets: NDArray[np.int64]


class Scratch(NamedTuple):
    """Working memory of one thread.

    Attributes:
        open_steps: uint8 (n + 2 * cols,), as in ``Graph``, for the current walk.
        seen: int32 (n,), number of the last search that reached the cell.
        came_from: int8 (n,), direction by which it was reached.
        queue: int32 (n,).
        searches: int32 (1,), how many searches there were.
        weights: float64 (1, 4), how much each direction attracts.
    """

    open_steps: NDArray[np.uint8]
    seen: NDArray[np.int32]
    came_from: NDArray[np.int8]
    queue: NDArray[np.int32]
    searches: NDArray[np.int32]
    weights: NDArray[np.float64]


@kernel
def begin(graph: Graph, scratch: Scratch, start: int) -> int:
    """Open all wanted cells but the start; return how many there are."""
    scratch.open_steps[:] = graph.open_steps
    close(graph, scratch, start)
    return int(np.sum(graph.wanted)) - int(graph.wanted[start])


@kernel
def close(graph: Graph, scratch: Scratch, cell: int) -> None:
    """Note the visit of ``cell``: no step leads to an open cell there any more."""
    at = cell + graph.offsets[1]
    for direction in range(4):
        scratch.open_steps[at + graph.offsets[direction]] &= 255 ^ (1 << ((direction + 2) & 3))


@kernel
def open_steps_of(graph: Graph, scratch: Scratch, cell: int) -> int:
    """Return the mask of steps from ``cell`` to open cells."""
    return int(scratch.open_steps[cell + graph.offsets[1]])


@kernel
def find(graph: Graph, scratch: Scratch, here: int, goal: int) -> int:
    """Search breadth first; return ``goal``, or with goal -1 the nearest open cell."""
    scratch.searches[0] += 1
    search = scratch.searches[0]
    scratch.seen[here] = search
    scratch.queue[0] = here
    head, tail = 0, 1
    while head < tail:
        cell = scratch.queue[head]
        head += 1
        to_open = open_steps_of(graph, scratch, cell) if goal < 0 else 0
        mask = graph.steps[cell]
        for direction in range(4):
            if not mask >> direction & 1:
                continue
            after = cell + graph.offsets[direction]
            if to_open >> direction & 1 or after == goal:
                scratch.came_from[after] = direction
                return int(after)
            if scratch.seen[after] != search:
                scratch.seen[after] = search
                scratch.came_from[after] = direction
                scratch.queue[tail] = after
                tail += 1
    return here


@kernel
def append_way(
    graph: Graph, scratch: Scratch, walk: NDArray[np.int32], length: int, here: int, goal: int
) -> int:
    """Append the way from ``here`` to a ``goal`` that was found; return the new length."""
    distance, cell = 0, goal
    while cell != here:
        cell -= graph.offsets[scratch.came_from[cell]]
        distance += 1
    cell = goal
    for index in range(length + distance - 1, length - 1, -1):
        if index < walk.size:
            walk[index] = cell
        cell -= graph.offsets[scratch.came_from[cell]]
    return length + distance
