"""Robots at work: which of the others take part in a division, and where."""

from __future__ import annotations

from collections.abc import Iterable

from fasaco_edge.fleet.mission.division import Division, Robot
from fasaco_edge.fleet.mission.division_numbers import DivisionNumbers
from fasaco_edge.fleet.mission.members import GONE, GONE_S, Members
from fasaco_edge.grid.geometry import MOST_INDEX, Pose2D
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.mission.map.reachable_area import ReachableArea, anchor_cell


class AtWork:
    """Decides which of the other robots take part.

    A robot divides again if a participant is left out, so all robots have to agree. If two robots
    do not receive each other, or one map shows no way between them, a third robot decides.
    """

    def __init__(self, others: Members, numbers: DivisionNumbers) -> None:
        self._others, self._numbers = others, numbers

    def in_reach(self, area: ReachableArea, now: float) -> list[Robot]:
        """Return the robots at work in an area that this robot can reach."""
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
        """Return robots of the last division that take part, but are out of this robot's reach.

        Its map shows no way to them, or their messages no longer arrive, but the robot that made
        the division still reaches them. If left out, they would make a division of their own, and
        leave out the robots that they do not reach.

        Args:
            division: the last division.
            lattice: the cells to divide.
            robots: the robots that this one reaches.
            divided_at: when the last division was made or taken over [s].
            now: time [s].
        """
        found, seen = [], {robot.name for robot in robots}
        last = () if division is None else zip(division.robots, division.seeds, strict=True)
        for robot, seed in last:
            if robot.name in seen or self.is_gone(robot.name, divided_at, now):
                continue
            member = self._others.known.get(robot.name)
            if member is None or member.absence(now):
                found.append(Robot(robot.name, seed, robot.step_s))
                continue
            row, col = lattice.cell_at(member.newest.x, member.newest.y)
            # A seed farther away does not fit into a message.
            if max(abs(row), abs(col)) <= MOST_INDEX:
                found.append(Robot(robot.name, (row, col), member.newest.step_s))
        return found

    def is_gone(self, name: str, divided_at: float, now: float) -> bool:
        """Return whether a robot no longer takes part in a division made at ``divided_at`` [s]."""
        member = self._others.known.get(name)
        if member is None:
            return now - divided_at > GONE_S and not self._is_vouched(now)
        absence = member.absence(now)
        return bool(absence) and not (absence == GONE and self._is_vouched(now))

    def _is_vouched(self, now: float) -> bool:
        """Return whether the division's author is another robot at work that still sends it.

        It receives robots that this one does not: the two would divide again and again, one with
        and one without these robots.
        """
        maker = self._others.known.get(self._numbers.by)
        if maker is None or maker.absence(now):
            return False
        return maker.newest.division == self._numbers.number
