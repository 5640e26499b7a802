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

    def forget_ground(self) -> None:
        """Forget the ground of others: it belongs to another map."""

    def share(self, open_cells: OpenCells, cell: Cell, now: float, *, at_once: bool = False) -> str:
        """Divide the remaining area again if worthwhile; return why a plan is wanted, or "".

        Args:
            open_cells: returns which cells of a window still need a visit.
            cell: this robot's cell.
            now: time [s].
            at_once: whether this robot is out of work.
        """
        return ""

    def mine(
        self,
        cells: NDArray[np.bool_],
        area: ReachableArea,
        unvisited: NDArray[np.bool_] | None = None,
    ) -> NDArray[np.bool_]:
        """Return the cells that this robot has to visit.

        With ``unvisited``, a part of ``cells``, return the cells on which it has to sweep floor.
        """
        return cells

    def give_up(self, cells: NDArray[np.bool_], area: ReachableArea) -> NDArray[np.bool_] | None:
        """Leave this robot's part of cells tried in vain to the others, until ``try_again``.

        Returns:
            The cells that this robot has not given up; None if no others are at work.
        """
        return None

    def pass_over(self, cells: NDArray[np.bool_], area: ReachableArea) -> bool:
        """Leave this robot's part of cells that it cannot reach to the others, until the next map.

        Returns:
            Whether there were such cells; False if no others are at work.
        """
        return False

    def try_again(self) -> None:
        """Clear the list of cells given up."""

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
