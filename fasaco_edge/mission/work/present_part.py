"""Present part of an order: the cells planned now, and when the robot gives them up."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import Cell
from fasaco_edge.mission.company import Company
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.rooms.room_cells import RoomCells
from fasaco_edge.mission.work.cells_left import CellsLeft
from fasaco_edge.mission.work.exploration import Exploration
from fasaco_edge.mission.work.order_reach import OrderReach
from fasaco_edge.mission.work.order_state import Stage
from fasaco_edge.mission.work.plan_scope import PlanScope
from fasaco_edge.mission.work.present_order import PresentOrder
from fasaco_edge.mission.work.uncovered import UncoveredCells
from fasaco_edge.planners.problem import CoverageProblem

# After this many paths in a row without a newly covered cell, the cells left wait for a retry. For
# instance, the robot may stop with its tool out of reach of the last cell.
MAX_IN_VAIN = 3
OTHERS_SEE = "looks for its part, which others see"
MAP_ENDS = "looks where the map ends: the floor there was covered before a restart"


class PresentPart:
    """Poses the problems of the part of an order that is due. Times are [s].

    Attributes:
        reach: the cells that have been reachable since the order began.
        uncovered: the cells that stay uncovered.
        cells: the cells left.
        scope: which of these cells are planned now, and how.
    """

    def __init__(
        self,
        config: MissionConfig,
        map_state: MapState,
        ledger: MissionLedger,
        company: Company,
        room_cells: RoomCells,
        order: PresentOrder,
    ) -> None:
        self._config, self._map, self._ledger, self._company = config, map_state, ledger, company
        self._order = order
        self.reach = OrderReach(map_state)
        self.uncovered = UncoveredCells(map_state, ledger, self.reach, order)
        # Number of cells done at the last path's end (-1 before the first path), and number of
        # paths in a row that did not increase it.
        self._done, self._in_vain = -1, 0
        # Whether the next plan begins a pass with other lanes than the previous pass.
        self._has_new_lanes = False
        self.cells = CellsLeft(config, map_state, ledger, company, order)
        self.scope = PlanScope(
            config, map_state, self.cells, company, room_cells, lambda: order.state
        )

    def begin_order(self) -> None:
        """Forget the viewpoints of the previous order, and the cells that it tried in vain."""
        self._order.exploration, self._has_new_lanes = Exploration(), False
        self.try_all()
        self.scope.begin_pass()

    def begin_pass(self, *, has_new_lanes: bool) -> None:
        """Try all cells of another pass; ``has_new_lanes``: whether it sets lanes of its own."""
        self._has_new_lanes = has_new_lanes
        self.try_all()
        if self._order.state.pass_number == 1:
            self._order.exploration.begin_zone()

    def begin_retry(self, cell: Cell) -> None:
        """Try the cells left once more, and look at closed areas; ``cell``: the robot's cell."""
        self._order.exploration.aim_at(self.uncovered.viewpoints() - {cell})
        self.try_all()
        # In a retry, one path without progress is enough to give up.
        self._done, self._in_vain = self.done, MAX_IN_VAIN

    def try_all(self) -> None:
        """Forget which cells were tried in vain."""
        self._done, self._in_vain = -1, 0
        self.cells.try_again()

    @property
    def can_plan(self) -> bool:
        """Whether a plan would have anything to cover."""
        return self._order.state.stage is not Stage.RETURNING and self.cells.left() > 0

    @property
    def waits_for_others(self) -> bool:
        """Whether only parts of other robots are left, and those robots make progress."""
        return self._company.others_go_on and not self.cells.left_to_me()

    def record_cell(self, cell: Cell) -> None:
        """Record that the robot is in ``cell``."""
        self._order.exploration.record_cell(cell)

    def problem(
        self, cell: Cell, before: NDArray[np.int32], home: Cell | None, *, attempt: int = 0
    ) -> CoverageProblem:
        """Return the planning problem of the cells that are open now, see ``PlanScope.problem``."""
        area = self._map.area
        assert area is not None
        self._order.exploration.end_if_reached(self._order.state.current_zone, area)
        problem = self.scope.problem(cell, before, home, attempt)
        # A repair would keep the lanes of the previous pass.
        is_full, self._has_new_lanes = self._has_new_lanes, False
        return replace(problem, is_full=is_full)

    def explore(self, cell: Cell) -> str:
        """Look for a path to an unreachable zone or part; return why a plan is wanted, or ""."""
        exploration, zone = self._order.exploration, self._order.state.current_zone
        area = self._map.area
        free = None if area is None else self._company.passable(area, cell)
        if reason := exploration.seek(zone, area, free, cell):
            return reason
        of_others = self._company.viewpoints(self.cells.untried, cell)
        ends = self.cells.ends_of_map(cell) if self.reach.is_map_cut else ()
        viewpoints = chain(((at, OTHERS_SEE) for at in of_others), ((at, MAP_ENDS) for at in ends))
        looks = (exploration.look_beyond(at, cell, why) for at, why in viewpoints)
        return next(filter(None, looks), "")

    def why_standing(self, now: float) -> str:
        """Return why the robot stands although a plan is wanted, or ""."""
        if self.waits_for_others:
            return "others sweep what is left"
        return self._why_shut() if self._order.exploration.is_shut_still(now) else ""

    def why_looking(self, cell: Cell, now: float) -> str:
        """Return why the robot stands without a cell to cover, or "".

        It looks at ground beyond its map; or it waits for robots that block the way to its zone,
        for as long as the retries of an order take.
        """
        exploration, policy = self._order.exploration, self._config.policy
        if exploration.waits_for_way(now, policy.retries * policy.retry_s):
            return self._why_shut()
        return exploration.why_looking(cell, now)

    def _why_shut(self) -> str:
        zone = self._order.state.current_zone
        return "others stand in the way" + (f" to zone {zone.name!r}" if zone else "")

    def record_path_end(self, why: str) -> bool:
        """Record the end of a path; return whether the cells it left must wait for a retry.

        ``why``: why the path left them; "" if unknown.
        """
        cells = self.cells.left_to_me()
        if cells > 0:
            self.uncovered.record_failure(why)
        # Cells done are counted, not cells left, as a new map may add cells.
        done = self.done
        self._in_vain = self._in_vain + 1 if cells and done <= self._done else 1
        self._done = done
        is_given_up = cells > 0 and self._in_vain > MAX_IN_VAIN
        if is_given_up and self._order.exploration.skip_viewpoint():
            return False
        if is_given_up and self.scope.give_up_first():
            return False
        area = self._map.area
        if is_given_up and area is not None and self.cells.give_up(area):
            # Parts that other robots may leave unswept come before a retry.
            is_given_up, self._in_vain = False, 0
        return is_given_up

    @property
    def done(self) -> int:
        """Number of cells that this robot has covered, or has visited as viewpoints."""
        return self._ledger.current.snapshot().cells + self._order.exploration.reached
