"""What is to outlive the daemon: handed to the disk's thread when it has changed.

The thread that writes the ledger: a slow or full disk costs the mission nothing.

What cannot be written stays in memory and is tried again; the status says so meanwhile.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from fasaco_edge.errors import FasacoError
from fasaco_edge.mission.coverage.ledger import LedgerMismatchError, LedgerSnapshot
from fasaco_edge.mission.orders.order import OrderError
from fasaco_edge.mission.orders.order_state import NO_ORDER, OrderState

if TYPE_CHECKING:
    from fasaco_edge.mission.core.mission import Mission


import logging
import threading
import time
from collections import deque
from pathlib import Path

from fasaco_edge.daemon.faults import fault_text, log_fault
from fasaco_edge.daemon.ledger.codec import LedgerFileError
from fasaco_edge.daemon.ledger.file import LedgerFile, LoadedLedger, reason_of
from fasaco_edge.wire.status import LedgerReport

# An answer to a command waits so long for a slow disk [s].
MOST_WAIT_S = 1.0


class LedgerKeeper:
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

    def restore(self, mission: Mission, assignment: OrderState) -> None:
        """Let a mission go on where the one before ended."""
        if self._before.cells:
            mission.restore_ledger(self._before)
        mission.restore_order(assignment)

    def take_back(self, mission: Mission) -> None:
        """Keep what a mission has done for the one that goes on in its place."""
        self._before, self.first = mission.snapshot(), mission.order_state

    def keep(self, mission: Mission | None, assignment: OrderState, now: float) -> None:
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
            self._before = replace(self._before, note=assignment.to_json())
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
        self._kept, self._kept_at = (-1, OrderState()), float("-inf")

    def _first_assignment(self, autostart: bool) -> OrderState:
        """Return what to do first: what was being done, if anything."""
        kept = OrderState.idle(NO_ORDER)
        try:
            if self._before.note:
                kept = OrderState.from_json(self._before.note)
        except OrderError as error:
            self.fault = error
            return OrderState.idle(str(error))
        if autostart and kept == OrderState.idle(NO_ORDER):
            return OrderState.autostart()
        if not autostart and kept.automatic:
            return OrderState.idle(NO_ORDER)
        return kept


LOG = logging.getLogger(__name__)

# So that what is a second old is on disk, although the loop takes up to a tenth to look, and
# a memory card some tenths to write.
PERIOD_S = 0.5
# After a failure, so long until the next try.
RETRY_S = 2.0


def open_ledger(folder: Path, robot: str, cell_m: float, *, fresh: bool = False) -> LedgerWriter:
    """Find a robot's ledger and start the thread that writes it.

    Args:
        folder: where it is kept.
        robot: the robot's name.
        cell_m: edge of a cell [m].
        fresh: keep aside what there is, and begin anew.

    Raises:
        LedgerFileError: another process writes this ledger.
    """
    file = LedgerFile(folder, robot)
    file.lock()
    if not fresh:
        return LedgerWriter(file, file.load(cell_m))
    try:
        kept = file.set_aside("fresh")
        if kept:
            LOG.info("begun anew; what was covered before is kept as %s", ", ".join(kept))
        return LedgerWriter(file, LoadedLedger())
    except OSError as error:
        return LedgerWriter(file, LoadedLedger(fault=_cannot_write(file, error)))


class LedgerWriter:
    """Writes the newest ledger it is given.

    Attributes:
        restored: the ledger to go on with, if any.
    """

    def __init__(self, file: LedgerFile, found: LoadedLedger) -> None:
        self.restored = found.ledger
        self._restored_cells = found.ledger.cells if found.ledger else 0
        LOG.info("ledger %s: %d cells covered before", file.path, self._restored_cells)
        self._file = file
        self._written_at: float | None = None
        self._faults = deque[FasacoError]()
        # What is wrong as long as nothing can be written, and what was found at the start.
        self._trouble, self._told = "", ""
        if found.fault is not None:
            self._told = log_fault(LOG, found.fault)
            self._faults.append(found.fault)
        self._changed = threading.Condition()
        self._waiting: LedgerSnapshot | None = None
        self._unwanted: list[str] = []
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="ledger", daemon=True)
        self._thread.start()

    def put(self, ledger: LedgerSnapshot) -> None:
        """Write this ledger next, in place of one that still waits."""
        with self._changed:
            self._waiting = ledger
            self._changed.notify()

    def is_behind(self) -> bool:
        """Tell whether something it was given is not on the disk yet, and may soon be."""
        with self._changed:
            return self._has_work() and not self._trouble

    def begin_anew(self, fault: FasacoError | None, why: str) -> None:
        """Keep the files aside, ``why`` in their names: another ledger follows.

        Args:
            fault: what has been told already, for the status; None where it was asked for.
            why: a word.
        """
        self._told = fault_text(fault) if fault is not None else ""
        self._restored_cells = 0
        with self._changed:
            self._waiting = None
            self._unwanted.append(why)
            self._changed.notify()

    def take_faults(self) -> list[FasacoError]:
        """Return what went wrong since the last call; trouble that goes on is told once."""
        return [self._faults.popleft() for _ in range(len(self._faults))]

    def report(self, now: float) -> LedgerReport:
        """Return this part of the status; ``now`` is monotonic time [s]."""
        written_at = self._written_at
        return LedgerReport(
            path=str(self._file.path),
            age_s=None if written_at is None else round(max(now - written_at, 0.0), 3),
            restored_cells=self._restored_cells,
            fault=self._trouble or self._told or None,
        )

    def close(self, timeout_s: float) -> None:
        """Write what still waits and end the thread; a disk that hangs is not waited for."""
        with self._changed:
            self._stopping = True
            self._changed.notify()
        self._thread.join(timeout_s)
        if self._thread.is_alive():
            LOG.warning("the disk is too slow: the last of the ledger may not be on it")

    def _run(self) -> None:
        failed = False
        while True:
            with self._changed:
                if failed:
                    self._changed.wait_for(lambda: self._stopping, RETRY_S)
                else:
                    self._changed.wait_for(lambda: self._stopping or self._has_work())
                ledger, unwanted, stopping = self._waiting, self._unwanted[:], self._stopping
            failed = not self._work(ledger, unwanted)
            with self._changed:
                if stopping and (failed or not self._has_work()):
                    return

    def _has_work(self) -> bool:
        return self._waiting is not None or bool(self._unwanted)

    def _work(self, ledger: LedgerSnapshot | None, unwanted: list[str]) -> bool:
        """Do what there is to do; tell whether that went well."""
        try:
            kept = [name for why in unwanted for name in self._file.set_aside(why)]
            if ledger is not None:
                kept += self._file.write(ledger)
            if kept:
                LOG.warning("the ledger before is kept as %s", ", ".join(kept))
        except Exception as error:
            # Whatever it is, it must not cost the mission.
            fault = _cannot_write(self._file, error)
            if str(fault) not in self._trouble:
                self._trouble = log_fault(LOG, fault)
                self._faults.append(fault)
            return False
        with self._changed:
            del self._unwanted[: len(unwanted)]
            self._waiting = None if self._waiting is ledger else self._waiting
        if ledger is not None:
            self._note_success()
        return True

    def _note_success(self) -> None:
        self._written_at = time.monotonic()
        if self._trouble:
            LOG.warning("ledger %s: written again", self._file.path)
            self._trouble = ""


def _cannot_write(file: LedgerFile, error: Exception) -> LedgerFileError:
    return LedgerFileError(
        f"cannot write {file.path}: {reason_of(error)}",
        hint="progress is kept in memory and tried again; make room there, or the folder "
        "writable, or choose another (mission.state_dir, --state)",
    )
