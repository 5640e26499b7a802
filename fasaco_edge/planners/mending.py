"""From the walk that was to a complete one for the problem as it is now."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.mending import keep_legal, put_in_new
from fasaco_edge.kernels.walks import shortest_walk
from fasaco_edge.planners.framed import FramedGround
from fasaco_edge.planners.graph import flat_start
from fasaco_edge.planners.problem import CoverageProblem


def mended(
    problem: CoverageProblem, framed: FramedGround, before: NDArray[np.int32], held: int = 0
) -> NDArray[np.int32]:
    """Return a walk that solves ``problem`` and keeps what holds of ``before``.

    Args:
        problem: as it is now.
        framed: its ground.
        before: int32 (n, 2), the walk that was still to be driven, cells (row, col).
        held: so many first visits stay as they are where they can.

    Returns:
        Framed cells, int32 (m,).
    """
    start = int(framed.framed(np.array([flat_start(problem)], np.int32))[0])
    cells = framed_cells(problem, framed, before)
    room = cells.size + 2 * framed.ground.bound
    kept = np.empty(room, np.int32)
    length = keep_legal(framed.ground, cells, start, kept)
    whole = np.empty(length + 2 * framed.ground.bound, np.int32)
    size = put_in_new(framed.ground, kept[:length], problem.end is None, held, whole)
    walk = whole[:size].copy()
    return walk if problem.end is None else _with_end(problem, framed, walk)


def framed_cells(
    problem: CoverageProblem, framed: FramedGround, before: NDArray[np.int32]
) -> NDArray[np.int32]:
    """Return the cells of ``before`` that the lattice still spans, as framed ones."""
    window = problem.lattice.window
    rows, cols = before[:, 0] - window.row0, before[:, 1] - window.col0
    inside = (rows >= 0) & (rows < window.rows) & (cols >= 0) & (cols < window.cols)
    return framed.framed((rows[inside] * window.cols + cols[inside]).astype(np.int32))


def _with_end(
    problem: CoverageProblem, framed: FramedGround, walk: NDArray[np.int32]
) -> NDArray[np.int32]:
    """Lead a walk on to the problem's end by a shortest way."""
    assert problem.end is not None
    lattice = problem.lattice
    row, col = divmod(int(framed.unframed(walk[-1:])[0]), framed.cols)
    way = shortest_walk(lattice.steps, (row, col), lattice.local(problem.end))
    flat = (way[1:, 0] * framed.cols + way[1:, 1]).astype(np.int32)
    return np.concatenate((walk, framed.framed(flat)))
