"""Metrics of the loop: faults by code, durations of cycles and plans."""

from __future__ import annotations

import logging
import math
import time
from collections import Counter
from collections.abc import Sequence

from fasaco_edge.errors import FasacoError, NotPublished
from fasaco_edge.wire.documents.status import ErrorCounts, LoopTimes

LOG = logging.getLogger(__name__)

# Cycles longer than this are late [s].
LATE_S = 0.1
# Durations are counted in logarithmic buckets, to within 10 % and up to 18 minutes, so that memory
# does not grow with uptime.
LEAST_S, PER_DOUBLING, BUCKETS = 1e-6, 8, 8 * 30


def log_fault(log: logging.Logger, fault: FasacoError) -> str:
    """Log a fault, with a traceback if a mission caught an exception; return its text."""
    text, cause = fault_text(fault), None
    if isinstance(fault, NotPublished):
        cause = fault.__cause__
    log.warning("%s", text, exc_info=cause, extra={"event": "fault", "code": fault.code})
    return text


def fault_text(fault: FasacoError) -> str:
    return f"{fault}: {fault.hint}" if fault.hint else str(fault)


class FaultCounter:
    """Counts faults by code, and logs them."""

    def __init__(self) -> None:
        self._by_code: Counter[str] = Counter()
        self._last = ""

    def count(self, faults: Sequence[FasacoError], *, is_logged: bool = False) -> None:
        """Count faults, and log them if they are not logged already."""
        for fault in faults:
            if not is_logged:
                log_fault(LOG, fault)
            self._by_code[fault.code] += 1
            self._last = str(fault)

    def counts(self) -> ErrorCounts:
        """Return the counts as part of a status."""
        return ErrorCounts(self._by_code.total(), self._last, dict(self._by_code))


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
        """Return the quantile of the durations for this share of the cycles [s]."""
        missing = math.ceil(share * self._turns)
        for bucket, count in enumerate(self._counts[:-1]):
            missing -= count
            if missing <= 0:
                most_s = LEAST_S * math.exp2((bucket + 1) / PER_DOUBLING)
                return min(most_s, self._longest_s)
        return self._longest_s


class MapLatency:
    """Time from the arrival of a map that needs a plan until the path of that plan is sent.

    Attributes:
        arrived: arrival of the newest map of this cycle [s, monotonic]; None without a map.
    """

    def __init__(self) -> None:
        self.arrived: float | None = None
        # Arrivals: of the oldest map for which no plan is requested yet, of the map being planned.
        self._unanswered: float | None = None
        self._asked: float | None = None

    def call_for_plan(self) -> None:
        """Note that the newest map needs a plan."""
        self._unanswered = self._unanswered or self.arrived

    def ask(self) -> None:
        """Note that a plan was requested."""
        self._asked, self._unanswered = self._unanswered, None

    def answer(self) -> float | None:
        """Return the latency until now [s]; None for a plan that no map required."""
        return None if self._asked is None else time.monotonic() - self._asked
