"""Walks by a fixed rule: which neighbour comes first; from a dead end to the nearest open cell.

What the paper's authors ran as Spiral-STC and ZigZag: a spiral that keeps
turning to one side, and a sweep that tries the same directions in the same
order at every cell. Neither is Gabriely and Rimon's spanning-tree construction.
"""

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import kernel
from fasaco_edge.kernels.search import (
    Graph,
    Scratch,
    append_way,
    begin,
    close,
    find,
    open_steps_of,
)


@kernel
def sweep(
    graph: Graph,
    scratch: Scratch,
    start: int,
    order: tuple[int, int, int, int],
    turns_along: bool,
    end: int,
    walk: NDArray[np.int32],
) -> int:
    """Walk over all wanted cells; return the walk's whole length.

    Args:
        graph: where to walk; all that is wanted, and the end, can be reached from the start.
        scratch: working memory.
        start: the cell to start from.
        order: directions in the order they are tried.
        turns_along: whether the order is counted from the heading, east at first.
        end: the cell to end in, -1 for anywhere.
        walk: out, int32 (room,); a longer walk is cut.
    """
    remaining = begin(graph, scratch, start)
    walk[0] = start
    here, length, heading = start, 1, 0
    while remaining > 0:
        mask = open_steps_of(graph, scratch, here)
        if mask == 0:
            goal = find(graph, scratch, here, -1)
            length = append_way(graph, scratch, walk, length, here, goal)
            here, heading = goal, int(scratch.came_from[goal])
        else:
            first = heading if turns_along else 0
            for turn in order:
                heading = (first + turn) & 3
                if mask >> heading & 1:
                    break
            here += graph.offsets[heading]
            if length < walk.size:
                walk[length] = here
            length += 1
        close(graph, scratch, here)
        remaining -= 1
    if end >= 0 and here != end:
        find(graph, scratch, here, end)
        length = append_way(graph, scratch, walk, length, here, end)
    return length
