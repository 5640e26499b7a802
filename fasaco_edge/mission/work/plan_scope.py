"""Plan scope: which cells of the present pass a plan covers, in which area, at what cost."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.mission.company import Company
from fasaco_edge.mission.config import ByRoom, MissionConfig
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.rooms.room_cells import RoomCells
from fasaco_edge.mission.work.cells_left import CellsLeft, visits_due
from fasaco_edge.mission.work.order_state import OrderState
from fasaco_edge.mission.work.room_in_turn import RoomInTurn
from fasaco_edge.mission.work.worth import WorthFirst
from fasaco_edge.planners.cost import CoverageCost
from fasaco_edge.planners.problem import CoverageProblem

# Price of a step into another room, in units of a step with a quarter-turn. Many walks take nearly
# the same time, and most leave rooms half done. At this price robots returned to 12 rooms of 27, at
# a tenth of it to 19; four times the price gained nothing.
PRICE = 20.0


class PlanScope:
    """Poses the planning problems of an order, for the cells planned first. Times are [s].

    Attributes:
        worth: which cells are planned first, by priority.
    """

    def __init__(
        self,
        config: MissionConfig,
        map_state: MapState,
        cells: CellsLeft,
        company: Company,
        room_cells: RoomCells,
        state: Callable[[], OrderState],
    ) -> None:
        self._config, self._map, self._cells = config, map_state, cells
        self._company, self._room_cells, self._state = company, room_cells, state
        self.worth = WorthFirst(
            *(config.footprint.cell_m, config.cost.step_s),
            lambda: state().current_zone,
            lambda: map_state.grid.frame if map_state.grid is not None else "",
        )
        self._room = RoomInTurn(room_cells, self._takes_rooms_in_turn)

    def _takes_rooms_in_turn(self) -> bool:
        zone = self._state().current_zone
        is_one_room = zone is None or zone.room > 0
        always = self._config.policy.by_room == "always"
        return always and not is_one_room and not self._company.has_members

    def problem(
        self, cell: Cell, before: NDArray[np.int32], home: Cell | None, attempt: int
    ) -> CoverageProblem:
        """Return the planning problem of the cells that are planned now.

        Args:
            cell: the robot's cell.
            before: int32 (n, 2), the current path from that cell on.
            home: the cell in which the order ends; None for none.
            attempt: see ``CoverageProblem``.

        Raises:
            NothingToCover: no cell is open.
        """
        area, state = self._map.area, self._state()
        assert area is not None
        free = self._company.passable(area, cell)
        lattice, reachable = free.lattice, free.reachable
        to_cover = self._cells.open_to_me(area)
        left = to_cover & reachable
        if not attempt and self.worth.is_limited:
            self.worth.choose(left, lattice.window)
        if not attempt:
            self._room.choose(self.worth.first(left, lattice.window), free, cell)
        first = self._first(to_cover, lattice)
        ends_home = home is not None and state.returns_home_next and area.contains(home)
        ends_home = ends_home and home is not None and bool(reachable[lattice.local(home)])
        problem = CoverageProblem.of(
            lattice,
            cell,
            covered=~first,
            end=home if ends_home and not (left & ~first).any() else None,
            cost=self._cost(),
            before=before,
            attempt=attempt,
            # An attempt may start in a cell that is not in the robot's area.
            reachable=reachable if area.contains(cell) else None,
        )
        return with_rooms(problem, self._room_cells, self._config.policy.by_room)

    def _cost(self) -> CoverageCost:
        """Return the cost of paths in the present pass, by its lanes and its speed."""
        cost, usual_m_s, state = self._config.cost, self._config.speed_m_s, self._state()
        if state.speed_m_s and usual_m_s:
            cost = cost.paced(cost.step_s * usual_m_s / state.speed_m_s)
        return cost.along(state.current_pass.lanes)

    def walk_s(self, cells: NDArray[np.int32]) -> float:
        """Return the duration of a walk in the present pass [s]."""
        return self._cost().of_walk(cells)

    def puts_other_first(self, ahead_s: float) -> bool:
        """Choose again if time is too short at the pace of the path ahead, which takes ``ahead_s``.

        Returns:
            Whether the choice changed.
        """
        area, in_turn = self._map.area, self._takes_rooms_in_turn()
        if area is None or (ahead_s <= self.worth.may_work_s and not in_turn):
            return False
        open_cells = self._cells.open_to_me(area) & area.reachable
        all_rooms = self.worth.first(open_cells, area.lattice.window)
        planned = int(np.count_nonzero(self._room.first(all_rooms, area.lattice)))
        if not planned:
            return False
        # The path covers one room, and the others have to be done in time, too.
        ahead_s *= int(np.count_nonzero(all_rooms)) / planned
        return self.worth.puts_other_first(open_cells, area.lattice.window, ahead_s)

    def begin_pass(self) -> None:
        """Choose again which floor comes first."""
        self.worth.begin_pass()
        self._room.begin_pass()

    def give_up_first(self) -> bool:
        """Put off the cells planned now until others are done; return False if all are planned."""
        if self._room.give_up():
            return True
        is_limited = self.worth.least > 0
        if is_limited:
            self.worth.give_up()
        return is_limited

    def is_in_other_room(self, cell: Cell) -> bool:
        """Return whether new rooms on the map show that another room is to be finished first."""
        area = self._map.area
        if area is None or not self._room.is_due(area.lattice):
            return False
        left = self._cells.open_to_me(area) & area.reachable
        return self._room.choose(self.worth.first(left, area.lattice.window), area, cell)

    def _first(self, cells: NDArray[np.bool_], lattice: CoverageLattice) -> NDArray[np.bool_]:
        return self._room.first(self.worth.first(cells, lattice.window), lattice)

    def _counts(self) -> tuple[int, int]:
        """Return the number of cells that this robot has to visit, planned now and in all."""
        area = self._map.area
        if area is None:
            return 0, 0
        left = self._cells.open_to_me(area) & area.reachable
        first = self._first(left, area.lattice)
        return int(np.count_nonzero(first)), int(np.count_nonzero(left))

    @property
    def is_any_planned_left(self) -> bool:
        """Whether this robot has to visit any of the cells that are planned now."""
        return self._counts()[0] > 0

    @property
    def is_part(self) -> bool:
        """Whether cells are left besides those planned now."""
        first, left = self._counts() if self._has_first else (0, 0)
        return left > first

    @property
    def is_first_done(self) -> bool:
        """Whether the cells planned first are covered, and other cells are left."""
        first, left = self._counts() if self._has_first else (0, 0)
        return left > 0 and not first

    @property
    def _has_first(self) -> bool:
        """Whether a priority or a room puts some cells first."""
        return self.worth.least > 0 or self._room.is_chosen

    def by_priority(self, ledger: MissionLedger) -> OrderState:
        """Return the order, its remaining zones sorted by priority if time does not allow all.

        A fleet keeps the given sequence, as its robots sweep each zone together.
        """
        state, area = self._state(), self._map.area
        zone = state.current_zone
        if zone is None or state.order is None or state.begun or state.pass_number > 1:
            return state
        to_come = state.order.zones[state.zone :]
        is_alike = len({each.worth for each in to_come}) < 2
        if area is None or is_alike or self._company.has_members:
            return state
        skipped = np.zeros(area.reachable.shape, bool)
        if state.order.keep_covered:
            skipped = ledger.current.visits(area.lattice.window) > 0
        cells = sum(visits_due(each, area, skipped) for each in to_come)
        return state.by_priority() if self.worth.are_too_many(cells) else state


def with_rooms(problem: CoverageProblem, cells: RoomCells, by_room: ByRoom) -> CoverageProblem:
    """Return a problem with the rooms of its cells, and the price of steps between them."""
    rooms = None if by_room == "never" else cells.on(problem.lattice)
    if rooms is None:
        return problem
    cost = problem.cost
    room_s = PRICE * (cost.step_s + cost.quarter_turn_s)
    return replace(problem, cost=replace(cost, room_s=room_s), rooms=rooms)
