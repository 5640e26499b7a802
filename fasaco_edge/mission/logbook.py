"""The ledger of a mission, and whose building it is of."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Pose2D, Window
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.mission.fit import ResumedLedger, Verdict
from fasaco_edge.mission.ledger import (
    DROPPED_TILES,
    MOST_TILES,
    TILE,
    CoverageLedger,
    LedgerFullError,
    LedgerMismatchError,
    LedgerSnapshot,
)
from fasaco_edge.mission.loop_closure import Motion, doubtful


class Logbook:
    """Keeps the ledger; one from before a restart only as long as no map contradicts it.

    Attributes:
        ledger: what is covered.
        opening: why the first plan is wanted.
    """

    def __init__(self, cell_m: float) -> None:
        self._cell_m = cell_m
        self.ledger = CoverageLedger(cell_m)
        self.opening = "first plan"
        self._resumed: ResumedLedger | None = None
        # The robot's last pose on a map that has moved since.
        self._parted_at: Pose2D | None = None

    def resume(self, before: LedgerSnapshot) -> None:
        """Go on with the ledger from before a restart."""
        self._resumed = ResumedLedger(before)
        self.ledger = self._resumed.ledger
        self.opening = f"first plan, {before.cells} cells were covered before"

    def record(self, pose: Pose2D) -> LedgerFullError | None:
        """Note that the robot drove on to ``pose``; return what to say where there was no room."""
        before = self.ledger.dropped
        self.ledger.record(pose)
        if self._resumed is not None:
            self._resumed.record(pose)
        if self.ledger.dropped == before:
            return None
        return LedgerFullError(
            f"the ledger holds {MOST_TILES} tiles of {TILE} x {TILE} cells at most: the "
            f"{DROPPED_TILES} farthest from the robot were dropped"
        )

    def lift(self) -> None:
        """Note that nobody knows how the robot gets to its next pose."""
        self.ledger.lift()
        if self._resumed is not None:
            self._resumed.lift()

    def part(self, pose: Pose2D) -> None:
        """Note that the map has moved under a robot at ``pose``; where to, the next one tells."""
        self._parted_at = pose
        self.ledger.part()
        if self._resumed is not None:
            self._resumed.part()

    def follow(self, pose: Pose2D) -> int:
        """Forget what nobody can know any more to be covered; return how many cells that are."""
        start, self._parted_at = self._parted_at, None
        if start is None or (motion := Motion(start, pose)).is_still:
            return 0
        before = self.ledger.snapshot()
        self.forget(doubtful(before, motion))
        return before.cells - self.ledger.snapshot().cells

    def forget(self, inside: Callable[[Window], NDArray[np.bool_]]) -> None:
        """Forget all visits to cells ``inside``, see ``CoverageLedger.forget``."""
        self.ledger.forget(inside)
        if self._resumed is not None:
            self._resumed.forget(inside)

    def move_to(self, frame: str) -> LedgerMismatchError | None:
        """Lie in ``frame`` from now on; begin anew, and say so, if another holds covered cells."""
        was = self.ledger.frame
        if was in ("", frame):
            self.ledger.frame = frame
            return None
        cells = self.ledger.snapshot().cells
        self.ledger, self._resumed = CoverageLedger(self._cell_m, frame), None
        self._parted_at = None
        if not cells:
            return None
        misfit = LedgerMismatchError(
            f"the ledger of {cells} covered cells lies in frame {was!r}, the map in {frame!r}"
        )
        self.opening = f"{misfit}: begun anew"
        return misfit

    def begin_anew(self, frame: str) -> None:
        """Forget all there is; ``frame`` is that of the poses, "" where none counts."""
        self.ledger, self._resumed = CoverageLedger(self._cell_m, frame), None
        self._parted_at = None
        self.opening = "first plan"

    def check(self, lattice: CoverageLattice, frame: str) -> LedgerMismatchError | None:
        """Begin anew where a map shows the ledger to be of another building; return what to say."""
        resumed = self._resumed
        verdict = resumed.verdict(lattice) if resumed else Verdict.OPEN
        if resumed is None or verdict is Verdict.OPEN:
            return None
        self._resumed = None
        if verdict is Verdict.SAME:
            return None
        self.ledger, misfit = resumed.since(frame), resumed.mismatch()
        self.opening = f"{misfit}: begun anew"
        return misfit
