"""Reached cells: which cells have been reachable since an order began, kept over a restart."""

from __future__ import annotations

from typing import Annotated, Self

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import MAX_LATTICE_CELLS, Window

Count = Annotated[int, Meta(ge=1, le=MAX_LATTICE_CELLS)]


class ReachedCells(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Cells of a window of the lattice.

    Attributes:
        row0, col0, rows, cols: the window.
        bits: one bit per cell, row by row, most significant bit first.
        have_moved: whether they have moved by fractions of a cell, so that some may lie in walls.
    """

    row0: int
    col0: int
    rows: Count
    cols: Count
    bits: bytes
    have_moved: bool = False

    def __post_init__(self) -> None:
        """Check the sizes; raise ValueError if they do not match."""
        if self.rows * self.cols > MAX_LATTICE_CELLS:
            raise ValueError(f"{self.rows} x {self.cols} cells, {MAX_LATTICE_CELLS} at most")
        if len(self.bits) != -(-self.rows * self.cols // 8):
            raise ValueError(f"{len(self.bits)} bytes for {self.rows} x {self.cols} cells")

    @classmethod
    def of(cls, reached: NDArray[np.bool_], window: Window) -> Self | None:
        """Return the marked cells of a window, bool (rows, cols); None for none."""
        found = Window.of(reached)
        if found is None:
            return None
        bits = np.packbits(reached[found.row0 : found.row1, found.col0 : found.col1]).tobytes()
        row0, col0 = window.row0 + found.row0, window.col0 + found.col0
        return cls(row0, col0, found.rows, found.cols, bits)

    @property
    def window(self) -> Window:
        """The window."""
        return Window(self.row0, self.col0, self.row0 + self.rows, self.col0 + self.cols)

    @property
    def mask(self) -> NDArray[np.bool_]:
        """The marked cells, bool (rows, cols) of the window."""
        bits = np.frombuffer(self.bits, np.uint8)
        flat = np.unpackbits(bits, count=self.rows * self.cols).view(np.bool_)
        return flat.reshape(self.rows, self.cols)
