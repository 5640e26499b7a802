"""Company: the interface of a mission to other robots in its building, here for a single robot.

The mission of a robot in a fleet gets the ``Company`` of ``fleet.mission`` instead, by a
``company_kind``; the mission knows nothing else of the fleet. The company of a fleet divides the
area among robots, and decides which robot waits for which.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window

if TYPE_CHECKING:
    # For types only: an idle daemon loads no kernels.
    from fasaco_edge.grid.lattice import Cell
    from fasaco_edge.grid.reachable_area import ReachableArea
    from fasaco_edge.mission.events import Doing, MemberReceived
    from fasaco_edge.states import State

OpenCells = Callable[[Window], NDArray[np.bool_]]


class Company:
    """The other robots, and this robot's part of the area; here no others, and the whole area."""

    @property
    def has_members(self) -> bool:
        """Whether messages of other robots have come."""
        return False

    @property
    def others_go_on(self) -> bool:
        """Whether only parts of other robots are left, and those robots make progress."""
        return False

    def receive(self, event: MemberReceived, now: float) -> str:
        """Take in another robot's message; return why it requires a plan, or ""."""
        return ""

    def share(self, open_cells: OpenCells, cell: Cell, now: float, *, at_once: bool = False) -> str:
        """Divide the remaining area again if worthwhile; return why a plan is wanted, or "".

        Args:
            open_cells: returns which cells of a window still need a visit, except those that this
                robot has given up.
            cell: this robot's cell.
            now: time [s].
            at_once: whether this robot is out of work.
        """
        return ""

    def part(self, left: NDArray[np.bool_], area: ReachableArea) -> NDArray[np.bool_] | None:
        """Return this robot's part of an area, bool (rows, cols); None if no others have a part.

        ``left``: the cells that need a visit. Once this robot's part has none of them in reach, and
        the others make no progress, the whole area is its part.
        """
        return None

    def passable(self, area: ReachableArea, cell: Cell) -> ReachableArea:
        """Return the part of an area reachable from ``cell`` around robots in the way."""
        return area

    def viewpoints(self, open_cells: OpenCells, cell: Cell) -> Iterator[Cell]:
        """Yield viewpoints for cells that only maps of others show."""
        return iter(())


class Waiting:
    """Decides when the robot waits or makes way for others; here, never.

    Attributes:
        waits_for: name of the robot that it waits for; "" for none.
    """

    waits_for = ""

    def continue_from(self, before: Waiting) -> None:
        """Take over the state of a predecessor."""

    def decide(self, state: State, now: float, *, may_drive: bool) -> Doing | None:
        """Return what the robot does while it waits or makes way; None if it does neither.

        Args:
            state: state of the mission so far.
            now: time [s].
            may_drive: whether inputs, map and dock let the robot drive.
        """
        return None

    def why_stuck(self, now: float) -> str:
        """Return why the robot seems permanently stuck, or ""."""
        return ""
