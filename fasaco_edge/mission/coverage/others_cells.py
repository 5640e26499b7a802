"""Cells that other robots have swept, as a part of the ledger; here for a single robot."""

from __future__ import annotations

from collections.abc import Callable
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.mission.coverage.ledger import Cells, LedgerSnapshot

Inside = Callable[[Cells, Cells], NDArray[np.bool_]]


class OthersCells:
    """The cells that other robots have swept, a part of the ledger; here none.

    A robot that has left its fleet keeps the cells that others had swept, in case it joins again.
    Once it forgets cells of its own, it drops the others' cells, too: else a forgotten cell that
    another robot had swept would still count. The ledger calls ``record_forgotten`` also where it
    calls ``clear``, ``leave_building`` or ``reset``.

    Attributes:
        version: counter of changes.
        epoch: changes whenever this robot forgets cells.
    """

    version = epoch = 0

    def __init__(self) -> None:
        self._kept = b""

    def swept(self, window: Window) -> NDArray[np.bool_]:
        """Return which cells of ``window`` others have swept, bool (rows, cols), read-only."""
        return np.zeros((window.rows, window.cols), np.bool_)

    def begin_epoch(self, epoch: int) -> None:
        """Start an epoch with a new number, unless ``restore`` has set one."""

    def record_forgotten(self) -> None:
        """Record that this robot has forgotten some of its own cells."""
        self._kept = b""

    def disregard(self, inside: Inside) -> None:
        """Disregard all earlier sweeps of the cells that a mask function selects."""

    def clear(self) -> None:
        """Forget all that others reported: it belongs to another frame or building."""

    def enter(self, frame: str) -> None:
        """Note the active frame."""

    def leave_building(self, frame: str) -> None:
        """Note that the map in a frame shows another building: cells of others lie elsewhere."""

    def reset(self) -> None:
        """Accept the next map as one that others share."""

    def snapshot(self, cell_m: float) -> LedgerSnapshot:
        """Return the cells swept by others as one ledger."""
        return LedgerSnapshot(cell_m, "", 0, MappingProxyType({}))

    def encode(self) -> bytes:
        """Return everything as bytes, to be stored with the ledger; b"" for nothing."""
        return self._kept

    def restore(self, kept: bytes) -> None:
        """Restore the bytes of ``encode``."""
        self._kept = kept
