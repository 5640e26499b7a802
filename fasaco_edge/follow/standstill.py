"""Standstill: how long something has kept the robot from driving, and its report to the daemon.

A standstill ends once the robot gets past the obstacle, or another path leads it away. The daemon
can plan around the obstacle, or make a new plan from the robot's position.

Failed tries to drive are counted for each place and direction of the path, until there is progress.
A new path in the same direction does not reset the count, as it leads into the same obstacle. After
each try there is a pause, twice as long as the last pause.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Final, Literal

from fasaco_edge.follow.supervision import FollowerState, Supervision
from fasaco_edge.grid.geometry import Point
from fasaco_edge.text import one_line
from fasaco_edge.wire.limits import MAX_BLOCKED_POINTS, MAX_STRING_BYTES

BlockedReason = Literal["obstacle", "stuck", "elsewhere"]

# Reported reasons, and the time after which each is reported [s].
REASONS: Final[dict[FollowerState, tuple[BlockedReason, float]]] = {
    FollowerState.OBSTACLE: ("obstacle", 5.0),
    FollowerState.NOT_MOVING: ("stuck", 3.0),
    FollowerState.STANDS: ("stuck", 5.0),
    FollowerState.GIVEN_UP: ("stuck", 1.0),
    FollowerState.PATH_ELSEWHERE: ("elsewhere", 2.0),
    FollowerState.OFF_PATH: ("elsewhere", 2.0),
}
# A standstill ends once the robot has moved this far [m], or had no reason for this long [s].
MOVED_M, GONE_S = 0.1, 2.0
# Period of the reports [s].
EVERY_S = 1.0
# Angles of the reported points to the direction of a base that does not move.
ANGLES_RAD = tuple(math.radians(angle) for angle in (0, -20, 20, -40, 40))


class Standstill:
    """Watches a follower; ``report`` is called once in each cycle."""

    def __init__(self) -> None:
        self._place: Point = math.inf, math.inf
        self._state: FollowerState | None = None
        self._since = self._last = self._reported_at = -math.inf

    def report(
        self, follower: Supervision, planner: str, revision: int, now: float
    ) -> bytes | None:
        """Return a report as JSON, see ``wire.documents.blocked``; None if none is due.

        ``planner``, ``revision``: the path's daemon and revision.
        """
        pose, state = follower.newest_pose, follower.state
        if state not in REASONS or pose is None:
            return None
        here = pose.x, pose.y
        has_moved = math.dist(here, self._place) > MOVED_M
        if has_moved or state is not self._state or now - self._last > GONE_S:
            self._place, self._state, self._since = here, state, now
        self._last = now
        (reason, least_s), held_s = REASONS[state], now - self._since
        if held_s < least_s or now - self._reported_at < EVERY_S:
            return None
        self._reported_at = now
        detail = follower.detail
        words = one_line(f"{state.value}: {detail}" if detail else state.value)
        document = {
            "daemon": planner,
            "revision": revision,
            "reason": reason,
            "detail": words.encode()[:MAX_STRING_BYTES].decode(errors="ignore"),
            "held_s": round(held_s, 1),
            "frame": follower.path_frame,
            "x": pose.x,
            "y": pose.y,
            "points": [(round(x, 3), round(y, 3)) for x, y in follower.ahead[:MAX_BLOCKED_POINTS]],
        }
        return json.dumps(document).encode()


def floor_ahead(here: Point, toward: float, radius: float) -> tuple[Point, ...]:
    """Return points on the edge of the robot's disc, ahead [m]; none if the radius is unknown.

    ``toward``: the path's direction [rad]; ``radius``: of the disc [m].
    """
    if not radius:
        return ()
    x, y = here
    angles = (toward + angle for angle in ANGLES_RAD)
    return tuple((x + radius * math.cos(a), y + radius * math.sin(a)) for a in angles)


# Directions nearer to each other than this count as the same [rad]: a place has at most eight.
ALIKE_RAD = math.pi / 4


@dataclass(slots=True)
class _Direction:
    """Number of failed tries in a direction [rad], and the end of the pause [s]."""

    toward: float
    tries: int = 0
    until: float = -math.inf


class Tries:
    """Counts failed tries in one place; forgets them once the robot has left the place.

    Args:
        far: distance from the place that counts as progress [m].
        pause: first pause, after the first failed try [s].
        longest: the longest pause [s].
        most: number of tries; after the last try only progress ends the pause.
    """

    def __init__(self, far: float, pause: float, longest: float, most: float = math.inf) -> None:
        self._far, self._pause, self._longest, self._most = far, pause, longest, most
        self._place: Point | None = None
        self._directions: list[_Direction] = []

    def moved_to(self, here: Point) -> None:
        """Take in the robot's position."""
        if self._place is not None and math.dist(here, self._place) >= self._far:
            self.forget()

    def forget(self) -> None:
        """Forget all tries."""
        self._place = None
        self._directions.clear()

    def note_failure(
        self, here: Point, toward: float, now: float, *, for_good: bool = False
    ) -> None:
        """Note a failed try; ``for_good``: only progress ends its pause."""
        if self._place is None:
            self._place = here
        if (direction := self._like(toward)) is None:
            self._directions.append(direction := _Direction(toward))
        direction.tries += 1
        ends = for_good or direction.tries >= self._most
        # The exponent is bounded, to avoid an overflow.
        pause = min(self._pause * 2.0 ** min(direction.tries - 1, 30), self._longest)
        direction.until = math.inf if ends else now + pause

    def tries(self, toward: float) -> int:
        """Return how many tries failed in a direction [rad]."""
        direction = self._like(toward)
        return 0 if direction is None else direction.tries

    def may_try(self, toward: float, now: float) -> bool:
        """Return whether a try in a direction [rad] is due."""
        direction = self._like(toward)
        return direction is None or now >= direction.until

    def _like(self, toward: float) -> _Direction | None:
        """Return the nearest similar direction with tries, or None."""
        off = {abs(math.remainder(one.toward - toward, math.tau)): one for one in self._directions}
        nearest = min(off, default=math.inf)
        return off[nearest] if nearest < ALIKE_RAD else None
