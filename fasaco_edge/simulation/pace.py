"""Simulated time against wall time."""

from __future__ import annotations


class Pace:
    """Says when the next tick is due, so that ``speed`` simulated seconds pass in a second.

    A machine that cannot keep up falls behind by ``patience_s`` at most; what is more
    is forgiven, so that the simulation slows down instead of racing later.

    Args:
        speed: simulated seconds per second, above 0.
        tick_s: simulated length of a tick [s].
        now_s: reading of a monotonic clock [s]; the first tick is due then.
        patience_s: longest debt kept [s].
    """

    def __init__(self, speed: float, tick_s: float, now_s: float, patience_s: float = 0.1) -> None:
        self._interval_s = tick_s / speed
        self._due_s = now_s
        self._patience_s = patience_s

    def behind_s(self, now_s: float) -> float:
        """Return since when the next tick is due [s]; below 0, until when it is not."""
        return now_s - self._due_s

    def ticked(self, now_s: float) -> None:
        """Note that a tick was run."""
        self._due_s = max(self._due_s + self._interval_s, now_s - self._patience_s)
