"""What a follower says keeps the robot from driving its path. Times are [s]."""

from __future__ import annotations

import math

from fasaco_edge.mission.core.events import FollowerBlocked

# A follower says it once a second; what it has not said for so long is over.
SHOWN_S = 3.0
# A path that it cannot join, or drive without anything to plan around, is laid anew this often.
AGAIN_S = 5.0


class BlockedFollower:
    """Keeps the newest report."""

    def __init__(self) -> None:
        self._newest: FollowerBlocked | None = None
        self._at = self._asked_at = -math.inf

    def note(self, event: FollowerBlocked, now: float) -> None:
        """Note a report."""
        self._newest, self._at = event, now

    def why(self, now: float) -> str:
        """Return what keeps the robot from driving; "" for nothing."""
        report = self._report(now)
        return f"the robot stands: {report.detail}, for {report.held_s:.0f} s" if report else ""

    def asks_again(self, now: float) -> str:
        """Return why the path is to be laid anew from where the robot is, or "" for now."""
        report = self._report(now)
        if report is None or report.points or now - self._asked_at < AGAIN_S:
            return ""
        self._asked_at = now
        return f"the robot cannot follow it: {report.detail}"

    def _report(self, now: float) -> FollowerBlocked | None:
        return self._newest if now - self._at <= SHOWN_S else None
