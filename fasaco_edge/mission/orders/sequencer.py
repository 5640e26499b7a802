"""Sequencer: carries out an order: zones pass by pass, then retries, then the return home."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.lattice import Cell, CoverageLattice
from fasaco_edge.mission.company import Company
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.coverage.unreached import Unreached, UnreachedFinder
from fasaco_edge.mission.map.loop_closure import Motion, moved_cells
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.map.reachable_area import ReachableArea, anchor_cell
from fasaco_edge.mission.map.room_book import MOST_LISTED
from fasaco_edge.mission.orders.by_room import RoomPrice
from fasaco_edge.mission.orders.cells_left import CellsLeft, LeftBehind, zones_beyond
from fasaco_edge.mission.orders.exploration import Exploration
from fasaco_edge.mission.orders.order import Errand, Zone
from fasaco_edge.mission.orders.order_state import AT_HOME, NO_ORDER, OrderState, Stage
from fasaco_edge.mission.orders.placing import left_out
from fasaco_edge.mission.orders.plan_scope import PlanScope
from fasaco_edge.mission.orders.reached_cells import ReachedCells
from fasaco_edge.mission.orders.zones import in_zones
from fasaco_edge.planners.problem import CoverageProblem

# After this many paths in a row that cover no further cell, the cells left wait for the retry: the
# robot may stop short of its path's end, with the last cell out of the tool's reach.
MAX_IN_VAIN = 3
# A robot is shut in if its reachable area is less than this share of all area ever reachable: the
# first if home is in it, else the second. A closed door to another room does not shut in a robot at
# home.
HOME_SHARE, MOST_SHARE = 0.1, 0.5


@dataclass(slots=True)
class _Run:
    """State of an order that is not kept over a restart.

    Attributes:
        exploration: the viewpoints.
        done: number of cells covered, or visited to look from them, by the end of the last path; -1
            before the first.
        in_vain: number of paths in a row that did not increase ``done``.
        left_behind: floor that opens while the robot is on its way home.
        retry_at: time of the next retry [s]; None if nothing waits.
        ending: how the order ended.
        is_laid_anew: whether the next plan is the first of a pass of its own kind.
    """

    exploration: Exploration = field(default_factory=Exploration)
    done: int = -1
    in_vain: int = 0
    left_behind: LeftBehind = field(default_factory=LeftBehind)
    retry_at: float | None = None
    ending: str = "the order was carried out"
    is_laid_anew: bool = False


class Sequencer:
    """Decides which part of an order is next, on the present map. Times are [s].

    Attributes:
        order_state: the order and its progress.
        cells: the cells left of it.
        scope: which of these are planned now, and how.
    """

    def __init__(
        self,
        config: MissionConfig,
        map_state: MapState,
        ledger: MissionLedger,
        company: Company,
        room_price: RoomPrice,
    ) -> None:
        self.order_state = OrderState.idle(NO_ORDER)
        self._config = config
        self._map = map_state
        self._ledger = ledger
        self._company = company
        self._run = _Run()
        # Returns at the end of an order how much floor was swept, as text; "" for no text.
        self._sum_up: Callable[[], str] = str
        self.cells = CellsLeft(
            *(config, map_state, ledger, company, self._zones),
            covers=lambda: self.order_state.current_pass.covers,
            exploration=lambda: self._run.exploration,
        )
        self.scope = PlanScope(
            config, map_state, self.cells, company, room_price, lambda: self.order_state
        )
        self._unreached = UnreachedFinder(map_state, ledger)
        # Cached result: whether a retry is worthwhile, for a given map and ledger.
        self._retry_check: tuple[object, bool] = (None, False)

    def ask_for_floor(self, sum_up: Callable[[], str]) -> None:
        """Set the function that returns, as text for an order's end, how much floor was swept."""
        self._sum_up = sum_up

    @property
    def is_waiting(self) -> bool:
        """Whether the robot waits for a retry."""
        return self._run.retry_at is not None

    @property
    def is_over(self) -> bool:
        """Whether the order is over."""
        return self.order_state.stage is Stage.OVER

    @property
    def can_plan(self) -> bool:
        """Whether a plan would have anything to cover."""
        return self.order_state.stage is not Stage.RETURNING and self.cells.left() > 0

    @property
    def waits_for_others(self) -> bool:
        """Whether only parts of other robots are left, and these make progress."""
        return self._company.others_go_on and not self.cells.left_to_me()

    @property
    def ending(self) -> str:
        """How the order ended."""
        return self._run.ending

    def goal(self, errand: Errand = "home") -> Cell | None:
        """Return the destination cell (row, col) of an errand; None for none."""
        places, lattice = self._map.places, self._map.lattice
        place = places.place(errand)
        if place is None or lattice is None:
            is_elsewhere = errand == "charge" and places.why_no_dock
            return None if is_elsewhere else self.order_state.home
        pose = place.stand
        return anchor_cell(lattice, pose) or lattice.cell_at(pose.x, pose.y)

    @property
    def ends_home(self) -> bool:
        """Whether the present path has to end at the robot's home."""
        return self.order_state.returns_home_next

    def start(self, state: OrderState) -> None:
        """Begin another order, or none."""
        self.order_state, self._run = replace(state, reached=None), _Run()
        if state.stage is Stage.OVER and state.why:
            self._run.ending = state.why
        self._retry_check = (None, False)
        self.scope.worth.begin()
        # Floor that obstacles close for a while stays reachable for another order on the same map.
        is_crowded = state.home is not None and self._map.obstacles.closed > 0
        self._unreached.restart(self._unreached.reached if is_crowded else state.reached)
        self._company.try_again()

    def set_state(self, state: OrderState) -> None:
        """Continue with the same order in another state, after a command."""
        self.order_state = state

    def succeed(self, before: Sequencer) -> None:
        """Go on with the same order on the same cells, as another mission left it."""
        self._unreached.succeed(before._unreached)

    def move_home(self, motion: Motion) -> None:
        """Move home with the map, if home is a cell."""
        if (home := self.order_state.home) is not None:
            cells = np.array([home], np.int32)
            ((row, col),) = moved_cells(cells, motion, self._config.footprint.cell_m).tolist()
            self.order_state = replace(self.order_state, home=(row, col))

    def note_map_motion(self) -> None:
        """Note that the newest map has moved; ``move_reached`` gets the motion."""
        self._unreached.note_map_motion()

    def move_reached(self, motion: Motion) -> None:
        """Move the reached cells with the map."""
        self._unreached.move(motion)
        # Cells that were reachable before lie elsewhere on the map now.
        self._run.left_behind.set_out(None)

    def shift_reached(self, motion: Motion) -> None:
        """Move the reached cells with the newest map, whose area is not known yet."""
        self._unreached.shift(motion)
        self._run.left_behind.set_out(None)

    def note_area(self) -> None:
        """Remember the cells that are reachable now."""
        self._unreached.note_area()

    def known(self, lattice: CoverageLattice) -> NDArray[np.bool_]:
        """Return which cells of a lattice are reachable or have been, bool (rows, cols)."""
        return self._unreached.known(lattice)

    @property
    def reached(self) -> ReachedCells | None:
        """The cells that have been reachable since the order began; None without one to go on."""
        return self._unreached.reached if self.order_state.is_open else None

    def reached_m2(self, area: ReachableArea) -> tuple[float, float]:
        """Return how large an area is, and all that was ever reachable [m2]."""
        return self._unreached.reached_m2(area)

    def is_shut_in(self, area: ReachableArea) -> bool:
        """Return whether home and most floor, or nearly all floor, are out of reach of an area.

        False if all is covered: then nothing keeps the order from its end.
        """
        (reached, once), home = self.reached_m2(area), self.goal()
        share = HOME_SHARE if home is None or area.contains(home) else MOST_SHARE
        return reached < share * once and self._is_any_left()

    def _is_any_left(self) -> bool:
        """Return whether anything of the order is left that was ever reachable."""
        state = self.order_state
        if state.order is None or state.next_pass() is not state:
            return True
        return self._unreached.is_any_left(state.order)

    def note_cell(self, cell: Cell) -> None:
        """Note that the robot is in ``cell``."""
        self._run.exploration.note_cell(cell)

    def begin(self, cell: Cell, now: float) -> str:
        """Start the stage that is due, from ``cell``; return why a plan is wanted, or ""."""
        run = self._run
        if run.retry_at is not None and not self._is_worth_trying():
            self.advance(now)
        if run.retry_at is not None:
            return self._begin_retry(cell) if now >= run.retry_at else ""
        state = self.order_state = self.scope.most_worthwhile_next(self._ledger)
        if state.begun or state.order is None or state.stage is Stage.OVER or state.waits_for:
            return ""
        zone = state.current_zone
        self.scope.worth.begin()
        if zone is not None and not (state.order.keep_covered and state.pass_number == 1):
            self._forget(zone, state)
        run.is_laid_anew = zone is not None and bool(zone.kinds)
        self.order_state = replace(state, begun=True, home=state.home or cell)
        run.done, run.in_vain = -1, 0
        self._company.try_again()
        if state.pass_number == 1:
            run.exploration.begin()
        return "" if state.automatic else state.title

    def _forget(self, zone: Zone, state: OrderState) -> None:
        """Forget what the pass that begins is to cover again."""
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

    def problem(
        self, cell: Cell, before: NDArray[np.int32], *, attempt: int = 0
    ) -> CoverageProblem:
        """Return the planning problem of the cells that are open now.

        Args:
            cell: the robot's cell.
            before: int32 (n, 2), the current path from there on.
            attempt: see ``CoverageProblem``.

        Raises:
            NothingToCover: no cell is open.
        """
        area = self._map.area
        assert area is not None
        self._run.exploration.end_if_reached(self.order_state.current_zone, area)
        problem = self.scope.problem(cell, before, self.goal(), attempt)
        # The walk of another pass has other lanes: a repair would keep them.
        is_full, self._run.is_laid_anew = self._run.is_laid_anew, False
        return replace(problem, is_full=is_full)

    def explore(self, cell: Cell) -> str:
        """Look for a path to an unreachable zone or part; return why a plan is wanted, or ""."""
        exploration, zone = self._run.exploration, self.order_state.current_zone
        area = self._map.area
        free = None if area is None else self.scope.passable(area, cell)
        if reason := exploration.seek(zone, area, free, cell):
            return reason
        viewpoints = self._company.viewpoints(self.cells.open_cells, cell)
        return next(filter(None, (exploration.look_beyond(at, cell) for at in viewpoints)), "")

    def why_standing(self, now: float) -> str:
        """Return why the robot stands, though a plan is wanted, or ""."""
        if self.waits_for_others:
            return "others sweep what is left"
        return self._why_shut() if self._run.exploration.is_shut_still(now) else ""

    def why_looking(self, cell: Cell, now: float) -> str:
        """Return why the robot stands where it has nothing to cover, or "".

        It looks at ground that others see, or waits for others that stand in the way to its zone:
        as long as the retries of an order take.
        """
        exploration, policy = self._run.exploration, self._config.policy
        if exploration.waits_for_way(now, policy.retries * policy.retry_s):
            return self._why_shut()
        is_looking = exploration.is_looking(cell, now)
        return "looks for its part, which others see" if is_looking else ""

    def _why_shut(self) -> str:
        zone = self.order_state.current_zone
        return "others stand in the way" + (f" to zone {zone.name!r}" if zone else "")

    def note_path_end(self, why: str) -> bool:
        """Note the end of a path; return whether the cells it left over must wait for a retry.

        ``why``: why it left them over; "" if that is not known.
        """
        run, cells = self._run, self.cells.left_to_me()
        if cells > 0:
            self._unreached.note_failure(why)
        # Counted by cells done, not by cells left: a map may show further ones at any time.
        done = self.done
        run.in_vain = run.in_vain + 1 if cells and done <= run.done else 1
        run.done = done
        is_given_up = cells > 0 and run.in_vain > MAX_IN_VAIN
        if is_given_up and run.exploration.skip_viewpoint():
            return False
        if is_given_up and self.scope.worth.least:
            self.scope.worth.give_up()
            return False
        if is_given_up and self._company.has_company:
            # Other robots may leave before they have swept their parts: those come first.
            is_given_up, run.in_vain = self._leave_to_others(), 0
        return is_given_up

    @property
    def done(self) -> int:
        """Number of cells that this robot has covered, or has visited only to look from them."""
        return self._ledger.current.snapshot().cells + self._run.exploration.reached

    def _leave_to_others(self) -> bool:
        """Give up what this robot has tried in vain; return whether nothing untried is left."""
        area = self._map.area
        assert area is not None
        unswept = self.cells.unswept(area.lattice.window) & area.reachable
        self._company.give_up(self._company.mine(unswept, area), area)
        return not self._company.untried(unswept, area).any()

    def pass_over_unreachable(self) -> bool:
        """In a fleet pass over cells that are out of reach now; return whether there were any.

        Cells of others' parts that it can reach come before a retry.
        """
        area = self._map.area
        if area is None or not self._company.has_company:
            return False
        unswept = self.cells.unswept(area.lattice.window) & area.reachable
        mine = self._company.mine(unswept, area)
        self._company.pass_over(mine, area)
        return bool(mine.any())

    def advance(self, now: float) -> None:
        """Continue with the next part, as nothing more can be done in this one now.

        A robot that is shut in has no next part: it waits, and tries this one again.
        """
        state, run, area = self.order_state, self._run, self._map.area
        run.exploration.viewpoints.clear()
        if state.stage is not Stage.RETURNING and area is not None and self.is_shut_in(area):
            run.retry_at = now + self._config.policy.retry_s
            return
        following = state.next_pass()
        if following is not state:
            self.order_state = following
            return
        if state.stage is Stage.RETRYING and not self.is_waiting:
            state = replace(state, tries=state.tries + 1)
        if state.stage is Stage.RETURNING:
            self._end()
            return
        # From here on the rest is counted over all zones.
        self.order_state = replace(state, stage=Stage.RETRYING)
        if state.tries < self._config.policy.retries and self._is_worth_trying():
            if run.retry_at is None:
                run.retry_at = now + self._config.policy.retry_s
        elif state.returns_home_next:
            run.retry_at = None
            run.left_behind.set_out(area)
            self.order_state = replace(state, stage=Stage.RETURNING, begun=False)
        else:
            self._end()

    def reopen(self) -> None:
        """Continue an order after a change of the map: an automatic one that was over; and one on
        its way home if floor has opened, at most once more than there are retries."""
        state, run, area = self.order_state, self._run, self._map.area
        if state.late:
            return
        if state.automatic and state.stage is Stage.OVER:
            self.order_state = replace(state, stage=Stage.COVERING, why="")
        if state.stage is not Stage.RETURNING or area is None:
            return
        may_turn = run.left_behind.times <= self._config.policy.retries
        if may_turn and run.left_behind.is_open(self.cells.open_to_me(area), area):
            run.left_behind.turn_back()
            self.order_state = replace(state, stage=Stage.RETRYING, begun=True)
            run.done, run.in_vain = -1, 0
            self._company.try_again()

    def spend(self, seconds: float) -> None:
        """Count the robot's time [s] since the last call."""
        state = self.order_state
        self.order_state = replace(state, spent_s=state.spent_s + seconds)

    def run_out_of_time(self, minutes: float) -> None:
        """End the order, as its time limit [min] is up: at home; of a robot on an errand, or
        sent home before, at once."""
        self._run.retry_at = None
        self.scope.worth.begin()
        state = self.order_state = self.order_state.out_of_time(minutes)
        is_sent_home = state.paused and state.why == AT_HOME
        if state.errand or is_sent_home:
            self.order_state = replace(state, paused=state.paused and not is_sent_home)
            self._end()

    def waiting_reason(self) -> str:
        """Return the reason of a wait before a retry as text."""
        cells, policy = self.unreached().cells, self._config.policy
        return (
            f"{cells} {'cell' if cells == 1 else 'cells'} not reached: tried again after "
            f"{policy.retry_s:g} s ({self.order_state.tries + 1} of {policy.retries})"
        )

    def unreached(self) -> Unreached:
        """Return the part of the order that stays uncovered on the present map."""
        return self._unreached.unreached(self.order_state)

    def _begin_retry(self, cell: Cell) -> str:
        run = self._run
        run.retry_at = None
        run.exploration.aim_at(self._viewpoints() - {cell})
        self._company.try_again()
        # In a retry, one path without progress is enough to give up.
        run.done, run.in_vain = self.done, MAX_IN_VAIN
        return f"tried again, {self.order_state.tries + 1} of {self._config.policy.retries}"

    def _end(self) -> None:
        run, order = self._run, self.order_state.order
        run.retry_at = None
        state = self.order_state = replace(self.order_state, stage=Stage.OVER)
        late = f"{state.late}: " if state.late else ""
        run.ending = late + self._unreached.ending(state) + self._sum_up()
        area, free = self._map.area, self._map.free
        if order is not None and area is not None and free is not None:
            run.ending += zones_beyond(order, area, free, self._ledger.visits(free.window))
        if order is not None and (rooms := left_out(order.zones)):
            run.ending += f"; left out: {', '.join(map(repr, rooms)):.{MOST_LISTED}}"
        self.order_state = replace(state, why=run.ending)

    def _is_worth_trying(self) -> bool:
        """Return whether a retry is worthwhile; recomputed if anything changed.

        It is also worthwhile while floor is closed for a while: the obstacle may be gone later.
        """
        closed = self._map.obstacles.closed
        key = (self._map.area, self._ledger.version, closed)
        if key != self._retry_check[0]:
            self._retry_check = key, bool(self.cells.left() or closed or self._viewpoints())
        return self._retry_check[1]

    def _zones(self) -> tuple[Zone, ...] | None:
        """Return the zones that are due; None without an order."""
        order, zone = self.order_state.order, self.order_state.current_zone
        if order is None:
            return None
        return order.zones if zone is None else (zone,)

    def _viewpoints(self) -> set[Cell]:
        """Return the cells from which to look at closed areas."""
        order, area = self.order_state.order, self._map.area
        return set() if order is None or area is None else self._unreached.viewpoints(order, area)
