"""The watchdog: progress and state for the service manager; durations of cycles and plans."""

from __future__ import annotations

import logging
import math
import time
from typing import TYPE_CHECKING

from fasaco_edge.daemon.notify import ServiceManager
from fasaco_edge.wire.status import LoopTimes, Status

if TYPE_CHECKING:
    from fasaco_edge.daemon.loop.worker import PlanningWorker

LOG = logging.getLogger(__name__)

# Of the longest silence allowed: a cycle may be late, and a message may get lost.
SHARE = 0.25

# A cycle longer than this [s] makes what arrives meanwhile late.
LATE_S = 0.1
# Durations are counted to within 10 %, in logarithmic buckets, the last for all beyond 18 minutes:
# so the figures of a year take as much memory as those of a minute.
LEAST_S, PER_DOUBLING, BUCKETS = 1e-6, 8, 8 * 30


class CycleTimes:
    """Durations of the cycles of the loop since its start."""

    def __init__(self) -> None:
        self._counts = [0] * BUCKETS
        self._turns = self._late = 0
        self._longest_s = 0.0

    def note(self, seconds: float) -> None:
        """Count a cycle."""
        doublings = math.log2(max(seconds, LEAST_S) / LEAST_S)
        self._counts[min(int(doublings * PER_DOUBLING), BUCKETS - 1)] += 1
        self._turns += 1
        self._late += seconds > LATE_S
        self._longest_s = max(self._longest_s, seconds)

    def report(self) -> LoopTimes:
        """Return the figures as part of a status [ms]; None before the first cycle."""
        if not self._turns:
            return LoopTimes()
        shares = (0.5, 0.99, 0.999, 1.0)
        within_ms = (round(1e3 * self._within(share), 3) for share in shares)
        return LoopTimes(self._turns, self._late, *within_ms)

    def _within(self, share: float) -> float:
        """Return the duration that this share of the cycles did not exceed [s]."""
        missing = math.ceil(share * self._turns)
        for bucket, count in enumerate(self._counts[:-1]):
            missing -= count
            if missing <= 0:
                most_s = LEAST_S * math.exp2((bucket + 1) / PER_DOUBLING)
                return min(most_s, self._longest_s)
        return self._longest_s


class Watchdog:
    """Notifies the service manager's watchdog, from the loop and only while planning progresses.

    A thread of its own would go on beside a loop that hangs.

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

    def beat(self, worker: PlanningWorker | None, now: float) -> None:
        """Notify the watchdog if that is due, and the worker, if any, has made progress."""
        if not self._period_s or now - self._notified_at < self._period_s:
            return
        if worker is not None:
            if worker.progress == self._progress:
                return
            self._progress = worker.progress
        self._notified_at = now
        self._manager.alive()

    def tell(self, status: Status) -> None:
        """Show a status as the service's status line; log it when the state changes."""
        if status.state != self._state:
            self._state = status.state
            LOG.info("%s", _doing(status), extra={"event": "state", "state": self._state})
        remark = f"; {self.remark}" if self.remark else ""
        self._manager.status(status_line(status) + remark)


def status_line(status: Status) -> str:
    """Return a status as a line: its state and why, how much is covered, what is wrong."""
    parts = [_doing(status)]
    if coverage := status.coverage:
        area = f"{coverage.covered_m2:.0f} of {coverage.to_cover_m2:.0f} m2"
        parts.append(f"{100 * coverage.fraction:.0f} % covered, {area}")
    if path := status.path:
        parts.append(f"path {path.revision} with {path.remaining_steps} steps to go")
    if fault := status.ledger.fault:
        parts.append(fault)
    return "; ".join(parts)


def _doing(status: Status) -> str:
    return f"{status.state}: {status.reason}" if status.reason else status.state


class MapLatency:
    """Time from the arrival of a map that calls for a plan to that plan's path.

    Attributes:
        arrived: when the newest map of this cycle arrived [s, monotonic]; None without one.
    """

    def __init__(self) -> None:
        self.arrived: float | None = None
        # Arrival of the oldest map that no plan was asked for yet, and of the one
        # that the plan under way was asked for.
        self._unanswered: float | None = None
        self._asked: float | None = None

    def call_for_plan(self) -> None:
        """Note that the newest map calls for a plan."""
        self._unanswered = self._unanswered or self.arrived

    def ask(self) -> None:
        """Note that a plan was asked for."""
        self._asked, self._unanswered = self._unanswered, None

    def answer(self) -> float | None:
        """Return how long it took until now [s]; None where no map had called for the plan."""
        return None if self._asked is None else time.monotonic() - self._asked
