"""Failed tries, by place and by the direction in which the path leads; progress alone ends them.

A new path in the same direction leads into the same obstacle: it changes nothing. A path in another
direction has tries of its own. After each try there is a pause, twice as long as the one before.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fasaco_edge.grid.geometry import Point

# Directions nearer to each other than this are one [rad]: a place has at most eight.
ALIKE_RAD = math.pi / 4


@dataclass(slots=True)
class _Direction:
    """Tries in a direction.

    Attributes:
        toward: the direction [rad].
        tries: failed ones in a row.
        until: end of the pause [s].
    """

    toward: float
    tries: int = 0
    until: float = -math.inf


class Tries:
    """Counts failed tries in one place; forgets them once the robot has left it.

    Args:
        far: distance from the place that counts as progress [m].
        pause: after the first failed try [s].
        longest: pause [s].
        most: number of tries; after the last one only progress ends the pause.
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
        """Begin anew: there was progress."""
        self._place = None
        self._directions.clear()

    def failed(self, here: Point, toward: float, now: float, *, for_good: bool = False) -> None:
        """Note a failed try; ``for_good``: nothing but progress ends its pause."""
        if self._place is None:
            self._place = here
        direction = self._like(toward)
        if direction is None:
            direction = _Direction(toward)
            self._directions.append(direction)
        direction.tries += 1
        ends = for_good or direction.tries >= self._most
        # Exponents stay small: more doublings are longer than any pause.
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
        """Return the nearest direction that is alike; None for none."""

        def off(one: _Direction) -> float:
            return abs(math.remainder(one.toward - toward, math.tau))

        nearest = min(self._directions, key=off, default=None)
        return nearest if nearest is not None and off(nearest) < ALIKE_RAD else None
