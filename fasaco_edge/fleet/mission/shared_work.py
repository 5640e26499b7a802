"""Shared work of a fleet: the robots that take part, the cells left, and the newest division.

A robot without a part stands still while the others make progress, so as not to obstruct them. The
division with the higher number is newer; between equal numbers, the author whose name sorts first
wins. Numbers too far ahead are errors of their sender.
"""

from __future__ import annotations

from collections.abc import Iterable

from fasaco_edge.fleet.mission.division import Division, Robot
from fasaco_edge.fleet.mission.members import GONE, GONE_S, Members
from fasaco_edge.grid.geometry import MOST_INDEX, Pose2D
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.reachable_area import ReachableArea, anchor_cell
from fasaco_edge.mission.events import MemberReceived

# Others make no progress once the number of swept cells has not grown for this long [s].
STUCK_S = 30.0
# Others make no progress once all have waited for this long: they may wait for this robot [s].
WAITING_S = 6.0


class Remainder:
    """Tracks the cells left for a fleet.

    Attributes:
        others_go_on: whether only parts of other robots are left, and these robots make progress.
            If they sweep nothing for STUCK_S, they count as stuck until this robot has a part.
        had_part: whether the last division gave this robot a part.
        cells_divided: number of cells left when that division was made.
    """

    def __init__(self) -> None:
        self.others_go_on = self.had_part = False
        self.cells_divided = 0
        # Largest number of swept cells since this robot had a part, and when it last grew; None
        # while it has a part. The number of cells left is no measure: others also find new cells.
        self._most: tuple[int, float] | None = None
        # Time since which all others wait; None while one of them is at work.
        self._waiting_since: float | None = None

    def note_others(self, now: float, *, wait: bool) -> None:
        """Note whether all other robots at work wait for another robot."""
        if not wait:
            self._waiting_since = None
        elif self._waiting_since is None:
            self._waiting_since = now

    def note(self, cells: int, own: int, swept: int, now: float) -> None:
        """Take in numbers of cells: left, left in this robot's part, and swept.

        ``own`` includes cells that only maps of others show: the robot goes there to look.
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
        """Take in the numbers of cells after a new division, see ``note``."""
        self.had_part, self.cells_divided = own > 0, cells
        self.note(cells, own, swept, now)


# Largest number of a division; largest lead of a received number over this robot's own, more than
# a day's divisions; largest number that a robot takes over when it joins.
MOST_NUMBER, MOST_AHEAD, MOST_FIRST = 2**31 - 1, 2**16, 2**24


class DivisionNumbers:
    """Numbers the divisions of one robot, checks the numbers of others, and decides who takes part.

    All robots have to agree on who takes part: each robot makes a new division if the last division
    leaves out a robot that takes part. If two robots do not receive each other, or a map shows no
    way between them, a third robot decides.

    Attributes:
        number: number of the newest division.
        by: name of the robot that made it.
    """

    def __init__(self, robot: str, others: Members) -> None:
        self.number = 0
        self.by = ""
        self._robot, self._others = robot, others

    def newer(self) -> MemberReceived | None:
        """Return the newest valid division received that is newer than this robot's, or None.

        Divisions without a part for this robot are skipped: their authors take it for absent.
        """
        most = self._most_valid()
        found = [
            member.newest
            for member in self._others.known.values()
            if not member.left_out
            and member.newest.division <= most
            and any(part.robot == self._robot for part in member.newest.parts)
        ]
        first = min(found, key=lambda message: (-message.division, message.by), default=None)
        mine = -self.number, self.by
        return first if first and (-first.division, first.by) < mine else None

    def follow(self, newer: MemberReceived) -> None:
        """Take over the number of a received division."""
        self.number, self.by = newer.division, newer.by

    def number_own(self) -> None:
        """Number a division that this robot makes: above all valid numbers received."""
        most = self._most_valid()
        numbers = [one for one in self._others.division_numbers().values() if one <= most]
        self.number, self.by = min(max([self.number, *numbers]) + 1, MOST_NUMBER), self._robot

    def _most_valid(self) -> int:
        numbers = self._others.division_numbers()
        first = min((number for number in numbers.values() if number), default=0)
        return (self.number or min(first, MOST_FIRST)) + MOST_AHEAD

    def in_reach(self, area: ReachableArea, now: float) -> list[Robot]:
        """Return the robots at work that are within this robot's reachable area."""
        robots = []
        for name, member in self._others.known.items():
            place = anchor_cell(area.lattice, Pose2D(member.newest.x, member.newest.y))
            if not member.absence(now) and place is not None and area.contains(place):
                robots.append(Robot(name, place, member.newest.step_s))
        return robots

    def unseen(
        self,
        division: Division | None,
        lattice: CoverageLattice,
        robots: Iterable[Robot],
        divided_at: float,
        now: float,
    ) -> list[Robot]:
        """Return the robots of the last division that take part, but are not in reach.

        This robot's map shows no way to them, or their messages no longer arrive, but the author of
        the division still reaches them. If they were left out, they would make a division of their
        own, without the robots that they do not receive.
        """
        found, seen = [], {robot.name for robot in robots}
        for part in () if division is None else division.parts:
            if part.robot in seen or self.is_gone(part.robot, divided_at, now):
                continue
            member = self._others.known.get(part.robot)
            if member is None or member.absence(now):
                found.append(Robot(part.robot, part.seed, part.step_s))
                continue
            row, col = lattice.cell_at(member.newest.x, member.newest.y)
            # The cell is sent as seed of the robot's part; a message cannot hold larger indices.
            if max(abs(row), abs(col)) <= MOST_INDEX:
                found.append(Robot(part.robot, (row, col), member.newest.step_s))
        return found

    def is_gone(self, name: str, divided_at: float, now: float) -> bool:
        """Return whether a robot no longer takes part in a division made at ``divided_at`` [s]."""
        member = self._others.known.get(name)
        if member is None:
            return now - divided_at > GONE_S and not self._is_vouched(now)
        absence = member.absence(now)
        return bool(absence) and not (absence == GONE and self._is_vouched(now))

    def _is_vouched(self, now: float) -> bool:
        """Return whether the division's author is another robot, at work, that still sends it.

        The author may receive robots that this robot does not. If this robot left them out, the two
        would replace each other's division endlessly.
        """
        maker = self._others.known.get(self.by)
        if maker is None or maker.absence(now):
            return False
        return maker.newest.division == self.number
