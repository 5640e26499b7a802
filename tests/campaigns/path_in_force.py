"""A judge of stops from outside: what the bus says is driven, against what the planner says.

While the planner's state is one at rest, the newest path is empty; else it is the one that the
status names. Path and status are two messages: what differs between them may do so for a moment.
"""

from __future__ import annotations

from typing import Any

# The states in which a robot drives, or soon will; in all others it rests.
DRIVING = ("planning", "covering", "returning", "degraded")
# So long after a status that differs from the path one of them has to follow [s].
GRACE_S = 0.6


class PathInForce:
    """Follows the paths and statuses of all daemons of a name.

    Attributes:
        judged: number of statuses that were compared with a path.
    """

    def __init__(self) -> None:
        self.judged = 0
        # Points and revision of the newest path; None before one.
        self._path: tuple[int, int] | None = None
        # Since when path and status differ [s]; None where they agree.
        self._since: float | None = None

    def see_path(self, points: int, revision: int) -> None:
        """Note a path."""
        self._path, self._since = (points, revision), None

    def why_broken(self, status: dict[str, Any], at: float) -> str:
        """Return what does not hold by a status that came at ``at`` [s]; "" where all does."""
        if status["claim"]["stand"] != "plans" or self._path is None:
            return ""
        points, revision = self._path
        rests = status["state"] not in DRIVING
        named = status["path"] and status["path"]["revision"]
        is_another = points > 0 and named != revision
        if not ((rests and points) or is_another):
            self._since = None
            self.judged += 1
            return ""
        if self._since is None:
            self._since = at
        if at - self._since <= GRACE_S:
            return ""
        return (
            f"for {at - self._since:.1f} s: {status['state']} ({status['reason']}), path {named} "
            f"in the status, {points} points of path {revision} on the bus"
        )
