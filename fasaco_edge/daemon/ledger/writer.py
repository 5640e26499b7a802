"""The ledger's keeper: writes progress when it is due, and restores it."""

from __future__ import annotations

import logging
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from fasaco_edge.daemon.counters import fault_text, log_fault
from fasaco_edge.daemon.ledger.disk_writer import MOST_WAIT_S, DiskWriter
from fasaco_edge.daemon.ledger.file import LedgerFile, LoadedLedger, reason_of
from fasaco_edge.errors import (
    FasacoError,
    LedgerFileError,
    LedgerMismatchError,
    OrderError,
    WouldForget,
)
from fasaco_edge.mission.coverage.ledger import LedgerSnapshot
from fasaco_edge.mission.orders.keep_outs import KeepOuts
from fasaco_edge.mission.work.order_state import NO_ORDER, OrderState
from fasaco_edge.wire.documents.status import LedgerReport

if TYPE_CHECKING:
    from fasaco_edge.mission.core.mission import Mission
    from fasaco_edge.mission.rooms.room_book import RoomBook

LOG = logging.getLogger(__name__)

# Period of writes [s]. With a cycle of up to 0.1 s and some tenths for a memory card, coverage is
# on disk within a second.
PERIOD_S = 0.5
# Period if only floor and trail have changed [s]: each pose or path changes them, and memory cards
# wear out.
FLOOR_PERIOD_S = 1.0
# Period if only time was spent, as in a dock [s].
SPENT_PERIOD_S = 30.0


class _Kept(NamedTuple):
    """The state last passed to the writer; ``spent``: time of the order in SPENT_PERIOD_S units."""

    visits: int
    floor_changes: int
    trail_changes: int
    fleet_version: int
    order_state: OrderState
    spent: int = 0

    def may_wait_s(self, before: _Kept) -> float:
        """Return the least time between writing ``before`` and this state [s]."""
        if self.order_state != before.order_state:
            return 0.0
        return PERIOD_S if self.visits != before.visits else FLOOR_PERIOD_S


