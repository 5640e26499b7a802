"""Walks by fixed rules: sweeps, and spanning-tree coverage on any grid.

The two sweeps are those that Carr and Wang (2022) ran as Spiral-STC and ZigZag: a spiral keeps
turning to one side; a zigzag tries the same directions in the same order at every cell. Both leave
a dead end by the shortest way to the nearest open cell. Neither is the spanning-tree construction
of Gabriely and Rimon.

Spanning-tree coverage, source: Gabriely and Rimon, "Spanning-tree based coverage of
continuous areas by a mobile robot", 2001. The area is cut into blocks of 2 x 2 cells, a
tree spans the blocks, and the walk goes around the tree: along a cycle that visits every
cell once where all blocks are whole.

Deviation, for incomplete blocks: a node of the tree is a connected part of a
block. Each node begins with a closed walk of its own, the cycle of a whole
block or a walk there and back through the cells of a part. A tree edge joins
two closed walks into one: if both run along the common side, one copy of
their step on each side is replaced by the two steps across, at no cost;
otherwise a single step across is walked there and back. All steps, each counted
as often as it is walked, form an even connected multigraph, and any Eulerian
circuit of it is the walk.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels import EAST, NORTH, SOUTH, WEST
from fasaco_edge.kernels.ants.graph import (
    Graph,
    WalkScratch,
    append_way,
    begin,
    close,
    open_steps_of,
)
from fasaco_edge.kernels.jit import as_value, inner_kernel, kernel, lean_kernel


@lean_kernel
def sweep(
    graph: Graph,
    scratch: WalkScratch,
    start: int,
    order: tuple[int, int, int, int],
    turns_along: bool,
    end: int,
    walk: NDArray[np.int32],
) -> int:
    """Walk over all wanted cells; return the walk's whole length.

    Args:
        graph: where to walk; all wanted cells, and the end, can be reached from the start.
        scratch: working memory.
        start: the cell to start from.
        order: directions in the order they are tried.
        turns_along: whether the directions are relative to the heading, which is east at first.
        end: the cell to end in, -1 for anywhere.
        walk: out, int32 (capacity,); a longer walk is cut.
    """
    remaining = begin(graph, scratch, start)
    walk[0] = start
    here, length, heading = start, as_value(1), as_value(0)
    while remaining > 0:
        mask = open_steps_of(graph, scratch, here)
        if mask == 0:
            length, here = append_way(graph, scratch, walk, length, here, as_value(-1))
            heading = int(scratch.came_from[here])
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
        length, _ = append_way(graph, scratch, walk, length, here, end)
    return length


NO_NODE = -1


class TreeSteps(NamedTuple):
    """The walk around the tree: flat cells ``row * cols + col``, their nodes, counts of steps.

    Attributes:
        steps: step masks, uint8 (n,).
        node: int32 (n,), number of the cell's node; NO_NODE for cells not to cover.
        times: int8 (n, 2), how often the steps east and north of the cell are walked,
            both ways together.
        offsets: int64 (4,), difference of flat index for a step in each direction.
    """

    steps: NDArray[np.uint8]
    node: NDArray[np.int32]
    times: NDArray[np.int8]
    offsets: NDArray[np.int64]


@inner_kernel
def _has_step(tree: TreeSteps, cell: int, direction: int) -> bool:
    """Return whether the step exists and leads to a cell to cover."""
    if not tree.steps[cell] >> direction & 1:
        return False
    return bool(tree.node[cell + tree.offsets[direction]] != NO_NODE)


@inner_kernel
def _add(tree: TreeSteps, cell: int, direction: int, times: int) -> None:
    """Add ``times``, which may be negative, to the count of a step from ``cell``."""
    if direction > NORTH:
        cell += tree.offsets[direction]
    tree.times[cell, direction & 1] += times


@inner_kernel
def _times(tree: TreeSteps, cell: int, direction: int) -> int:
    if direction > NORTH:
        cell += tree.offsets[direction]
    return int(tree.times[cell, direction & 1])


@inner_kernel
def _inner_directions(tree: TreeSteps, cell: int) -> tuple[int, int]:
    """Return the two directions that stay in the cell's block."""
    row, col = cell // tree.offsets[NORTH], cell % tree.offsets[NORTH]
    return (EAST if col % 2 == 0 else WEST), (NORTH if row % 2 == 0 else SOUTH)


@inner_kernel
def _grow_node(tree: TreeSteps, first: int, number: int) -> None:
    """Label the connected part of the block around cell ``first``; give it its closed walk."""
    cells = np.empty(4, np.int64)
    cells[0] = first
    tree.node[first] = number
    size, sides = 1, 0
    index = 0
    while index < size:
        here = cells[index]
        index += 1
        for direction in _inner_directions(tree, here):
            if not _has_step(tree, here, direction):
                continue
            sides += 1
            after = here + tree.offsets[direction]
            if tree.node[after] != number:
                tree.node[after] = number
                cells[size] = after
                size += 1
                _add(tree, here, direction, 2)
    if sides == 8:
        # All four sides were counted from both of their ends: the cycle takes each once.
        for index in range(4):
            here = cells[index]
            for direction in _inner_directions(tree, here):
                if direction <= NORTH:
                    tree.times[here, direction] = 1


