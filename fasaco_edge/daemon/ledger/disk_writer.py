"""The disk writer: a thread that writes changes to disk, so that a slow disk delays no caller."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

from fasaco_edge.daemon.counters import fault_text, log_fault
from fasaco_edge.errors import FasacoError

LOG = logging.getLogger(__name__)

# Time before a retry after a failure [s].
RETRY_S = 2.0
# Longest time that a command's reply waits for a slow disk [s].
MOST_WAIT_S = 1.0
# A disk hangs if a write takes longer than this [s]; memory cards pause for some seconds.
HANGS_S = 10.0

Item = TypeVar("Item")


class DiskWriter(Generic[Item]):
    """Writes the newest item; retries an item that cannot be written.

    Args:
        name: name of the items, for logs.
        write: writes an item; raises any error.
        fault_of: returns an error as a fault that says what to do.
        merge: joins an item that is not written yet with the next item; by default, the next item
            replaces it.

    Attributes:
        trouble: why the newest write failed; "" if it succeeded.
    """

    def __init__(
        self,
        name: str,
        write: Callable[[Item], None],
        fault_of: Callable[[Exception], FasacoError],
        merge: Callable[[Item, Item], Item] = lambda _, later: later,
    ) -> None:
        self.trouble = ""
        self._name, self._write, self._fault_of, self._merge = name, write, fault_of, merge
        self._faults = deque[FasacoError]()
        self._changed = threading.Condition()
        self._waiting: Item | None = None
        # Start of the present write; whether its hanging was reported.
        self._writes_since: float | None = None
        self._is_hang_reported = False
        self._is_stopping = False
        # Started with the first item.
        self._thread: threading.Thread | None = None

    def put(self, item: Item) -> None:
        """Write this item next."""
        with self._changed:
            self._wait(item)
            self._changed.notify()
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
            self._thread.start()

    def _wait(self, item: Item, *, is_older: bool = False) -> None:
        """Queue an item, merged with an item that waits already; the caller holds the lock."""
        if self._waiting is not None:
            pair = (item, self._waiting) if is_older else (self._waiting, item)
            item = self._merge(*pair)
        self._waiting = item

    def is_behind(self) -> bool:
        """Return whether a write is still due, and the newest write did not fail."""
        with self._changed:
            is_due = self._waiting is not None or self._writes_since is not None
            return is_due and not self.trouble

    def note(self, fault: FasacoError) -> str:
        """Log and count a fault; return its text."""
        self._faults.append(fault)
        return log_fault(LOG, fault)

    def take_faults(self) -> list[FasacoError]:
        """Return the faults since the last call; a lasting fault is returned once."""
        return [self._faults.popleft() for _ in range(len(self._faults))]

    def hang(self, now: float) -> str:
        """Return the fault of a hanging disk at ``now`` [s, monotonic], "" for none."""
        since = self._writes_since
        if since is None or now - since < HANGS_S:
            self._is_hang_reported = False
            return ""
        fault = self._fault_of(OSError(f"the disk has hung for {HANGS_S:g} s or more"))
        if not self._is_hang_reported:
            self._is_hang_reported = True
            self.note(fault)
        return fault_text(fault)

    def close(self, timeout_s: float) -> None:
        """Write pending changes and end the thread, within ``timeout_s`` [s]."""
        if self._thread is None:
            return
        with self._changed:
            self._is_stopping = True
            self._changed.notify()
        self._thread.join(timeout_s)
        if self._thread.is_alive():
            LOG.warning("the disk is too slow: the last changes of the %s may be lost", self._name)

    def _run(self) -> None:
        is_failed = False
        while True:
            with self._changed:
                if is_failed:
                    self._changed.wait_for(lambda: self._is_stopping, RETRY_S)
                else:
                    self._changed.wait_for(lambda: self._is_stopping or self._waiting is not None)
                if self._is_stopping and self._waiting is None:
                    return
                item, self._waiting = self._waiting, None
                assert item is not None
                self._writes_since, is_last = time.monotonic(), self._is_stopping
            is_failed = not self._try_to_write(item)
            with self._changed:
                self._writes_since = None
                if is_failed:
                    self._wait(item, is_older=True)
                    if is_last:
                        return

    def _try_to_write(self, item: Item) -> bool:
        try:
            self._write(item)
        except Exception as error:
            # No failure here may stop the mission.
            fault = self._fault_of(error)
            if str(fault) not in self.trouble:
                self.trouble = self.note(fault)
            return False
        if self.trouble:
            LOG.warning("%s: written again", self._name)
            self.trouble = ""
        return True
