"""Notifications to the service manager by the protocol of sd_notify(3), and its watchdog."""

from __future__ import annotations

import logging
import math
import os
import socket
import time
import weakref
from collections.abc import MutableMapping
from typing import TYPE_CHECKING

from fasaco_edge.text import one_line

if TYPE_CHECKING:
    from fasaco_edge.daemon.loop.worker import PlanningWorker
    from fasaco_edge.wire.documents.status import Status

LOG = logging.getLogger(__name__)

# Timeout of messages sent only once, for a busy manager at boot [s]; other messages must not delay
# the loop.
PATIENCE_S = 1.0
# Limit on the line that `systemctl status` shows [characters].
MOST_CHARS = 500
# Period as a share of the watchdog's timeout, as a cycle may be late, and a message may be lost.
SHARE = 0.25


class ServiceManager:
    """The manager that started this process; without effect outside a service.

    Each notification is one datagram.

    Attributes:
        is_present: whether there is a manager.
        watchdog_s: time without a notification after which it ends this process [s]; 0 for none.
    """

    def __init__(self, environ: MutableMapping[str, str] = os.environ) -> None:
        """Remove the variables from ``environ``, so that no child process uses them."""
        address = environ.pop("NOTIFY_SOCKET", "")
        silence_us = environ.pop("WATCHDOG_USEC", "0")
        is_ours = environ.pop("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        # "@" stands for the NUL of a name in the abstract namespace.
        self._address = f"\0{address[1:]}" if address.startswith("@") else address
        self.is_present = bool(address)
        # Kept open, as a process without free descriptors still has to feed the watchdog.
        self._out = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) if address else None
        if self._out is not None:
            weakref.finalize(self, self._out.close)
        self.watchdog_s = int(silence_us) / 1e6 if is_ours and silence_us.isdecimal() else 0.0
        self._status = ""

    def ready(self) -> None:
        """Report that the service is up, or that its configuration is reloaded."""
        self._send("READY=1", PATIENCE_S)

    def status(self, text: str) -> None:
        """Set the status line of the service."""
        if text != self._status and self._send("STATUS=" + one_line(text, MOST_CHARS)):
            self._status = text

    def alive(self) -> None:
        """Feed the watchdog; due at least every ``watchdog_s``."""
        self._send("WATCHDOG=1")

    def extend(self, seconds: float) -> None:
        """Extend the time allowed for startup [s]."""
        self._send(f"EXTEND_TIMEOUT_USEC={seconds * 1e6:.0f}")

    def reloading(self) -> None:
        """Report that the configuration is being reloaded; ``ready`` follows."""
        now_us = time.clock_gettime_ns(time.CLOCK_MONOTONIC) // 1000
        self._send(f"RELOADING=1\nMONOTONIC_USEC={now_us}", PATIENCE_S)

    def stopping(self) -> None:
        """Report that the service ends."""
        self._send("STOPPING=1")

    def _send(self, text: str, patience_s: float = 0.0) -> bool:
        """Send a datagram; return whether it was accepted."""
        if self._out is None:
            return True
        try:
            self._out.settimeout(patience_s)
            self._out.sendto(text.encode(), self._address)
        except OSError as error:
            why = "the service manager does not accept %s: %s"
            LOG.warning(why, text.partition("=")[0], error, extra={"event": "unheard"})
            return False
        return True


class Watchdog:
    """Feeds the service manager's watchdog, from the loop and only while planning progresses.

    A separate thread would still feed it while the loop hangs.

    Attributes:
        remark: added to the status line of the service; "" for nothing.
    """

    def __init__(self, manager: ServiceManager) -> None:
        self.remark = ""
        self._manager = manager
        self._period_s = SHARE * manager.watchdog_s
        self._notified_at = float("-inf")
        self._progress = -1
        self._state = ""
        self._troubles: frozenset[str] = frozenset()

    def beat(self, worker: PlanningWorker | None, now: float) -> None:
        """Feed the watchdog if due, and if the worker, if any, has made progress."""
        if not self._period_s or now - self._notified_at < self._period_s:
            return
        if worker is not None:
            if worker.progress == self._progress:
                return
            self._progress = worker.progress
        self._notified_at = now
        self._manager.alive()

    def show(self, status: Status) -> None:
        """Set a status as the service's status line; log changes of state and troubles."""
        if status.state != self._state:
            self._state = status.state
            LOG.info("%s", _doing(status), extra={"event": "state", "state": self._state})
        for each in status.troubles:
            if each.code not in self._troubles:
                about = {"event": "trouble", "code": each.code}
                LOG.warning("%s: %s", each.text, each.do, extra=about)
        self._troubles = frozenset(each.code for each in status.troubles)
        remark = f"; {self.remark}" if self.remark else ""
        self._manager.status(status_line(status) + remark)


def status_line(status: Status) -> str:
    """Return a status as a line: state and reason, share covered, faults."""
    parts = [_doing(status)]
    if coverage := status.coverage:
        # Never 100 % before all cells are covered.
        parts.append(f"{math.floor(100 * coverage.fraction)} % of cells covered")
    if floor := status.floor:
        areas = f"{floor.swept_m2:.0f}"
        if floor.reached_m2 is not None:
            areas = f"{floor.reached_m2:.0f} of {floor.reachable_m2:.0f}"
        parts.append(f"{areas} m2 of floor swept")
    if path := status.path:
        parts.append(f"path {path.revision} with {path.remaining_steps} steps to go")
    # The reason of a degraded mission is one of the troubles.
    parts += [each.text for each in status.troubles if each.text != status.reason]
    if fault := status.ledger.fault:
        parts.append(fault)
    return "; ".join(parts)


def _doing(status: Status) -> str:
    return f"{status.state}: {status.reason}" if status.reason else status.state
