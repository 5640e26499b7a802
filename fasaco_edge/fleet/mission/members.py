"""Members of a fleet: the other robots, their last messages, and the robots that block the way."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.errors import FleetError
from fasaco_edge.fleet.mission.refuge import without
from fasaco_edge.fleet.mission.shared import MOST_ROBOTS, SharedProgress
from fasaco_edge.fleet.mission.shared_ground import SharedGround
from fasaco_edge.fleet.mission.traffic import OLD_S, Neighbour, least_apart_m
from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import Cell
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.events import MemberReceived
from fasaco_edge.states import AT_WORK

# Timeouts of a silent robot, and of a robot at work that does not move [s]; least motion [m].
GONE_S, HANGING_S, STANDING_M = 5.0, 8.0, 0.05
# Plans avoid a standing robot until it is this far from its place [m]: more than the noise of its
# poses.
LEFT_M = 0.2

# ``Member.absence`` of a silent robot.
GONE = "gone"


@dataclass(slots=True)
class Member:
    """State of another robot.

    Attributes:
        newest: its newest message.
        received_at: time of its newest message [s].
        left_out: why it does not belong to this fleet; "" if it does.
        place: its position x, y at its last motion [m].
        moved_at: time of the last motion [s].
        left_at: when it last stopped work soon after a division [s].
    """

    newest: MemberReceived
    received_at: float
    left_out: str
    place: tuple[float, float]
    moved_at: float
    left_at: float = float("-inf")

    def has_moved(self, message: MemberReceived) -> bool:
        """Return whether the robot has moved, has started to work, or has just ended a wait."""
        has_begun = self.newest.state not in AT_WORK and message.state in AT_WORK
        has_begun |= bool(self.newest.waits_for) and not message.waits_for
        return has_begun or math.dist(self.place, (message.x, message.y)) > STANDING_M

    def absence(self, now: float) -> str:
        """Return why the robot takes no part in the work at ``now``; "" if it does."""
        if self.left_out:
            return self.left_out
        if now - self.received_at > GONE_S:
            return GONE
        if self.newest.state not in AT_WORK:
            return self.newest.state
        is_hanging = now - self.moved_at > HANGING_S and not self.newest.waits_for
        return "stands" if is_hanging else ""


class Members:
    """Tracks the other robots.

    Attributes:
        known: the others, by name.
        ground: the cells that the others can reach, except robots that are left out.
    """

    def __init__(self, ledger: MissionLedger, cell_m: float) -> None:
        self.known: dict[str, Member] = {}
        self.ground = SharedGround()
        self._ledger, self._cell_m = ledger, cell_m
        # Places of robots that stand in the way [m], by name.
        self._avoided: dict[str, tuple[float, float]] = {}
        self.shared.clears(self.ground.clear)

    def neighbours(self, now: float) -> dict[str, Neighbour]:
        """Return the other robots in this robot's frame, except silent robots.

        The place of a silent robot is not known; this robot's map may show it.
        """
        return {
            name: Neighbour(
                member.newest,
                now - member.received_at,
                now - member.moved_at,
                member.newest.step_s / self._cell_m,
                self._is_at_avoided(name),
            )
            for name, member in self.known.items()
            if not member.left_out and now - member.received_at < OLD_S
        }

    @property
    def shared(self) -> SharedProgress:
        """The cells that the others have swept."""
        shared = self._ledger.shared
        assert isinstance(shared, SharedProgress)
        return shared

    def avoid(self, robot: str) -> None:
        """Plan around a robot where it stands now, until it moves."""
        newest = self.known[robot].newest
        self._avoided[robot] = newest.x, newest.y

    def is_avoided(self, robot: str) -> bool:
        """Return whether paths are planned around a robot."""
        return robot in self._avoided

    def _is_at_avoided(self, robot: str) -> bool:
        """Return whether paths are planned around a robot that still stands there."""
        place, member = self._avoided.get(robot), self.known.get(robot)
        if place is None or member is None or member.left_out:
            return False
        return math.dist(place, (member.newest.x, member.newest.y)) < LEFT_M

    def forget_silent(self, now: float) -> str:
        """Stop planning around silent robots; return the name of one of them, or "".

        Only this robot's map shows whether a silent robot still stands there.
        """
        silent = [
            name
            for name in sorted(self._avoided)
            if name not in self.known or now - self.known[name].received_at >= OLD_S
        ]
        for name in silent:
            del self._avoided[name]
        return silent[0] if silent else ""

    def closed(self, area: ReachableArea, radius_m: float) -> NDArray[np.bool_] | None:
        """Return the cells blocked by robots in the way, bool (rows, cols); None without robots."""
        for name in list(self._avoided):
            if not self._is_at_avoided(name):
                del self._avoided[name]
        if not self._avoided:
            return None
        window, cell_m = area.lattice.window, area.lattice.cell_m
        closed = np.zeros(area.reachable.shape, np.bool_)
        for name, (x, y) in self._avoided.items():
            clear_m = least_apart_m(radius_m, self.known[name].newest)
            # Only cells around the robot are checked, as lattices are large.
            (row0, row1), (col0, col1) = (
                (math.floor((at - clear_m) / cell_m), math.ceil((at + clear_m) / cell_m))
                for at in (y, x)
            )
            near = Window(row0, col0, row1, col1).intersection(window)
            if near is None:
                continue
            rows, cols = np.ogrid[near.row0 : near.row1, near.col0 : near.col1]
            apart = np.hypot((cols + 0.5) * cell_m - x, (rows + 0.5) * cell_m - y)
            closed[near.slices_in(window)] |= apart < clear_m
        return closed

    def passable(self, area: ReachableArea, cell: Cell, radius_m: float) -> ReachableArea:
        """Return the part of an area reachable from ``cell`` around robots in the way."""
        closed = self.closed(area, radius_m)
        if closed is None or not area.contains(cell):
            return area
        lattice = area.lattice
        closed[lattice.local(cell)] = False
        return ReachableArea.around(replace(lattice, steps=without(lattice.steps, closed)), cell)

    def receive(self, event: MemberReceived, now: float) -> str:
        """Take in another robot's message; return why it requires a plan, or "".

        Raises:
            FleetError: there is no room for its data.
        """
        before, frame = self.known.get(event.robot), self._ledger.current.frame
        left_out = event.misfit or self.shared.why_misplaced(frame)
        if not left_out and event.frame not in ("", frame):
            left_out = f"its frame is {event.frame!r}, here it is {frame!r}"
        place, moved_at = (event.x, event.y), now
        if before is None:
            self._make_room(event.robot, now)
        elif not before.has_moved(event):
            place, moved_at = before.place, before.moved_at
        left_at = float("-inf") if before is None else before.left_at
        member = Member(event, now, left_out, place, moved_at, left_at)
        self.known[event.robot] = member
        if left_out:
            self.ground.drop(event.robot)
            return ""
        if before is not None and before.newest.lattice != event.lattice:
            self.ground.drop(event.robot)
        swept = event.robot, event.epoch, event.tiles
        try:
            is_open_again = self.shared.receive(*swept, self.known, event.kept, event.lattice)
        except FleetError as error:
            self.known[event.robot] = replace(member, left_out=str(error))
            self.ground.drop(event.robot)
            raise
        self.ground.receive(event.robot, event.ground)
        return f"{event.robot}: cells must be swept again" if is_open_again else ""

    def division_numbers(self) -> dict[str, int]:
        """Return the number of the last division that each robot has sent, by name."""
        return {name: m.newest.division for name, m in self.known.items() if not m.left_out}

    def note_left(self, names: set[str], now: float) -> None:
        """Note that robots have stopped work soon after a division."""
        for name in self.known.keys() & names:
            self.known[name] = replace(self.known[name], left_at=now)

    def _make_room(self, robot: str, now: float) -> None:
        """Make room for another robot: remove the robot silent for longest, if it has timed out.

        Robots that send are kept: otherwise one robot beyond the limit would displace the others in
        turn, and cause a new division each time.
        """
        if len(self.known) < MOST_ROBOTS:
            return
        name = min(self.known, key=lambda name: (self.known[name].received_at, name))
        if now - self.known[name].received_at <= GONE_S:
            raise FleetError(f"{robot}: at most {MOST_ROBOTS} others of a fleet are kept")
        del self.known[name]
        self.ground.drop(name)
