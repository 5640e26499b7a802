"""The frontier: cells the robot can come to, beside what the map does not know yet.

Where the robot is sent only to look: for a way to a zone, or into what is closed off.

The agenda: what of the order is still to be done, on the map as it is now.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Polygon, Window
from fasaco_edge.grid.lattice import UNKNOWN, Cell
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.coverage.ledger_keeper import LedgerKeeper
from fasaco_edge.mission.coverage.progress import MOST_TRIES, LeftOver
from fasaco_edge.mission.coverage.unreached import Leftovers, Unreached
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.map.reachable_area import ReachableArea
from fasaco_edge.mission.orders.order import Zone
from fasaco_edge.mission.orders.order_state import NO_ORDER, OrderState, Stage
from fasaco_edge.mission.orders.zones import in_zones
from fasaco_edge.planners.problem import CoverageProblem

# Around a cell from which nothing new was seen, others show nothing new either [cells].
SEEN_AROUND = 1


def next_frontier(ground: ReachableArea, polygon: Polygon, looked: Iterable[Cell]) -> Cell | None:
    """Return the frontier cell (row, col) nearest to a polygon's corners [m], in a straight line.

    Args:
        ground: what the robot can come to.
        polygon: where it wants to get.
        looked: cells it has looked from already; what is close to them is left out.
    """
    lattice, window = ground.lattice, ground.lattice.window
    # Beyond the lattice nothing is known.
    unknown = np.pad(lattice.states == UNKNOWN, 1, constant_values=True)
    beside = unknown[:-2, 1:-1] | unknown[2:, 1:-1] | unknown[1:-1, :-2] | unknown[1:-1, 2:]
    rows, cols = np.nonzero(ground.reachable & beside)
    rows, cols = rows + window.row0, cols + window.col0
    for row, col in looked:
        away = np.maximum(abs(rows - row), abs(cols - col)) > SEEN_AROUND
        rows, cols = rows[away], cols[away]
    if not len(rows):
        return None
    x, y = (cols + 0.5) * lattice.cell_m, (rows + 0.5) * lattice.cell_m
    nearest = np.min([np.hypot(x - px, y - py) for px, py in polygon], axis=0)
    best = int(np.argmin(nearest))
    return int(rows[best]), int(cols[best])


@dataclass(slots=True)
class Exploration:
    """Cells to look from.

    Attributes:
        viewpoints: cells (row, col) to look from, and not yet driven to.
        looked: cells from which a way to the zone was looked for.
    """

    viewpoints: set[Cell] = field(default_factory=set)
    looked: set[Cell] = field(default_factory=set)

    def seek(self, zone: Zone | None, ground: ReachableArea | None, cell: Cell) -> str:
        """Look for a way to a zone the robot cannot come to; return why a plan is wanted, or "".

        At the border of the known, cell by cell, until the zone is in reach or all was looked at.
        """
        if zone is None or zone.polygon is None or ground is None or is_in_reach(zone, ground):
            return ""
        self.looked |= {cell}
        goal = next_frontier(ground, zone.polygon, self.looked)
        if goal is None:
            return ""
        self.looked.add(goal)
        self.viewpoints = {goal}
        return f"looking for a way to zone {zone.name!r}"

    def note(self, zone: Zone | None, ground: ReachableArea) -> None:
        """Look no more for a zone that can be reached now."""
        if zone is not None and self.viewpoints and is_in_reach(zone, ground):
            self.viewpoints.clear()

    def gives_up(self) -> bool:
        """Note that a viewpoint was not come to; tell whether the zone may be seen from others."""
        another = bool(self.looked and self.viewpoints)
        if another:
            self.viewpoints.clear()
        return another

    def mark(self, cells: NDArray[np.bool_], window: Window) -> None:
        """Set the viewpoints in ``cells``, bool (rows, cols) of ``window``."""
        for row, col in self.viewpoints:
            if window.row0 <= row < window.row1 and window.col0 <= col < window.col1:
                cells[row - window.row0, col - window.col0] = True


def is_in_reach(zone: Zone, ground: ReachableArea) -> bool:
    """Tell whether the robot can come to any cell of a zone."""
    inside = in_zones((zone,), ground.lattice.window, ground.lattice.cell_m)
    return bool((inside & ground.reachable).any())


@dataclass(slots=True)
class _Memory:
    """What is only known as long as the daemon lives.

    Attributes:
        lookout: where to look from.
        left_over: whether paths still get anything done.
        retry_at: when what is blocked or left over is tried again [s]; None if nobody waits.
        ending: how the order came to its end.
    """

    lookout: Exploration = field(default_factory=Exploration)
    left_over: LeftOver = field(default_factory=LeftOver)
    retry_at: float | None = None
    ending: str = "the order was carried out"


class Sequencer:
    """Goes through an order: zones pass by pass, what was left over once more, the way home.

    Attributes:
        assignment: the order, and how far it is.
    """

    def __init__(self, config: MissionConfig, site: MapState, log: LedgerKeeper) -> None:
        self.assignment = OrderState.idle(NO_ORDER)
        self._config = config
        self._site = site
        self._log = log
        self._memory = _Memory()
        self._leftovers = Leftovers(site, log)
        # Whether anything is worth trying again, and as of when.
        self._counted: tuple[object, bool] = (None, False)

    @property
    def waiting(self) -> bool:
        """Whether the robot stands until it is time to try again."""
        return self._memory.retry_at is not None

    @property
    def can_plan(self) -> bool:
        """Whether a plan would have anything to cover."""
        return self.assignment.stage is not Stage.RETURNING and self._left() > 0

    @property
    def ending(self) -> str:
        """How the order came to its end."""
        return self._memory.ending

    def take(self, assignment: OrderState) -> None:
        """Begin with another order, or with none."""
        self.assignment, self._memory = assignment, _Memory()
        self._counted = (None, False)
        self._leftovers.begin_anew()

    def see(self) -> None:
        """Remember what can be reached now."""
        self._leftovers.see()

    def pass_by(self, cell: Cell) -> None:
        """Note that the robot has come to ``cell``."""
        self._memory.lookout.viewpoints.discard(cell)

    def begin(self, cell: Cell, now: float) -> str:
        """Begin what is due, the robot being in ``cell``; return why a plan is wanted, or ""."""
        if self._memory.retry_at is not None and not self._worth_trying():
            self.go_on(now)
        if self._memory.retry_at is not None:
            return self._begin_try(cell) if now >= self._memory.retry_at else ""
        assignment = self.assignment
        if assignment.begun or assignment.order is None or assignment.stage is Stage.OVER:
            return ""
        zone = assignment.current_zone
        if zone is not None and not (assignment.order.keep_covered and assignment.pass_number == 1):
            cell_m = self._config.footprint.cell_m
            self._log.forget(lambda window: in_zones((zone,), window, cell_m))
        self.assignment = replace(assignment, begun=True, home=assignment.home or cell)
        self._memory.left_over = LeftOver()
        if assignment.pass_number == 1:
            self._memory.lookout.looked.clear()
        return "" if assignment.automatic else assignment.title

    def problem(
        self,
        cell: Cell,
        before: NDArray[np.int32],
        *,
        attempt: int = 0,
    ) -> CoverageProblem:
        """Return the problem of what is still to be covered now.

        Args:
            cell: where the robot is.
            before: int32 (n, 2), the path from there on.
            attempt: see ``CoverageProblem``.

        Raises:
            NothingToCover: nothing is.
        """
        ground, assignment = self._site.ground, self.assignment
        assert ground is not None
        lattice, home = ground.lattice, assignment.home
        self._memory.lookout.note(assignment.current_zone, ground)
        ends_home = (
            home is not None
            and assignment.returns_home_next
            and lattice.contains(home)
            and ground.contains(home)
        )
        covered = ~self.open_cells(lattice.window)
        return CoverageProblem.of(
            lattice,
            cell,
            covered=covered,
            end=home if ends_home else None,
            cost=self._config.cost,
            before=before,
            attempt=attempt,
        )

    def seek(self, cell: Cell) -> str:
        """Look for a way to a zone out of reach; return why a plan is wanted, or ""."""
        return self._memory.lookout.seek(self.assignment.current_zone, self._site.ground, cell)

    def open_cells(self, window: Window) -> NDArray[np.bool_]:
        """Return which cells of ``window`` still need a visit, coverable or not."""
        order = self.assignment.order
        if order is None:
            return np.zeros((window.rows, window.cols), bool)
        zone = self.assignment.current_zone
        zones = order.zones if zone is None else (zone,)
        wanted = in_zones(zones, window, self._config.footprint.cell_m)
        open_cells: NDArray[np.bool_] = wanted & (self._log.ledger.visits(window) == 0)
        self._memory.lookout.mark(open_cells, window)
        return open_cells

    def gives_up(self) -> bool:
        """Note that a path came to its end; return whether what it left over has to wait."""
        memory, cells = self._memory, self._left()
        self._leftovers.failures += cells > 0
        memory.left_over = memory.left_over.after(cells)
        return memory.left_over.given_up and not memory.lookout.gives_up()

    def go_on(self, now: float) -> None:
        """Go on to what comes next: all that could be done now is done."""
        assignment, memory = self.assignment, self._memory
        memory.lookout.viewpoints.clear()
        following = assignment.next_pass()
        if following is not assignment:
            self.assignment = following
            return
        if assignment.stage is Stage.RETRYING and not self.waiting:
            assignment = replace(assignment, tries=assignment.tries + 1)
        if assignment.stage is Stage.RETURNING:
            self._end()
            return
        # What is left is counted over all zones from here on.
        self.assignment = replace(assignment, stage=Stage.RETRYING)
        if assignment.tries < self._config.retries and self._worth_trying():
            if memory.retry_at is None:
                memory.retry_at = now + self._config.retry_s
        elif assignment.returns_home_next:
            memory.retry_at = None
            self.assignment = replace(assignment, stage=Stage.RETURNING, begun=False)
        else:
            self._end()

    def reopen(self) -> None:
        """Let an order that stands go on: the map has changed since it was over."""
        if self.assignment.automatic and self.assignment.stage is Stage.OVER:
            self.assignment = replace(self.assignment, stage=Stage.COVERING)

    def waits_for(self) -> str:
        """Return in words what the robot waits for before it tries again."""
        cells, config = self.unreached().cells, self._config
        return (
            f"{cells} {'cell' if cells == 1 else 'cells'} not reached: tried again after "
            f"{config.retry_s:g} s ({self.assignment.tries + 1} of {config.retries})"
        )

    def unreached(self) -> Unreached:
        """Return what of the order stays uncovered as things are."""
        return self._leftovers.unreached(self.assignment)

    def _begin_try(self, cell: Cell) -> str:
        memory = self._memory
        memory.retry_at, memory.lookout.viewpoints = None, self._closed_off() - {cell}
        # One path that changes nothing is enough this time.
        memory.left_over = LeftOver(self._left(), MOST_TRIES)
        return f"tried again, {self.assignment.tries + 1} of {self._config.retries}"

    def _end(self) -> None:
        left, order = self._left(), self.assignment.order
        self._memory.retry_at = None
        self.assignment = replace(self.assignment, stage=Stage.OVER)
        every = order is None or order.zones[0].polygon is None
        self._memory.ending = f"every reachable cell{'' if every else ' of the zones'} is covered"
        if left:
            self._memory.ending += f" but {left} left over"

    def _worth_trying(self) -> bool:
        """Tell whether there is anything to be tried again; counted anew if anything changed."""
        key = (self._site.ground, self._log.ledger.total)
        if key != self._counted[0]:
            self._counted = key, bool(self._left() or self._closed_off())
        return self._counted[1]

    def _left(self) -> int:
        """Return how many reachable cells still need a visit."""
        ground = self._site.ground
        if ground is None:
            return 0
        return int(np.count_nonzero(self.open_cells(ground.lattice.window) & ground.reachable))

    def _closed_off(self) -> set[Cell]:
        """Return the cells to look at closed areas from."""
        order, ground = self.assignment.order, self._site.ground
        if order is None or ground is None:
            return set()
        return self._leftovers.viewpoints(order, ground)