@inner_kernel
def _join(tree: TreeSteps, here: int, direction: int) -> None:
    """Join the closed walks of two nodes across the step from ``here`` in a direction."""
    after = here + tree.offsets[direction]
    horizontal, vertical = _inner_directions(tree, here)
    along = vertical if direction % 2 == 0 else horizontal
    if _has_step(tree, here, along) and _has_step(tree, after, along):
        beside = here + tree.offsets[along]
        doubled = (
            _has_step(tree, beside, direction)
            and _times(tree, here, along) > 0
            and _times(tree, after, along) > 0
        )
        if doubled:
            _add(tree, here, along, -1)
            _add(tree, after, along, -1)
            _add(tree, here, direction, 1)
            _add(tree, beside, direction, 1)
            return
    _add(tree, here, direction, 2)


@inner_kernel
def _step_out(tree: TreeSteps, reached: NDArray[np.uint8], first: int) -> tuple[int, int]:
    """Return the first step (cell, direction) from a node to one not yet reached, or (-1, 0).

    ``first`` is one of the node's cells, ``reached`` uint8 (nodes,).
    """
    cols, number = tree.offsets[NORTH], tree.node[first]
    # The block's corner with the smallest indices, then its four cells.
    corner_row, corner_col = first // cols // 2 * 2, first % cols // 2 * 2
    for direction in range(4):
        for place in range(4):
            row, col = corner_row + place // 2, corner_col + place % 2
            here = row * cols + col
            if col >= cols or here >= tree.node.size or tree.node[here] != number:
                continue
            if not _has_step(tree, here, direction):
                continue
            if not reached[tree.node[here + tree.offsets[direction]]]:
                return here, direction
    return -1, 0


@inner_kernel
def _span(tree: TreeSteps, start: int, nodes: int) -> None:
    """Span the nodes by a tree, depth first from the node of ``start``; join their closed walks."""
    reached = np.zeros(nodes, np.uint8)
    first = np.full(nodes, -1, np.int64)
    for cell in range(tree.node.size):
        number = tree.node[cell]
        if number != NO_NODE and first[number] < 0:
            first[number] = cell
    stack = np.empty(nodes, np.int64)
    stack[0] = tree.node[start]
    reached[stack[0]] = 1
    depth = 1
    while depth:
        here, direction = _step_out(tree, reached, first[stack[depth - 1]])
        if here < 0:
            depth -= 1
            continue
        after = tree.node[here + tree.offsets[direction]]
        reached[after] = 1
        _join(tree, here, direction)
        stack[depth] = after
        depth += 1


@inner_kernel
def _circuit(tree: TreeSteps, start: int) -> NDArray[np.int32]:
    """Return an Eulerian circuit from ``start`` by Hierholzer's algorithm; uses up ``times``."""
    length = 0
    for count in tree.times.flat:
        length += int(count)
    stack = np.empty(length + 1, np.int64)
    heading = np.empty(length + 1, np.int64)
    circuit = np.empty(length + 1, np.int32)
    stack[0], heading[0] = start, EAST
    depth, done = 1, 0
    while depth:
        here = stack[depth - 1]
        moved = False
        # Left first: clockwise around the tree, if there is a choice.
        for turn in (1, 0, 3, 2):
            direction = (heading[depth - 1] + turn) & 3
            if _has_step(tree, here, direction) and _times(tree, here, direction):
                _add(tree, here, direction, -1)
                stack[depth], heading[depth] = here + tree.offsets[direction], direction
                depth += 1
                moved = True
                break
        if not moved:
            depth -= 1
            circuit[length - done] = here
            done += 1
    return circuit


@kernel
def spanning_tree_walk(
    steps: NDArray[np.uint8], to_cover: NDArray[np.uint8], start: int
) -> NDArray[np.int32]:
    """Return a closed walk over all cells to cover, flat cells int32 (m,).

    Args:
        steps: step masks, uint8 (rows, cols).
        to_cover: uint8 (rows, cols), 1 where to cover; connected, the start among them.
        start: flat cell where the walk begins and ends.
    """
    cols, size = steps.shape[1], steps.size
    # Number of cells that are to be covered and have no label yet.
    unlabelled = size
    node = np.full(size, NO_NODE, np.int32)
    for cell in range(size):
        if to_cover[cell // cols, cell % cols] == 1:
            node[cell] = unlabelled
    offsets = np.array([1, cols, -1, -cols], np.int64)
    tree = TreeSteps(steps.ravel(), node, np.zeros((size, 2), np.int8), offsets)
    nodes = as_value(0)
    for cell in range(size):
        if node[cell] == unlabelled:
            _grow_node(tree, cell, nodes)
            nodes += 1
    _span(tree, start, nodes)
    return _circuit(tree, start)
