"""Remainder: how many cells are left for a fleet, and whether others sweep them all.

A robot without a part stands while the others go on: it would be in their way.
"""

from __future__ import annotations

# Others go on while the number of cells left has changed within this time [s].
STUCK_S = 30.0


class Remainder:
    """Follows what is left for a fleet.

    Attributes:
        others_go_on: whether all that is left is others' to sweep, and becomes less.
        had_part: whether the last division gave this robot a part.
        divided: number of cells left at that time.
    """

    def __init__(self) -> None:
        self.others_go_on = self.had_part = False
        self.divided = 0
        self._cells, self._changed_at = 0, float("-inf")

    def note(self, cells: int, own: int, now: float) -> None:
        """Take in the numbers of cells left, in all and in this robot's part.

        A part that other robots' maps show alone is a part: this robot has to come to see it.
        """
        if cells != self._cells:
            self._cells, self._changed_at = cells, now
        self.others_go_on = cells > 0 and own == 0 and now - self._changed_at <= STUCK_S

    def note_division(self, cells: int, own: int, now: float) -> None:
        """Take in a new division, as ``note`` does."""
        self.had_part, self.divided = own > 0, cells
        self.note(cells, own, now)