class LedgerKeeper:
    """Keeps coverage and order in the ledger; also before there is a mission.

    Attributes:
        order_state: the order to begin with; after a restart, the order from before.
    """

    def __init__(self, writer: LedgerWriter, cell_m: float, *, autostart: bool) -> None:
        self._faults: list[FasacoError] = []
        self._writer = writer
        self._before = writer.restored or LedgerSnapshot(cell_m, "", 0, {})
        self.order_state = self._first_order_state(autostart)
        self._kept = _Kept(self._before.total, self._before.floor.changes, 0, 0, self.order_state)
        self._kept_at = float("-inf")

    def restore(self, mission: Mission, rooms: RoomBook) -> None:
        """Let a mission continue where the previous one ended; ``rooms``: the known rooms."""
        mission.restore(self._before, self.order_state, rooms)

    def take_back(self, mission: Mission) -> None:
        """Take over a mission's progress for the mission that replaces it."""
        self._before, self.order_state = mission.snapshot(), mission.order_state

    def keep(self, mission: Mission | None, now: float) -> None:
        """Write changes: an order at once, coverage once a period."""
        if mission is not None:
            changes = (
                mission.covered.floor.changes,
                mission.trail.changes,
                mission.covered.shared.version,
            )
            state = mission.order_state
            spent = int(state.spent_s // SPENT_PERIOD_S)
            held = _Kept(mission.covered.current.total, *changes, state, spent)
        else:
            held = _Kept(self._before.total, self._before.floor.changes, 0, 0, self.order_state)
        if held == self._kept or now - self._kept_at < held.may_wait_s(self._kept):
            return
        self._kept, self._kept_at = held, now
        if mission is not None:
            self._writer.put(mission.snapshot())
        else:
            self._before = replace(self._before, note=held.order_state.to_json())
            self._writer.put(self._before)

    def is_kept(self, now: float) -> bool:
        """Return whether the changes are on disk, or the timeout is over."""
        return not self._writer.disk.is_behind() or now - self._kept_at > MOST_WAIT_S

    def report(self, now: float) -> LedgerReport:
        """Return the ledger's part of the status; ``now`` is monotonic time [s]."""
        return self._writer.report(now)

    def take_faults(self) -> list[FasacoError]:
        """Return the faults since the last call; they are logged already."""
        faults, self._faults = self._faults, []
        return faults + self._writer.disk.take_faults()

    def note_faults(self, faults: tuple[FasacoError, ...]) -> None:
        """Set the files aside if the mission found them to be of another building."""
        for fault in faults:
            if isinstance(fault, LedgerMismatchError):
                self._begin_anew(fault, "mismatch")

    def check_loss(self, command: str) -> None:
        """Check that a command forgets no covered cell, inside the zones or outside.

        Raises:
            WouldForget: there is a loss; the text gives its size.
        """
        before = self._before
        if cells := max(before.cells - len(before.under_tool), 0):
            m2 = cells * before.cell_m**2
            raise WouldForget(f"{command} forgets up to {cells} covered cells ({m2:.1f} m2)")

    def forget(self) -> None:
        """Set the files aside: everything has to be covered again."""
        self._begin_anew(None, "reset")
        self._before = LedgerSnapshot(self._before.cell_m, "", 0, {})

    def _begin_anew(self, fault: FasacoError | None, why: str) -> None:
        self._writer.begin_anew(fault, why)
        self._kept, self._kept_at = _Kept(-1, -1, -1, -1, OrderState()), float("-inf")

    def _first_order_state(self, autostart: bool) -> OrderState:
        kept = OrderState.idle(NO_ORDER)
        try:
            if self._before.note:
                kept = OrderState.from_json(self._before.note)
        except OrderError as error:
            log_fault(LOG, error)
            self._faults.append(error)
            return OrderState.idle(str(error))
        first = OrderState.autostart() if autostart else OrderState.idle(NO_ORDER)
        held = {name: getattr(kept, name) for name in ("home", "keep_out", "frame", "places")}
        is_none_yet = kept.order is None and not kept.errand and kept.why == NO_ORDER
        is_first = is_none_yet or (kept.automatic and not autostart)
        return replace(first, **held) if is_first else kept


def open_ledger(folder: Path, robot: str, cell_m: float, *, fresh: bool = False) -> LedgerWriter:
    """Load a robot's ledger and start its writer thread; ``fresh``: set the old files aside.

    Raises:
        LedgerFileError: another process writes this ledger.
    """
    file = LedgerFile(folder, robot)
    error = file.lock()
    writer = _loaded(file, cell_m, fresh=fresh)
    if error is not None:
        # Reported at once: the first write may be much later.
        writer.disk.trouble = writer.disk.note(_cannot_write(file, error))
    return writer


def _loaded(file: LedgerFile, cell_m: float, *, fresh: bool) -> LedgerWriter:
    """Return the writer of a ledger that is continued, or started over."""
    found = file.load(cell_m)
    if not fresh:
        return _continued(file, found, cell_m)
    try:
        kept = file.set_aside("fresh")
        if kept:
            LOG.info("started over; what was covered before is kept as %s", ", ".join(kept))
        note = found.ledger.note if found.ledger else found.note
        return _continued(file, LoadedLedger(note=note), cell_m)
    except OSError as error:
        return LedgerWriter(file, LoadedLedger(fault=_cannot_write(file, error)))


def _continued(file: LedgerFile, found: LoadedLedger, cell_m: float) -> LedgerWriter:
    """Continue a ledger; if it is set aside, start a new one with the operator's keep-outs."""
    keep_outs: KeepOuts = ()
    with suppress(OrderError):
        keep_outs = OrderState.from_json(found.note).keep_out if found.note else ()
    if found.ledger is not None or not keep_outs:
        return LedgerWriter(file, found)
    names = ", ".join(each.name for each in keep_outs)
    LOG.info("keep-outs that were added stay: %s; `mission keep-out remove` removes one", names)
    note = replace(OrderState.idle(NO_ORDER), keep_out=keep_outs).to_json()
    begun = LedgerSnapshot(cell_m, "", 0, {}, note=note)
    writer = LedgerWriter(file, replace(found, ledger=begun))
    # Written at once, as the files that contained the keep-outs were set aside.
    writer.put(begun)
    return writer


class _Pending(NamedTuple):
    """Pending work: reasons for which to set the files aside, then a ledger to write, if any."""

    unwanted: tuple[str, ...]
    ledger: LedgerSnapshot | None

    def and_then(self, later: _Pending) -> _Pending:
        """Return both as one, with the later ledger."""
        return _Pending(self.unwanted + later.unwanted, later.ledger)


class LedgerWriter:
    """Writes the newest ledger.

    A ledger that cannot be written stays in memory and is retried; the status reports the failure.

    Attributes:
        restored: the ledger to continue with, if any.
        disk: the thread that writes it.
    """

    def __init__(self, file: LedgerFile, found: LoadedLedger) -> None:
        self.restored = found.ledger
        self._restored_cells = found.ledger.cells if found.ledger else 0
        LOG.info("ledger %s: %d cells covered before", file.path, self._restored_cells)
        self._file = file
        self._written_at: float | None = None
        self.disk = DiskWriter[_Pending](
            "ledger", self._write, lambda error: _cannot_write(file, error), _Pending.and_then
        )
        # The fault found when the files were read.
        self._finding = "" if found.fault is None else self.disk.note(found.fault)

    def put(self, ledger: LedgerSnapshot) -> None:
        """Write this ledger next; it replaces a waiting one."""
        self.disk.put(_Pending((), ledger))

    def begin_anew(self, fault: FasacoError | None, why: str) -> None:
        """Set the files aside, with ``why`` in their names; a new ledger follows.

        ``fault``: reported in the status; None for a reset by command.
        """
        self._finding = fault_text(fault) if fault is not None else ""
        self._restored_cells = 0
        self.disk.put(_Pending((why,), None))

    def report(self, now: float) -> LedgerReport:
        """Return the ledger's part of the status; ``now`` is monotonic time [s]."""
        written_at = self._written_at
        return LedgerReport(
            path=str(self._file.path),
            age_s=None if written_at is None else round(max(now - written_at, 0.0), 3),
            restored_cells=self._restored_cells,
            fault=self.disk.hang(now) or self.disk.trouble or self._finding or None,
        )

    def _write(self, pending: _Pending) -> None:
        kept = [name for why in pending.unwanted for name in self._file.set_aside(why)]
        if pending.ledger is not None:
            kept += self._file.write(pending.ledger)
            self._written_at = time.monotonic()
        if kept:
            LOG.warning("the previous ledger is kept as %s", ", ".join(kept))


class NoDisk(LedgerWriter):
    """A ledger that is never written: a replay leaves no trace."""

    def __init__(self, restored: LedgerSnapshot | None = None) -> None:
        self.restored = restored

    def put(self, ledger: LedgerSnapshot) -> None:
        """Write nothing."""

    def begin_anew(self, fault: FasacoError | None, why: str) -> None:
        """Set nothing aside."""


def _cannot_write(file: LedgerFile, error: Exception) -> LedgerFileError:
    return LedgerFileError(
        f"cannot write {file.path}: {reason_of(error)}",
        hint="progress is kept in memory, and writing is retried; free space, make the folder "
        "writable, or choose another (mission.state_dir, --state)",
    )
