"""The graph that walks are built on cell by cell, and the shortest walk out of a dead end.

Cells are flat indices ``row * cols + col``; n of them. A walk is an int32 array
with a separate length; if the array is too short, nothing more is written, but the length still
grows, so that the caller can retry with a longer array.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import lean_inner_kernel


class Graph(NamedTuple):
    """The graph of walks.

    Attributes:
        steps: step masks, uint8 (n,).
        wanted: uint8 (n,), 1 for the cells to visit.
        open_steps: uint8 (n + 2 * cols,), bit ``1 << direction`` where a step leads to a wanted
            cell; cell c stands at index ``c + cols``. The margins serve neighbours beyond the grid.
        offsets: int64 (4,), difference of flat index for a step in each direction.
    """

    steps: NDArray[np.uint8]
    wanted: NDArray[np.uint8]
    open_steps: NDArray[np.uint8]
    offsets: NDArray[np.int64]


class WalkScratch(NamedTuple):
    """Working memory of one thread.

    Attributes:
        open_steps: uint8 (n + 2 * cols,), as in ``Graph``, for the current walk.
        seen: int32 (n,), number of the last search that reached the cell.
        came_from: int8 (n,), direction by which it was reached.
        queue: int32 (n,).
        searches: int32 (1,), number of searches.
        weights: float64 (1, 4), weight of each direction.
    """

    open_steps: NDArray[np.uint8]
    seen: NDArray[np.int32]
    came_from: NDArray[np.int8]
    queue: NDArray[np.int32]
    searches: NDArray[np.int32]
    weights: NDArray[np.float64]


@lean_inner_kernel
def begin(graph: Graph, scratch: WalkScratch, start: int) -> int:
    """Open all wanted cells but the start; return their number."""
    for index in range(graph.open_steps.size):
        scratch.open_steps[index] = graph.open_steps[index]
    close(graph, scratch, start)
    wanted = 0
    for cell in range(graph.wanted.size):
        wanted += graph.wanted[cell]
    return int(wanted - graph.wanted[start])


@lean_inner_kernel
def close(graph: Graph, scratch: WalkScratch, cell: int) -> None:
    """Mark ``cell`` as visited: steps to it no longer lead to an open cell."""
    at = cell + graph.offsets[1]
    for direction in range(4):
        scratch.open_steps[at + graph.offsets[direction]] &= 255 ^ (1 << ((direction + 2) & 3))


@lean_inner_kernel
def open_steps_of(graph: Graph, scratch: WalkScratch, cell: int) -> int:
    """Return the mask of steps from ``cell`` to open cells."""
    return int(scratch.open_steps[cell + graph.offsets[1]])


@lean_inner_kernel
def _find(graph: Graph, scratch: WalkScratch, here: int, goal: int) -> int:
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


@lean_inner_kernel
def append_way(
    graph: Graph, scratch: WalkScratch, walk: NDArray[np.int32], length: int, here: int, goal: int
) -> tuple[int, int]:
    """Append a shortest walk from ``here`` to ``goal``, or with goal -1 to the nearest open cell.

    Returns:
        The walk's new length and its last cell, entered by step ``scratch.came_from[cell]``.
    """
    goal = _find(graph, scratch, here, goal)
    distance, cell = 0, goal
    while cell != here:
        cell -= graph.offsets[scratch.came_from[cell]]
        distance += 1
    cell = goal
    for index in range(length + distance - 1, length - 1, -1):
        if index < walk.size:
            walk[index] = cell
        cell -= graph.offsets[scratch.came_from[cell]]
    return length + distance, goal
