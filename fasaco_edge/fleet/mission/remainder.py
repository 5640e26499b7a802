"""Remainder: how many cells are left for a fleet, and whether others sweep them all.

A robot without a part stands while the others make progress: it would be in their way.
"""

from __future__ import annotations

# Others make progress if the number of swept cells has grown within this time [s].
STUCK_S = 30.0
# They make none once all of them have waited for this long, perhaps for this robot [s].
WAITING_S = 6.0


class Remainder:
    """Tracks the cells left for a fleet.

    Attributes:
        others_go_on: whether only parts of other robots are left, and these make progress. Once
            they have swept nothing for STUCK_S, they count as stuck until this robot has a part.
        had_part: whether the last division gave this robot a part.
        divided: number of cells left at that time.
    """

    def __init__(self) -> None:
        self.others_go_on = self.had_part = False
        self.divided = 0
        # Largest number of swept cells since this robot has no part, and its time; None while it
        # has a part. The number of cells left may grow as others sweep, by cells that they find.
        self._most: tuple[int, float] | None = None
        # Since when all others wait; None while one is at work.
        self._waiting_since: float | None = None

    def note_others(self, now: float, *, wait: bool) -> None:
        """Note whether all other robots at work wait for one, perhaps for this robot."""
        if not wait:
            self._waiting_since = None
        elif self._waiting_since is None:
            self._waiting_since = now

    def note(self, cells: int, own: int, swept: int, now: float) -> None:
        """Take in the numbers of cells left, in all and in this robot's part, and of cells swept.

        Cells of its part that only other robots' maps show count, too: it has to go and see them.
        """
        if own > 0:
            self._most, self.others_go_on = None, False
            return
        most, since = self._most or (swept, now)
        is_stuck = now - since > STUCK_S
        self._most = (swept, now) if swept > most and not is_stuck else (most, since)
        waiting_s = 0.0 if self._waiting_since is None else now - self._waiting_since
        self.others_go_on = cells > 0 and not is_stuck and waiting_s <= WAITING_S

    def note_division(self, cells: int, own: int, swept: int, now: float) -> None:
        """Take in a new division, as ``note`` does."""
        self.had_part, self.divided = own > 0, cells
        self.note(cells, own, swept, now)
