"""Blocked follower: the follower's report of what keeps the robot from its path. Times are [s]."""

from __future__ import annotations

import math

from fasaco_edge.mission.core.events import FollowerBlocked

# A follower repeats its report once a second; a report not repeated for this long is over.
SHOWN_S = 3.0
# Period of new paths for a follower that cannot join its path, or is blocked at an unknown place.
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
        """Return why a new path from the robot's place is due, or ""."""
        report = self._report(now)
        if report is None or report.points or now - self._asked_at < AGAIN_S:
            return ""
        self._asked_at = now
        return f"the robot cannot follow it: {report.detail}"

    def _report(self, now: float) -> FollowerBlocked | None:
        return self._newest if now - self._at <= SHOWN_S else None
