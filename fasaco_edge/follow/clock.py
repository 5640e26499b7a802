"""The robot's time [s]: the computer's, or a simulation's by the stamps of its poses.

A simulation runs at a multiple of the real speed, and slower where the computer cannot keep up. By
the computer's time, a follower would then consider fresh poses old, and expect the robot to have
gone further than it has.
"""

from __future__ import annotations

from typing import Protocol

# A simulation's time advances at most this far without a pose [s]: poses come ten times a second.
LEAD_S = 0.09
# After this long without a pose the simulation has stopped, and time goes on [s, real].
SILENT_S = 2.0
# Stamps that go back, or forward by more than this, are those of another simulation [s].
JUMP_S = 5.0


class Clock(Protocol):
    """The robot's time."""

    def at(self, now: float) -> float:
        """Return the robot's time at a monotonic time of the computer."""

    def hear(self, stamp_ns: int, now: float) -> float:
        """Take in the stamp of a pose that arrived then; return the robot's time of its arrival."""


class RealClock:
    """The computer's time."""

    def at(self, now: float) -> float:
        """Return the time unchanged."""
        return now

    def hear(self, _stamp_ns: int, now: float) -> float:
        """Return the time unchanged."""
        return now


class SimulatedClock:
    """A simulation's time; it never goes back.

    Args:
        pace: simulated seconds in a second.
    """

    def __init__(self, pace: float) -> None:
        self._pace = pace
        self._stamp_ns: int | None = None
        # Its time at the newest pose, and when that arrived.
        self._time = self._heard_at = 0.0

    def at(self, now: float) -> float:
        """Return the simulated time at a monotonic time of the computer."""
        if self._stamp_ns is None:
            return now * self._pace
        since = max(now - self._heard_at, 0.0)
        lead = min(since * self._pace, LEAD_S)
        return self._time + lead + max(since - SILENT_S, 0.0) * self._pace

    def hear(self, stamp_ns: int, now: float) -> float:
        """Take in the stamp of a pose; it arrives at the time that it says."""
        time = self.at(now)
        if self._stamp_ns is not None:
            step = (stamp_ns - self._stamp_ns) * 1e-9
            if 0.0 <= step <= JUMP_S:
                time = max(time, self._time + step)
        self._stamp_ns, self._time, self._heard_at = stamp_ns, time, now
        return time
