"""The ground that local search walks on: the problem's lattice with a frame around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.walk_array import FRAME, Ground
from fasaco_edge.planners.problem import CoverageProblem


@dataclass(frozen=True, slots=True, eq=False)
class FramedGround:
    """The problem's steps and cells to cover, and the way between both kinds of flat index.

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
