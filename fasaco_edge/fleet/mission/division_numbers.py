"""Numbers of divisions: which division is the newest, of those made here and those received.

The higher number is newer; between equal numbers the author's name that sorts first wins. Numbers
too far ahead are errors of their sender, unless it keeps sending them: then it has counted on while
it was out of range.
"""

from __future__ import annotations

from fasaco_edge.fleet.mission.members import Members
from fasaco_edge.mission.core.events import MemberHeard

# Limits on a division's number: absolute, ahead of this robot's own, and the first of a newcomer.
MOST_NUMBER, MOST_AHEAD, MOST_FIRST = 2**31 - 1, 2**10, 2**24
# How long a number ahead, but below the last limit, is sent until it is accepted [s].
BELIEVED_S = 10.0


class DivisionNumbers:
    """Numbers the divisions of one robot, and checks the numbers that others send.

    Attributes:
        number: number of the newest division.
        by: name of the robot that made it.
    """

    def __init__(self, robot: str, others: Members) -> None:
        self.number = 0
        self.by = ""
        self._robot, self._others = robot, others
        # Times of the first message of each robot whose number is too far ahead [s].
        self._too_far: dict[str, float] = {}

    def newer(self) -> MemberHeard | None:
        """Return the newest division received above ``number`` that has a part for this robot.

        Newer divisions without this robot are skipped: their author takes this robot for absent.
        """
        most = self._most_valid()
        found = [
            member.newest
            for member in self._others.known.values()
            if not member.left_out
            and member.newest.division <= most
            and any(part.robot == self._robot for part in member.newest.parts)
        ]
        first = min(found, key=lambda heard: (-heard.division, heard.by), default=None)
        mine = -self.number, self.by
        return first if first and (-first.division, first.by) < mine else None

    def follow(self, newer: MemberHeard) -> None:
        """Take over the number of a received division."""
        self.number, self.by = newer.division, newer.by

    def count_on(self) -> None:
        """Number a division that this robot makes: above all valid numbers received."""
        most = self._most_valid()
        heard = [one for one in self._others.division_numbers().values() if one <= most]
        self.number, self.by = min(max([self.number, *heard]) + 1, MOST_NUMBER), self._robot

    def _most_valid(self) -> int:
        """Return the highest number that is no error."""
        told = self._others.division_numbers()
        first = min((number for number in told.values() if number), default=0)
        most = (self.number or min(first, MOST_FIRST)) + MOST_AHEAD
        too_far = {name for name, number in told.items() if most < number <= MOST_FIRST}
        heard_at = {name: self._others.known[name].heard_at for name in too_far}
        self._too_far = {name: self._too_far.get(name, at) for name, at in heard_at.items()}
        is_long = {name for name in too_far if heard_at[name] - self._too_far[name] >= BELIEVED_S}
        return max([most, *(told[name] for name in is_long)])
