"""Connected areas of a grid: cells of one kind, connected by their edges.

Two passes over the grid, with a union of connected pieces (Rosenfeld and Pfaltz, 1966): a map with
a hundred thousand closed chambers takes as long as an empty one.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels import COL_STEP, ROW_STEP
from fasaco_edge.kernels.jit import kernel, lean_inner_kernel


class Areas(NamedTuple):
    """Areas, numbered in the order of their first cells, row by row.

    Attributes:
        labels: int32 (rows, cols), number of each cell's area, from 1; 0 for none.
        kinds: uint8 (n,), the kind of area i + 1.
        cells: int32 (n,), number of cells of area i + 1.
        inner: int32 (n, 2), one of its cells (row, col): the middle of its first longest run in a
            row.
    """

    labels: NDArray[np.int32]
    kinds: NDArray[np.uint8]
    cells: NDArray[np.int32]
    inner: NDArray[np.int32]


@lean_inner_kernel
def root(parents: NDArray[np.integer], piece: int) -> int:
    """Return the root of ``piece`` (union-find with path compression).

    ``parents``, int (n,), has the parent of each piece in a tree; a root is its own parent.
    """
    while parents[piece] != piece:
        parents[piece] = parents[parents[piece]]
        piece = parents[piece]
    return piece


@lean_inner_kernel
def _join_pieces(
    kinds: NDArray[np.uint8], labels: NDArray[np.int32], parents: NDArray[np.int32]
) -> int:
    """Give each cell the number of a piece; return the number of pieces.

    The root of connected pieces is the one found first.
    """
    rows, cols = kinds.shape
    pieces = 0
    for row in range(rows):
        for col in range(cols):
            kind = kinds[row, col]
            if kind == 0:
                labels[row, col] = 0
                continue
            left = labels[row, col - 1] if col > 0 and kinds[row, col - 1] == kind else 0
            below = labels[row - 1, col] if row > 0 and kinds[row - 1, col] == kind else 0
            if left and below:
                one, other = root(parents, left), root(parents, below)
                parents[max(one, other)] = min(one, other)
                labels[row, col] = min(one, other)
            elif left or below:
                labels[row, col] = max(left, below)
            else:
                pieces += 1
                parents[pieces] = pieces
                labels[row, col] = pieces
    return pieces


@lean_inner_kernel
def _number(parents: NDArray[np.int32], pieces: int) -> int:
    """Replace the parent of each piece by its area's number; return how many areas there are."""
    areas = 0
    for piece in range(1, pieces + 1):
        # A parent comes before its piece, and has its number already.
        if parents[piece] == piece:
            areas += 1
            parents[piece] = areas
        else:
            parents[piece] = parents[parents[piece]]
    return areas


@lean_inner_kernel
def _measure(
    kinds: NDArray[np.uint8], parents: NDArray[np.int32], areas: Areas, longest: NDArray[np.int32]
) -> None:
    """Replace each cell's piece by its area's number; fill in the areas' kind, size, inner cell."""
    rows, cols = kinds.shape
    for row in range(rows):
        run = 0
        for col in range(cols):
            label = areas.labels[row, col] = parents[areas.labels[row, col]]
            run = run + 1 if label and col > 0 and areas.labels[row, col - 1] == label else 1
            if label == 0:
                continue
            area = label - 1
            areas.kinds[area] = kinds[row, col]
            areas.cells[area] += 1
            if run > longest[area]:
                longest[area] = run
                areas.inner[area, 0], areas.inner[area, 1] = row, col - run // 2


@kernel
def find_areas(kinds: NDArray[np.uint8]) -> Areas:
    """Return the areas of all kinds but 0 of a grid, uint8 (rows, cols)."""
    rows, cols = kinds.shape
    labels = np.empty((rows, cols), np.int32)
    # A piece begins where neither neighbour before it is of its kind.
    parents = np.empty(rows * cols + 1, np.int32)
    parents[0] = 0
    pieces = _join_pieces(kinds, labels, parents)
    count = _number(parents, pieces)
    areas = Areas(
        labels,
        np.zeros(count, np.uint8),
        np.zeros(count, np.int32),
        np.zeros((count, 2), np.int32),
    )
    _measure(kinds, parents, areas, np.zeros(count, np.int32))
    return areas


@lean_inner_kernel
def _beside(labels: NDArray[np.int32], row: int, col: int, found: NDArray[np.int32]) -> int:
    """Fill in the areas beside a cell, each once; return their number."""
    rows, cols = labels.shape
    count = 0
    for side in range(4):
        there_row, there_col = row + ROW_STEP[side], col + COL_STEP[side]
        if not (0 <= there_row < rows and 0 <= there_col < cols):
            continue
        label = labels[there_row, there_col]
        if label == 0:
            continue
        known = False
        for index in range(count):
            known = known or found[index] == label
        if not known:
            found[count] = label
            count += 1
    return count


@kernel
def cells_beside(areas: Areas, allowed: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return for each area an allowed cell (row, col) beside it, int32 (n, 2); (-1, -1) for none.

    It is the middle one of these cells, row by row. An area without a square of two by two cells
    has none.

    Args:
        areas: see ``find_areas``.
        allowed: bool (rows, cols); none of them in an area.
    """
    labels = areas.labels
    rows, cols = labels.shape
    count = len(areas.cells)
    has_square, cells = np.zeros(count + 1, np.bool_), np.zeros(count + 1, np.int32)
    around = np.empty(4, np.int32)
    chosen = np.full((count, 2), -1, np.int32)
    for row in range(rows):
        for col in range(cols):
            label = labels[row, col]
            if label and row > 0 and col > 0:
                has_square[label] |= (
                    labels[row - 1, col] == label
                    and labels[row, col - 1] == label
                    and labels[row - 1, col - 1] == label
                )
            if allowed[row, col]:
                for index in range(_beside(labels, row, col, around)):
                    cells[around[index]] += 1
    left = np.empty_like(cells)
    for label in range(cells.size):
        left[label] = cells[label] // 2
    for row in range(rows):
        for col in range(cols):
            if not allowed[row, col]:
                continue
            for index in range(_beside(labels, row, col, around)):
                label = around[index]
                if has_square[label] and left[label] == 0:
                    chosen[label - 1, 0], chosen[label - 1, 1] = row, col
                left[label] -= 1
    return chosen
