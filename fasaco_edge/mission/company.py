"""Company: the interface of a mission to other robots in its building, here for a single robot.

The mission of a robot in a fleet gets the ``Company`` of ``fleet.mission`` instead, by a
``company_kind``; it knows nothing else of the fleet. The company of a fleet divides the area among
robots, and decides which robot waits for which.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Window
from fasaco_edge.mission.coverage.ledger import Cells, LedgerSnapshot

if TYPE_CHECKING:
    # For types only: an idle daemon loads no kernels.
    from fasaco_edge.grid.lattice import Cell
    from fasaco_edge.mission.core.events import Doing, MemberReceived, State
    from fasaco_edge.mission.map.reachable_area import ReachableArea

OpenCells = Callable[[Window], NDArray[np.bool_]]
Inside = Callable[[Cells, Cells], NDArray[np.bool_]]


class OthersCells:
    """The cells that other robots have swept, a part of the ledger; here none.

    The ledger keeps cells from an earlier fleet until this robot forgets cells of its own: a fleet
    that it joins again would count the forgotten cells as swept.

    Attributes:
        version: counter of changes.
        epoch: changes whenever this robot forgets cells.
    """

    version = epoch = 0

    def __init__(self) -> None:
        self._kept = b""

    def swept(self, window: Window) -> NDArray[np.bool_]:
        """Return which cells of ``window`` others have swept, bool (rows, cols), read-only."""
        return np.zeros((window.rows, window.cols), np.bool_)

    def begin(self, epoch: int) -> None:
        """Start an epoch with a number new to this robot's ledgers; a restored epoch stays."""

    def note_forgotten(self) -> None:
        """Note that this robot has forgotten some of its own cells."""
        self._kept = b""

    def disregard(self, inside: Inside) -> None:
        """Disregard all earlier sweeps of the cells that a mask function selects."""

    def clear(self) -> None:
        """Forget all that others reported: it belongs to another frame or building."""
        self._kept = b""

    def enter(self, frame: str) -> None:
        """Note the active frame."""

    def leave_building(self, frame: str) -> None:
        """Note that the map in a frame shows another building: cells of others lie elsewhere."""
        self._kept = b""

    def begin_anew(self) -> None:
        """Accept the next map as one that others share."""
        self._kept = b""

    def snapshot(self, cell_m: float) -> LedgerSnapshot:
        """Return the cells swept by others as one ledger."""
        return LedgerSnapshot(cell_m, "", 0, MappingProxyType({}))

    def encode(self) -> bytes:
        """Return everything as bytes, to be stored with the ledger; b"" for nothing."""
        return self._kept

    def resume(self, kept: bytes) -> None:
        """Restore the bytes of ``encode``."""
        self._kept = kept


class Company:
    """The other robots, and this robot's part of the area; here no others, and the whole area."""

    @property
    def has_members(self) -> bool:
        """Whether messages of other robots have come."""
        return False

    @property
    def has_company(self) -> bool:
        """Whether other robots are at work on the remaining area."""
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
            open_cells: mask function: a window to the cells that still need a visit.
            cell: this robot's cell.
            now: time [s].
            at_once: whether this robot is out of work.
        """
        return ""

    def mine(self, cells: NDArray[np.bool_], area: ReachableArea) -> NDArray[np.bool_]:
        """Return which cells are this robot's to sweep."""
        return cells

    def mine_to_sweep(
        self, cells: NDArray[np.bool_], unvisited: NDArray[np.bool_], area: ReachableArea
    ) -> NDArray[np.bool_]:
        """Return the cells on which this robot sweeps the floor, visited or not."""
        return cells

    def untried(self, cells: NDArray[np.bool_], area: ReachableArea) -> NDArray[np.bool_]:
        """Return the cells that this robot has not given up."""
        return cells

    def give_up(self, cells: NDArray[np.bool_], area: ReachableArea) -> None:
        """Leave cells that this robot tried in vain to the others, also after new maps."""

    def pass_over(self, cells: NDArray[np.bool_], area: ReachableArea) -> None:
        """Leave cells that this robot cannot reach to the others, until the next map."""

    def try_again(self) -> None:
        """Clear the list of cells given up."""

    def passable(self, area: ReachableArea, cell: Cell, radius_m: float) -> ReachableArea:
        """Return an area as a robot in ``cell`` can drive it: around robots in the way."""
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

    def succeed(self, before: Waiting) -> None:
        """Take over the state of a predecessor."""

    def decide(self, state: State, now: float, *, may_drive: bool) -> Doing | None:
        """Return what the robot does while it waits or makes way; None if it need not.

        Args:
            state: of the mission so far.
            now: time [s].
            may_drive: whether inputs, map and dock let the robot drive.
        """
        return None

    def why_stuck(self, now: float) -> str:
        """Return why the robot seems stuck for good, or ""."""
        return ""
