"""How long it takes from a map that calls for a plan until the path that answers it."""

from __future__ import annotations

import time


class MapClock:
    """Follows a map from its arrival over the plan it calls for to that plan's path.

    Attributes:
        arrived: when the newest map of this turn arrived [s, monotonic]; None without one.
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
