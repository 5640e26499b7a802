"""Sequencer: carries out an order, zones pass by pass, then retries, then the return home."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from fasaco_edge.grid.lattice import Cell
from fasaco_edge.grid.reachable_area import ReachableArea, anchor_cell
from fasaco_edge.mission.company import Company
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.coverage.loop_closure import Motion, moved_cells
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.map.placing import left_out
from fasaco_edge.mission.orders.order import Errand, Zone
from fasaco_edge.mission.orders.zones import in_zones
from fasaco_edge.mission.rooms.room_book import MOST_LISTED
from fasaco_edge.mission.rooms.room_cells import RoomCells
from fasaco_edge.mission.work.cells_left import LeftBehind, zones_beyond
from fasaco_edge.mission.work.exploration import open_edge
from fasaco_edge.mission.work.order_reach import CellsOn
from fasaco_edge.mission.work.order_state import AT_HOME, OrderState, Stage
from fasaco_edge.mission.work.present_order import PresentOrder
from fasaco_edge.mission.work.present_part import PresentPart
from fasaco_edge.mission.work.reached_cells import ReachedCells

# A robot is shut in if it can reach less than MOST_SHARE of the area that it could ever reach. If
# home is in reach, the limit is HOME_SHARE: a door to another room may be closed.
HOME_SHARE, MOST_SHARE = 0.1, 0.5
CARRIED_OUT = "the order was carried out"


class Sequencer:
    """Decides which part of an order is next, on the present map. Times are [s].

    Attributes:
        part: the part of the order that is due.
        cells, scope, reach, uncovered: members of ``part``.
        ending: how the order ended.
    """

    def __init__(
        self,
        config: MissionConfig,
        map_state: MapState,
        ledger: MissionLedger,
        company: Company,
        room_cells: RoomCells,
    ) -> None:
        self._config, self._map, self._ledger = config, map_state, ledger
        self._order = order = PresentOrder()
        self.part = part = PresentPart(config, map_state, ledger, company, room_cells, order)
        self.cells, self.scope = part.cells, part.scope
        self.reach, self.uncovered = part.reach, part.uncovered
        # Whether floor opens while the robot is on its way home.
        self._left_behind = LeftBehind()
        self._retry_at: float | None = None
        self.ending = CARRIED_OUT
        # Returns the swept floor as text for an order's end.
        self._sum_up: Callable[[], str] = str
        # Cached: a map and ledger, and whether a retry is worthwhile on them.
        self._retry_check: tuple[object, bool] = (None, False)

    def describe_floor_by(self, sum_up: Callable[[], str]) -> None:
        """Set the function that returns the swept floor as text for an order's end."""
        self._sum_up = sum_up

    @property
    def order_state(self) -> OrderState:
        """The order and its progress."""
        return self._order.state

    @property
    def reached(self) -> ReachedCells | None:
        """The cells that have been reachable since the order began; None without an open order."""
        return self.reach.cells if self.order_state.is_open else None

    def goal(self, errand: Errand = "home") -> Cell | None:
        """Return the destination cell (row, col) of an errand; None for none."""
        places, lattice = self._map.places, self._map.ground.lattice
        place = places.place(errand)
        if place is None or lattice is None:
            is_elsewhere = errand == "charge" and places.why_no_dock
            return None if is_elsewhere else self.order_state.home
        pose = place.stand
        return anchor_cell(lattice, pose) or lattice.cell_at(pose.x, pose.y)

    @property
    def is_waiting(self) -> bool:
        """Whether the robot waits for a retry."""
        return self._retry_at is not None

    def begin_order(self, state: OrderState) -> None:
        """Begin with another order, or with none."""
        self._order.state = replace(state, reached=None)
        self._left_behind, self._retry_at = LeftBehind(), None
        is_over = state.stage is Stage.OVER and bool(state.why)
        self.ending = state.why if is_over else CARRIED_OUT
        self._retry_check = (None, False)
        self.part.begin_order()
        # Floor behind temporary obstacles counts as reachable for the next order on the same map.
        is_crowded = state.home is not None and self._map.obstacles.closed > 0
        self.uncovered.begin_order()
        self.reach.begin_order(self.reach.cells if is_crowded else state.reached)

    def set_state(self, state: OrderState) -> None:
        """Continue with the same order in another state, after a command."""
        self._order.state = state

    def move_home(self, motion: Motion) -> None:
        """Move the home cell with the map; home may instead be a configured place."""
        if (home := self._order.state.home) is not None:
            cells = np.array([home], np.int32)
            ((row, col),) = moved_cells(cells, motion, self._config.footprint.cell_m).tolist()
            self._order.state = replace(self._order.state, home=(row, col))

    def move_reached(self, before: CellsOn | None, motion: Motion) -> None:
        """Move the reached cells with the map; ``before``: the cells before it moved."""
        self.reach.move(before, motion)
        # The cells that were reachable have moved on the map.
        self._left_behind.set_out(None)

    def shift_reached(self, motion: Motion) -> None:
        """Move the reached cells with the newest map, whose area is not known yet."""
        self.reach.shift(motion)
        self._left_behind.set_out(None)

    def is_shut_in(self, area: ReachableArea) -> bool:
        """Return whether a robot that can reach only ``area`` is shut in, see ``MOST_SHARE``.

        False if all is covered, as the order can end then.
        """
        (reached, once), home = self.uncovered.reached_m2(area), self.goal()
        share = HOME_SHARE if home is None or area.contains(home) else MOST_SHARE
        return reached < share * once and self.uncovered.is_any_left()

    def begin_stage(self, cell: Cell, now: float) -> str:
        """Start the stage that is due, from ``cell``; return why a plan is wanted, or ""."""
        if self._retry_at is not None and not self._is_worth_trying():
            self.advance(now)
        if self._retry_at is not None:
            return self._begin_retry(cell) if now >= self._retry_at else ""
        state = self._order.state = self.scope.by_priority(self._ledger)
        if state.begun or state.order is None or state.stage is Stage.OVER or state.waits_for:
            return ""
        zone = state.current_zone
        self.scope.begin_pass()
        if zone is not None and not (state.order.keep_covered and state.pass_number == 1):
            self._forget(zone, state)
        self._order.state = replace(state, begun=True, home=state.home or cell)
        self.part.begin_pass(has_new_lanes=zone is not None and bool(zone.kinds))
        return "" if state.automatic else state.title

    def _forget(self, zone: Zone, state: OrderState) -> None:
        """Forget the visits to cells that the new pass covers again."""
        number, covers = state.pass_number, state.current_pass.covers
        if number == 1 or covers == "all":
            self._ledger.forget(partial(in_zones, (zone,)))
        elif covers == "edge" or zone.kind(number - 1).covers != "edge":
            self._ledger.forget(
                lambda window, square_m: (
                    in_zones((zone,), window, square_m)
                    & (self.cells.edge_in(window, square_m) == (covers == "edge"))
                )
            )

    def advance(self, now: float) -> None:
        """Continue with the next part, as nothing more of the present part can be done now.

        A robot that is shut in waits, and tries the present part again.
        """
        state, area = self._order.state, self._map.area
        self._order.exploration.viewpoints.clear()
        if state.stage is not Stage.RETURNING and area is not None and self.is_shut_in(area):
            self._retry_at = now + self._config.policy.retry_s
            return
        following = state.next_pass()
        if following is not state:
            self._order.state = following
            return
        if state.stage is Stage.RETRYING and not self.is_waiting:
            state = replace(state, tries=state.tries + 1)
        if state.stage is Stage.RETURNING:
            self._end()
            return
        # From here on, the cells left of all zones are counted.
        self._order.state = replace(state, stage=Stage.RETRYING)
        if state.tries < self._config.policy.retries and self._is_worth_trying():
            if self._retry_at is None:
                self._retry_at = now + self._config.policy.retry_s
        elif state.returns_home_next:
            self._retry_at = None
            self._left_behind.set_out(area)
            self._order.state = replace(state, stage=Stage.RETURNING, begun=False)
        else:
            self._end()

    def reopen(self) -> None:
        """Continue an order after a change of the map.

        An automatic order continues after its end. A robot on its way home turns back if floor has
        opened, at most ``retries`` + 1 times.
        """
        state, area = self._order.state, self._map.area
        if state.late:
            return
        if state.automatic and state.stage is Stage.OVER:
            self._order.state = replace(state, stage=Stage.COVERING, why="")
        if state.stage is not Stage.RETURNING or area is None:
            return
        may_turn = self._left_behind.times <= self._config.policy.retries
        if may_turn and self._left_behind.is_open(self.cells.open_to_me(area), area):
            self._left_behind.turn_back()
            self._order.state = replace(state, stage=Stage.RETRYING, begun=True)
            self.part.try_all()

    def spend(self, seconds: float) -> None:
        """Count the robot's time [s] since the last call."""
        state = self._order.state
        self._order.state = replace(state, spent_s=state.spent_s + seconds)

    def run_out_of_time(self, minutes: float) -> None:
        """End the order at its time limit [min].

        The robot drives home first, unless it is on an errand or was sent home.
        """
        self._retry_at = None
        self.scope.begin_pass()
        state = self._order.state = self._order.state.out_of_time(minutes)
        is_sent_home = state.paused and state.why == AT_HOME
        if state.errand or is_sent_home:
            self._order.state = replace(state, paused=state.paused and not is_sent_home)
            self._end()

    def waiting_reason(self) -> str:
        """Return the reason of a wait before a retry as text."""
        cells, policy = self.uncovered.found().cells, self._config.policy
        return (
            f"{cells} {'cell' if cells == 1 else 'cells'} not reached: tried again after "
            f"{policy.retry_s:g} s ({self._order.state.tries + 1} of {policy.retries})"
        )

    def _begin_retry(self, cell: Cell) -> str:
        self._retry_at = None
        self.part.begin_retry(cell)
        return f"tried again, {self._order.state.tries + 1} of {self._config.policy.retries}"

    def _end(self) -> None:
        order = self._order.state.order
        self._retry_at = None
        state = self._order.state = replace(self._order.state, stage=Stage.OVER)
        late = f"{state.late}: " if state.late else ""
        self.ending = late + self.uncovered.outcome() + self._sum_up()
        area, free = self._map.area, self._map.ground.free
        if order is not None and area is not None and free is not None:
            self.ending += zones_beyond(order, area, free, self._ledger.visits(free.window))
        is_whole = order is not None and not any(zone.polygon for zone in order.zones)
        if is_whole and area is not None and not late:
            self.ending += open_edge(area)
        if order is not None and (rooms := left_out(order.zones)):
            self.ending += f"; left out: {', '.join(map(repr, rooms)):.{MOST_LISTED}}"
        self._order.state = replace(state, why=self.ending)

    def _is_worth_trying(self) -> bool:
        """Return whether a retry is worthwhile; recomputed if anything changed.

        Temporarily closed floor makes a retry worthwhile: the obstacle may leave.
        """
        closed = self._map.obstacles.closed
        key = (self._map.area, self._ledger.version, closed)
        if key != self._retry_check[0]:
            self._retry_check = (
                key,
                bool(self.cells.left() or closed or self.uncovered.viewpoints()),
            )
        return self._retry_check[1]
