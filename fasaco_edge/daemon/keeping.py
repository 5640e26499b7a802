"""What is to outlive the daemon: handed to the disk's thread when it has changed."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from fasaco_edge.daemon.ledger_writer import PERIOD_S, LedgerWriter
from fasaco_edge.errors import FasacoError
from fasaco_edge.mission.assignment import NO_ORDER, Assignment
from fasaco_edge.mission.ledger import LedgerMismatchError, LedgerSnapshot
from fasaco_edge.mission.order import OrderError

if TYPE_CHECKING:
    from fasaco_edge.mission.mission import Mission


# An answer to a command waits so long for a slow disk [s].
MOST_WAIT_S = 1.0


class Keeping:
    """Keeps the ledger with the order; also before there is a mission.

    Attributes:
        fault: what was wrong with the order that was kept; None if nothing.
    """

    def __init__(self, writer: LedgerWriter, cell_m: float, *, autostart: bool) -> None:
        self.fault: OrderError | None = None
        self._writer = writer
        self._before = writer.restored or LedgerSnapshot(cell_m, "", 0, {})
        self.first = self._first_assignment(autostart)
        self._kept = self._before.total, self.first
        self._kept_at = float("-inf")

    def restore(self, mission: Mission, assignment: Assignment) -> None:
        """Let a mission go on where the one before ended."""
        if self._before.cells:
            mission.resume(self._before)
        mission.assign(assignment)

    def take_back(self, mission: Mission) -> None:
        """Keep what a mission has done for the one that goes on in its place."""
        self._before, self.first = mission.snapshot(), mission.assignment

    def keep(self, mission: Mission | None, assignment: Assignment, now: float) -> None:
        """Hand over what has changed: an order at once, coverage once a period."""
        total = mission.ledger.total if mission else self._before.total
        kept_total, kept_assignment = self._kept
        if total == kept_total and assignment == kept_assignment:
            return
        if assignment == kept_assignment and now - self._kept_at < PERIOD_S:
            return
        self._kept, self._kept_at = (total, assignment), now
        if mission is not None:
            self._writer.put(mission.snapshot())
        else:
            self._before = replace(self._before, note=assignment.note())
            self._writer.put(self._before)

    def is_kept(self, now: float) -> bool:
        """Tell whether what was handed over is on the disk, or no disk is to be waited for."""
        return not self._writer.is_behind() or now - self._kept_at > MOST_WAIT_S

    def note_faults(self, faults: tuple[FasacoError, ...]) -> None:
        """Keep the files aside where the mission found them to be of another building."""
        for fault in faults:
            if isinstance(fault, LedgerMismatchError):
                self._begin_anew(fault, "mismatch")

    def forget(self) -> None:
        """Keep the files aside: everything is to be covered again."""
        self._begin_anew(None, "reset")
        self._before = LedgerSnapshot(self._before.cell_m, "", 0, {})

    def _begin_anew(self, fault: FasacoError | None, why: str) -> None:
        self._writer.begin_anew(fault, why)
        self._kept, self._kept_at = (-1, Assignment()), float("-inf")

    def _first_assignment(self, autostart: bool) -> Assignment:
        """Return what to do first: what was being done, if anything."""
        kept = Assignment.none(NO_ORDER)
        try:
            if self._before.note:
                kept = Assignment.of_note(self._before.note)
        except OrderError as error:
            self.fault = error
            return Assignment.none(str(error))
        if autostart and kept == Assignment.none(NO_ORDER):
            return Assignment.by_itself()
        if not autostart and kept.standing:
            return Assignment.none(NO_ORDER)
        return kept
