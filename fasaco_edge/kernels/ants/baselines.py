"""Walks by a fixed rule: which neighbour comes first; from a dead end to the nearest open cell.

What the paper's authors ran as Spiral-STC and ZigZag: a spiral that keeps
turning to one side, and a sweep that tries the same directions in the same
order at every cell. Neither is Gabriely and Rimon's spanning-tree construction.

Spanning-tree coverage on any grid.

Source: Gabriely and Rimon, "Spanning-tree based coverage of continuous areas by
a mobile robot", 2001. The area is cut into blocks of 2 x 2 cells, a tree spans
the blocks, and the walk goes around the tree: along a cycle that visits every
cell once where all blocks are whole.

Deviation, for blocks that are not: a node of the tree is a connected part of a
block. Each node begins with a closed walk of its own, the cycle of a whole
block or the way there and back through the cells of a part. A tree edge joins
two closed walks into one: where both run along the common side, one copy of
that step on either side is exchanged for the two steps across, at no cost;
elsewhere the one step across is walked there and back. All steps together, each
as often as it is walked, are an even connected multigraph, and any Eulerian
circuit of it is the walk.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.ants.growth import (
    Graph,
    Scratch,
    append_way,
    begin,
    close,
    find,
    open_steps_of,
)
from fasaco_edge.kernels.cells import COL_STEP, EAST, NORTH, ROW_STEP, WEST
from fasaco_edge.kernels.jit import kernel


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


NO_NODE = -1


class Blocks(NamedTuple):
    """Cells (rows, cols), their nodes, and how often each step is walked.

    Attributes:
        steps: step masks, uint8.
        node: int32, number of the cell's node; NO_NODE where nothing is to be covered.
        times: int8 (rows, cols, 2), how often the steps east and north of the cell are
            walked, both ways together.
    """

    steps: NDArray[np.uint8]
    node: NDArray[np.int32]
    times: NDArray[np.int8]


@kernel
def _has_step(blocks: Blocks, row: int, col: int, direction: int) -> bool:
    """Tell whether the step exists and stays on ground to be covered."""
    if not blocks.steps[row, col] >> direction & 1:
        return False
    return bool(blocks.node[row + ROW_STEP[direction], col + COL_STEP[direction]] != NO_NODE)


@kernel
def _add(blocks: Blocks, row: int, col: int, direction: int, times: int) -> None:
    """Walk a step ``times`` more often (or less, below 0), whichever way it is named."""
    if direction > NORTH:
        row, col = row + ROW_STEP[direction], col + COL_STEP[direction]
    blocks.times[row, col, direction & 1] += times


@kernel
def _times(blocks: Blocks, row: int, col: int, direction: int) -> int:
    if direction > NORTH:
        row, col = row + ROW_STEP[direction], col + COL_STEP[direction]
    return int(blocks.times[row, col, direction & 1])


@kernel
def _inner_directions(row: int, col: int) -> tuple[int, int]:
    """Return the two directions that stay in the cell's block."""
    return (EAST if col % 2 == 0 else WEST), (NORTH if row % 2 == 0 else 3)


@kernel
def _grow_node(blocks: Blocks, row: int, col: int, number: int) -> None:
    """Label the connected part of the block around (row, col); give it its closed walk."""
    cells = np.empty((4, 2), np.int64)
    cells[0, 0], cells[0, 1] = row, col
    blocks.node[row, col] = number
    size, sides = 1, 0
    index = 0
    while index < size:
        here_row, here_col = cells[index, 0], cells[index, 1]
        index += 1
        for direction in _inner_directions(here_row, here_col):
            if not _has_step(blocks, here_row, here_col, direction):
                continue
            sides += 1
            after_row = here_row + ROW_STEP[direction]
            after_col = here_col + COL_STEP[direction]
            if blocks.node[after_row, after_col] != number:
                blocks.node[after_row, after_col] = number
                cells[size, 0], cells[size, 1] = after_row, after_col
                size += 1
                _add(blocks, here_row, here_col, direction, 2)
    if sides == 8:
        # All four sides, seen from both ends: the cycle takes each once.
        for index in range(4):
            here_row, here_col = cells[index, 0], cells[index, 1]
            for direction in _inner_directions(here_row, here_col):
                if direction <= NORTH:
                    blocks.times[here_row, here_col, direction] = 1


