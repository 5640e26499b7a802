"""Fleet layer: this robot's part of the area that remains for a fleet.

There is no leader. Any robot that finds a reason divides the remaining area again and publishes the
division. Each robot uses the division with the highest number; between equal numbers, the author's
name that sorts first wins. While two robots disagree, cells may be swept twice, but none is left
out: a robot that finishes takes over a part of the remaining area.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.fleet.mission.division import Division, Robot, divide
from fasaco_edge.fleet.mission.members import Members
from fasaco_edge.fleet.mission.shared import MOST_ROBOTS
from fasaco_edge.fleet.mission.shared_ground import viewpoint
from fasaco_edge.fleet.mission.shared_work import DivisionNumbers, Remainder
from fasaco_edge.grid.lattice import Cell, Footprint
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.mission.company import Company, OpenCells
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.events import MemberReceived, Part
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.planners.cost import CoverageCost

# Period of checks; least age of a division at which a new division replaces it, in general and for
# balance [s]. A robot that leaves causes a new division at once.
LOOK_S, HOLDS_S, EVEN_S = 1.0, 2.0, 10.0
# Parts are rebalanced only above this ratio and this difference [s].
UNEVEN, UNEVEN_S = 1.25, 40.0
# Number of cells of this robot's part that others sweep before it plans again. A robot that only
# passes through sweeps fewer: in unknown buildings, a value of 4 cost two robots 7 % of their time.
MANY_TAKEN = 30
Mask = NDArray[np.bool_]
LATER = "another robot has a newer division"


class FleetLayer(Company):
    """Divides the remaining area among the robots; inactive without a fleet.

    Attributes:
        others: the other robots.
        numbers: the newest division's number and author.
        step_s: this robot's time to sweep one cell [s].
    """

    def __init__(
        self,
        robot: str,
        cost: CoverageCost,
        footprint: Footprint,
        map_state: MapState,
        ledger: MissionLedger,
    ) -> None:
        self.others = Members(ledger, footprint.cell_m)
        self._radius_m = footprint.robot_radius_m
        self.numbers = DivisionNumbers(robot, self.others)
        self._robot, self.step_s = robot, cost.step_s
        self._turn_steps = cost.quarter_turn_s / cost.step_s
        self._map, self._ledger = map_state, ledger
        self._division: Division | None = None
        self._divided_at = self._looked_at = float("-inf")
        # A joint area, and the owners of its cells.
        self._owners: tuple[ReachableArea | None, NDArray[np.int8]]
        self._owners = None, np.zeros((0, 0), np.int8)
        # Joint area of the last check, kept because others send their ground many times a second.
        self._seen: tuple[ReachableArea, ReachableArea] | None = None
        # Number of own cells that others had swept at the last plan; version of the shared progress
        # at the last check.
        self._taken, self._counted = 0, 0
        self._remainder = Remainder()

    def receive(self, event: MemberReceived, now: float) -> str:
        """Take in another robot's message; return why it requires a plan, or ""."""
        return self.others.receive(event, now)

    def passable(self, area: ReachableArea, cell: Cell) -> ReachableArea:
        """Return the part of an area reachable from ``cell`` around robots in the way."""
        return self.others.passable(area, cell, self._radius_m)

    @property
    def has_members(self) -> bool:
        """Whether messages of other robots have arrived."""
        return bool(self.others.known)

    def busiest(self, open_cells: OpenCells) -> str:
        """Return the name of the other robot with the most cells left in its part, or ""."""
        area, division = self._map.area, self._division
        if area is None or division is None:
            return ""
        joint, left = self._left(open_cells, area)
        return division.busiest(self._owners_on(division, joint)[left], self._robot)

    def viewpoints(self, open_cells: OpenCells, cell: Cell) -> Iterator[Cell]:
        """Yield viewpoints for cells that only maps of others show.

        First for cells of this robot's part, then for any cells beyond doors open on these maps.
        """
        area, division = self._map.area, self._division
        if area is None or not self.others.known:
            return
        if division is not None:
            joint, left = self._left(open_cells, area)
            if at := viewpoint(area, joint, left & self._of_me(division, joint), cell):
                yield at
        beyond = self.others.ground.with_doors(area)
        if at := viewpoint(area, beyond, open_cells(beyond.lattice.window), cell):
            yield at

    def _left(self, open_cells: OpenCells, area: ReachableArea) -> tuple[ReachableArea, Mask]:
        """Return the joint area, and which of its cells are left, bool (rows, cols)."""
        joint = self._joint(area)
        return joint, open_cells(joint.lattice.window) & joint.reachable

    def _joint(self, area: ReachableArea) -> ReachableArea:
        if self._seen is None or self._seen[0] is not area:
            self._seen = area, self.others.ground.joint(area)
        return self._seen[1]

    @property
    def others_go_on(self) -> bool:
        """Whether only parts of other robots are left, and these robots make progress."""
        return self._division is not None and self._remainder.others_go_on

    def part(self, left: Mask, area: ReachableArea) -> Mask | None:
        """Return this robot's part of an area; None without a division. See ``Company.part``."""
        if self._division is None:
            return None
        own = self._is_own(self._division, area)
        goes_on = self.others_go_on or (left & own & area.reachable).any()
        return own if goes_on else np.ones_like(own)

    def share(self, open_cells: OpenCells, cell: Cell, now: float, *, at_once: bool = False) -> str:
        """Divide the remaining area again if worthwhile, see ``Company.share``."""
        area = self._map.area
        if silent := self.others.forget_silent(now):
            return f"{silent} is silent: only the map shows whether it stands in the way"
        if area is None or not self.others.known:
            return ""
        if not (at_once or now - self._looked_at >= LOOK_S):
            return self._why_by_taken()
        self._looked_at, self._seen = now, None
        (joint, left), before = self._left(open_cells, area), self._division
        inside = area.lattice.window.slices_in(joint.lattice.window)
        own = left if before is None else left & self._of_me(before, joint)
        at_work = [one.newest for one in self.others.known.values() if not one.absence(now)]
        self._remainder.note_others(now, wait=all(other.waits_for for other in at_work))
        swept = self._ledger.shared.swept(joint.lattice.window) & joint.reachable
        swept_cells = int(np.count_nonzero(swept))
        self._remainder.note(int(left.sum()), int(own.sum()), swept_cells, now)
        if newer := self.numbers.newer():
            why = LATER
            self.numbers.follow(newer)
            self._division = Division.of(newer.parts)
        else:
            robots = [Robot(self._robot, cell, self.step_s), *self.numbers.in_reach(joint, now)]
            if not (why := self._why_anew(joint, left, robots, now, at_once=at_once)):
                return self._why_by_taken()
            robots += self.numbers.unseen(before, joint.lattice, robots, self._divided_at, now)
            # Other robots refuse messages with more parts.
            robots = robots[: MOST_ROBOTS + 1]
            divided = divide(joint.lattice, left, robots, before, self._turn_steps)
            if divided != before:
                self.numbers.number_own()
                self._division = divided if len(robots) > 1 else None
        self._divided_at, self._owners = now, (None, self._owners[1])
        self._taken = self._count_taken()
        after = left if self._division is None else left & self._of_me(self._division, joint)
        self._remainder.note_division(int(left.sum()), int(after.sum()), swept_cells, now)
        return why if (own != after)[inside].any() else ""

    @property
    def parts(self) -> tuple[Part, ...]:
        """The newest division, as it is sent to other robots."""
        return () if self._division is None else self._division.parts

    def part_cells(self) -> int | None:
        """Return the number of cells in this robot's part; None if it has all cells."""
        if self._division is None or self._map.area is None:
            return None
        area = self._map.area
        return int(np.count_nonzero(self._is_own(self._division, area) & area.reachable))

    def _why_anew(
        self, joint: ReachableArea, left: Mask, robots: list[Robot], now: float, *, at_once: bool
    ) -> str:
        division = self._division
        names = {robot.name for robot in robots}
        known = set() if division is None else set(division.names)
        if len(names) == 1 and division is None:
            return ""
        gone = sorted(
            name
            for name in known - names - {self._robot}
            if self.numbers.is_gone(name, self._divided_at, now)
        )
        if gone:
            if now - self._divided_at < EVEN_S:
                self.others.note_left(set(gone), now)
            return f"{', '.join(gone)} no longer at work"
        if now - self._divided_at < HOLDS_S and not at_once:
            return ""
        # A robot that leaves and returns repeatedly would change all paths each time.
        new = names - known - {self._robot}
        if more := sorted(name for name in new if now - self.others.known[name].left_at >= EVEN_S):
            return f"shared with {', '.join(more)}"
        return "" if division is None else self._why_by_parts(division, joint, left, names, now)

    def _why_by_parts(
        self, division: Division, joint: ReachableArea, left: Mask, names: set[str], now: float
    ) -> str:
        """Return why the parts should change, or ""; ``names``: this robot, and robots in reach."""
        owners = self._owners_on(division, joint)
        cells = np.bincount(owners[left], minlength=len(division.parts))
        if not cells[division.names.index(self._robot)]:
            # After a division without a part for this robot, the same cells give it no part again.
            is_other = self._remainder.had_part or cells.sum() > self._remainder.cells_divided
            is_other |= now - self._divided_at >= EVEN_S
            return "own part is done" if left.any() and is_other else ""
        # This robot knows the cells left to each robot only if it can reach all of them.
        if not names.issuperset(division.names):
            return ""
        steps_s = np.array([part.step_s for part in division.parts])
        even_s = UNEVEN * cells.sum() / (1.0 / steps_s).sum() + UNEVEN_S
        is_uneven = (cells * steps_s).max() > even_s and now - self._divided_at >= EVEN_S
        return "parts have become uneven" if is_uneven else ""

    def _is_own(self, division: Division, area: ReachableArea) -> Mask:
        joint = self._joint(area)
        return self._of_me(division, joint)[area.lattice.window.slices_in(joint.lattice.window)]

    def _of_me(self, division: Division, joint: ReachableArea) -> Mask:
        mine = division.names.index(self._robot)
        return np.equal(self._owners_on(division, joint), mine)

    def _owners_on(self, division: Division, joint: ReachableArea) -> NDArray[np.int8]:
        if division is not self._division:
            return division.owners(joint.lattice)
        if self._owners[0] is not joint:
            self._owners = joint, division.owners(joint.lattice)
        return self._owners[1]

    def _why_by_taken(self) -> str:
        """Return why a plan is wanted after others swept cells of this robot's part, or ""."""
        if self._counted == self._ledger.shared.version:
            return ""
        taken = self._count_taken()
        self._taken = min(self._taken, taken)
        if taken < self._taken + MANY_TAKEN:
            return ""
        self._taken = taken
        return "others have swept cells of this robot's part"

    def _count_taken(self) -> int:
        self._counted = self._ledger.shared.version
        area = self._map.area
        if area is None:
            return 0
        window = area.lattice.window
        swept = self._ledger.shared.swept(window) & area.reachable
        swept &= self._ledger.current.visits(window) == 0
        if self._division is not None:
            swept = swept & self._is_own(self._division, area)
        return int(np.count_nonzero(swept))
