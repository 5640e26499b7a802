"""Clock of a follower: the computer's time, or a simulation's by the stamps of its poses.

A simulation runs at a multiple of real time, or slower if the computer cannot keep up. By the
computer's time, a follower would then consider fresh poses old, and expect the robot too far ahead.
"""

from __future__ import annotations

# A simulation's time advances at most this far without a pose [s], as poses come ten times a
# second.
LEAD_S = 0.09
# After this real time without a pose [s], the simulation counts as stopped, and time goes on.
SILENT_S = 2.0
# Stamps that jump back, or forward by more than this, come from another simulation [s].
JUMP_S = 5.0


class Clock:
    """The robot's time, which is the computer's or a simulation's, and never goes back.

    Args:
        pace: simulated seconds per second; 1 for the computer's time.
    """

    def __init__(self, pace: float) -> None:
        self._pace = pace
        self._stamp_ns: int | None = None
        # The simulation's time at the newest pose, and the arrival of that pose.
        self._time = self._received_at = 0.0

    def at(self, now: float) -> float:
        """Return the robot's time at a monotonic time of the computer."""
        if self._stamp_ns is None:
            return now * self._pace
        since = max(now - self._received_at, 0.0)
        lead = min(since * self._pace, LEAD_S)
        return self._time + lead + max(since - SILENT_S, 0.0) * self._pace

    def take_stamp(self, stamp_ns: int, now: float) -> float:
        """Take in the stamp of a pose that arrived at ``now``; return the robot's time then."""
        if self._pace == 1.0:
            return now
        time = self.at(now)
        if self._stamp_ns is not None:
            step = (stamp_ns - self._stamp_ns) * 1e-9
            if 0.0 <= step <= JUMP_S:
                time = max(time, self._time + step)
        self._stamp_ns, self._time, self._received_at = stamp_ns, time, now
        return time