@kernel
def _join(blocks: Blocks, row: int, col: int, direction: int) -> None:
    """Join the closed walks of two nodes across the step (row, col) -> direction."""
    after_row, after_col = row + ROW_STEP[direction], col + COL_STEP[direction]
    horizontal, vertical = _inner_directions(row, col)
    along = vertical if direction % 2 == 0 else horizontal
    if _has_step(blocks, row, col, along) and _has_step(blocks, after_row, after_col, along):
        beside_row, beside_col = row + ROW_STEP[along], col + COL_STEP[along]
        doubled = (
            _has_step(blocks, beside_row, beside_col, direction)
            and _times(blocks, row, col, along) > 0
            and _times(blocks, after_row, after_col, along) > 0
        )
        if doubled:
            _add(blocks, row, col, along, -1)
            _add(blocks, after_row, after_col, along, -1)
            _add(blocks, row, col, direction, 1)
            _add(blocks, beside_row, beside_col, direction, 1)
            return
    _add(blocks, row, col, direction, 2)


@kernel
def _span(blocks: Blocks, row: int, col: int, nodes: int) -> None:
    """Span the nodes by a tree, depth first from the node of (row, col), and join along it."""
    rows, cols = blocks.node.shape
    reached = np.zeros(nodes, np.uint8)
    first = np.full((nodes, 2), -1, np.int64)
    for cell_row in range(rows):
        for cell_col in range(cols):
            number = blocks.node[cell_row, cell_col]
            if number != NO_NODE and first[number, 0] < 0:
                first[number, 0], first[number, 1] = cell_row, cell_col
    stack = np.empty(nodes, np.int64)
    stack[0] = blocks.node[row, col]
    reached[stack[0]] = 1
    depth = 1
    while depth:
        number = stack[depth - 1]
        found = False
        # The block's corner with the smallest indices, then its four cells.
        corner_row, corner_col = first[number, 0] // 2 * 2, first[number, 1] // 2 * 2
        for direction in range(4):
            for place in range(4):
                here_row, here_col = corner_row + place // 2, corner_col + place % 2
                if here_row >= rows or here_col >= cols:
                    continue
                if blocks.node[here_row, here_col] != number:
                    continue
                if not _has_step(blocks, here_row, here_col, direction):
                    continue
                after_row = here_row + ROW_STEP[direction]
                after_col = here_col + COL_STEP[direction]
                after = blocks.node[after_row, after_col]
                if reached[after]:
                    continue
                reached[after] = 1
                _join(blocks, here_row, here_col, direction)
                stack[depth] = after
                depth += 1
                found = True
                break
            if found:
                break
        if not found:
            depth -= 1


@kernel
def _circuit(blocks: Blocks, row: int, col: int) -> NDArray[np.int32]:
    """Return an Eulerian circuit from (row, col) by Hierholzer's algorithm; uses up ``times``."""
    length = 0
    for count in blocks.times.flat:
        length += int(count)
    cols = blocks.node.shape[1]
    stack = np.empty(length + 1, np.int64)
    heading = np.empty(length + 1, np.int64)
    circuit = np.empty((length + 1, 2), np.int32)
    stack[0], heading[0] = row * cols + col, EAST
    depth, done = 1, 0
    while depth:
        here_row, here_col = stack[depth - 1] // cols, stack[depth - 1] % cols
        moved = False
        # To the left first: clockwise around the tree, where there is a choice.
        for turn in (1, 0, 3, 2):
            direction = (heading[depth - 1] + turn) & 3
            if _has_step(blocks, here_row, here_col, direction) and _times(
                blocks, here_row, here_col, direction
            ):
                _add(blocks, here_row, here_col, direction, -1)
                after_row = here_row + ROW_STEP[direction]
                after_col = here_col + COL_STEP[direction]
                stack[depth], heading[depth] = after_row * cols + after_col, direction
                depth += 1
                moved = True
                break
        if not moved:
            depth -= 1
            circuit[length - done, 0], circuit[length - done, 1] = here_row, here_col
            done += 1
    return circuit


@kernel
def spanning_tree_walk(
    steps: NDArray[np.uint8], to_cover: NDArray[np.uint8], row: int, col: int
) -> NDArray[np.int32]:
    """Return a closed walk over all cells to cover, int32 (n, 2).

    Args:
        steps: step masks, uint8 (rows, cols).
        to_cover: uint8 (rows, cols), 1 where to cover; connected, (row, col) among them.
        row, col: where the walk begins and ends.
    """
    rows, cols = steps.shape
    # A node of its own for "to be covered, not yet labelled".
    waiting = rows * cols
    node = np.where(to_cover == 1, waiting, NO_NODE).astype(np.int32)
    blocks = Blocks(steps, node, np.zeros((rows, cols, 2), np.int8))
    nodes = 0
    for cell_row in range(rows):
        for cell_col in range(cols):
            if node[cell_row, cell_col] == waiting:
                _grow_node(blocks, cell_row, cell_col, nodes)
                nodes += 1
    _span(blocks, row, col, nodes)
    return _circuit(blocks, row, col)
