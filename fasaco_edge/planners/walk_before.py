"""Previous walk: its undriven rest, completed to solve the present problem.

Its valid parts stay as they are, cell by cell; planners start from the result.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.local_search.repair import keep_legal, put_in_new
from fasaco_edge.planners.problem import CoverageProblem, FramedGround

# Number of cells just ahead of the robot that are held: about 5 m at usual tool widths.
HELD_CELLS = 18


def completed(
    problem: CoverageProblem, framed: FramedGround, before: NDArray[np.int32], held: int = 0
) -> NDArray[np.int32]:
    """Return a walk that solves ``problem`` and keeps the valid parts of ``before``.

    Args:
        problem: the present problem.
        framed: the problem's cells with a border, see ``FramedGround``.
        before: int32 (n, 2), the previous walk, cells (row, col).
        held: number of leading visits to keep if possible.

    Returns:
        Framed cells, int32 (m,).
    """
    return completed_from(problem, framed, framed_cells(problem, framed, before), held)


def completed_from(
    problem: CoverageProblem, framed: FramedGround, before: NDArray[np.int32], held: int
) -> NDArray[np.int32]:
    """Do as ``completed``, but take ``before`` as ``framed_cells`` returns it, int32 (n,)."""
    start = int(framed.framed(np.array([problem.flat_start], np.int32))[0])
    kept = np.empty(before.size + 2 * framed.ground.bound, np.int32)
    length = keep_legal(framed.ground, before, start, kept)
    whole = np.empty(length + 2 * framed.ground.bound, np.int32)
    size = put_in_new(framed.ground, kept[:length], problem.end is None, held, whole)
    walk = whole[:size].copy()
    if problem.end is None:
        return walk
    return framed.framed(problem.led_to_end(framed.unframed(walk)))


def framed_cells(
    problem: CoverageProblem, framed: FramedGround, before: NDArray[np.int32]
) -> NDArray[np.int32]:
    """Return the cells of ``before`` that are still on the lattice, as framed cells."""
    window = problem.lattice.window
    rows, cols = before[:, 0] - window.row0, before[:, 1] - window.col0
    inside = (rows >= 0) & (rows < window.rows) & (cols >= 0) & (cols < window.cols)
    if not inside.all():
        rows, cols = rows[inside], cols[inside]
    return framed.framed_at(rows, cols)
