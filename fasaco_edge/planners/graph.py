"""Conversion of a coverage problem to the flat arrays of the kernels, and back.

Ants walk on ``Graph``, the lattice as it is; local search on ``FramedGround``, the lattice
with a frame around it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import Cell
from fasaco_edge.kernels.ants.graph import Graph, Scratch
from fasaco_edge.kernels.bound.covering import covering_bound
from fasaco_edge.kernels.local_search.walk_array import FRAME, Ground
from fasaco_edge.planners.problem import CoverageProblem


def graph_of(problem: CoverageProblem) -> Graph:
    """Return the problem's lattice and cells to cover, as flat indices ``row * cols + col``."""
    steps = problem.lattice.steps
    cols = steps.shape[1]
    offsets = np.array([1, cols, -1, -cols], np.int64)
    wanted = problem.to_cover.astype(np.uint8)
    open_steps = np.zeros(steps.size + 2 * cols, np.uint8)
    inner = open_steps[cols : cols + steps.size].reshape(steps.shape)
    beside = np.pad(wanted, 1)
    ahead = (beside[1:-1, 2:], beside[2:, 1:-1], beside[1:-1, :-2], beside[:-2, 1:-1])
    for direction, neighbour in enumerate(ahead):
        inner |= steps & (neighbour << direction)
    return Graph(steps.ravel(), wanted.ravel(), open_steps, offsets)


def scratch_for(graph: Graph) -> Scratch:
    """Return working memory for one thread."""
    size = graph.steps.size
    return Scratch(
        open_steps=np.empty_like(graph.open_steps),
        seen=np.zeros(size, np.int32),
        came_from=np.zeros(size, np.int8),
        queue=np.empty(size, np.int32),
        searches=np.zeros(1, np.int32),
        weights=np.zeros((1, 4)),
    )


def flat_start(problem: CoverageProblem) -> int:
    """Return the start as a flat index."""
    return _flat(problem, problem.start)


def flat_end(problem: CoverageProblem) -> int:
    """Return the end as a flat index, -1 for anywhere."""
    return -1 if problem.end is None else _flat(problem, problem.end)


def cells_of(problem: CoverageProblem, walk: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return a walk of flat indices, int32 (n,), as cells (row, col), int32 (n, 2)."""
    window = problem.lattice.window
    rows, cols = np.divmod(walk, window.cols)
    return np.column_stack((rows + window.row0, cols + window.col0)).astype(np.int32)


def _flat(problem: CoverageProblem, cell: Cell) -> int:
    row, col = problem.lattice.local(cell)
    return row * problem.lattice.window.cols + col


@dataclass(frozen=True, slots=True, eq=False)
class FramedGround:
    """The problem's steps and cells to cover, framed, and conversion of flat indices.

    Attributes:
        rows, cols: shape of the lattice, without the frame.
        ground: cells as flat indices of the framed lattice.
    """

    rows: int
    cols: int
    ground: Ground

    @classmethod
    def of(cls, problem: CoverageProblem) -> FramedGround:
        """Frame a problem's lattice."""
        rows, cols = problem.to_cover.shape
        steps = np.pad(problem.lattice.steps, FRAME)
        needed = np.pad(problem.to_cover.astype(np.int32), FRAME)
        width = cols + 2 * FRAME
        offsets = np.array([1, width, -1, -width], np.int64)
        return cls(rows, cols, Ground(steps.ravel(), needed.ravel(), offsets, steps.size))

    @property
    def width(self) -> int:
        """Cells from one row to the next."""
        return self.cols + 2 * FRAME

    def framed(self, walk: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return flat cells of the lattice, int32 (n,), as those of the framed one."""
        row, col = np.divmod(walk, np.int32(self.cols))
        return ((row + FRAME) * self.width + col + FRAME).astype(np.int32)

    def unframed(self, walk: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return flat cells of the framed lattice, int32 (n,), as those of the lattice."""
        row, col = np.divmod(walk, np.int32(self.width))
        return ((row - FRAME) * self.cols + col - FRAME).astype(np.int32)


def lower_bound_steps(problem: CoverageProblem) -> int:
    """Return a number of steps that no walk which solves ``problem`` can beat.

    Turns do not count. The proof is in ``kernels.bound.covering``.
    """
    required = problem.to_cover.astype(np.uint8)
    return covering_bound(problem.lattice.steps, required, flat_start(problem), flat_end(problem))
