"""Floor left: the unswept floor of an order, and how much of it the line ahead sweeps.

The sequencer gives the cells to cover, and the ledger the swept floor; the tally counts how often
the line sweeps each pixel of unswept floor.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.changes import carried
from fasaco_edge.grid.fine_raster import raster_to_map, strips
from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.possible_floor import possible_m2
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.mission.config import Sweeping
from fasaco_edge.mission.coverage.floor_tiles import pixels_under
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.coverage.swept_floor import ANYWHERE, NOWHERE, SweptFloor
from fasaco_edge.mission.line.asked_share import AskedShare, nearest_stands
from fasaco_edge.mission.line.tally import SweepTally
from fasaco_edge.mission.line.unswept import causes_of
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.work.order_state import Stage
from fasaco_edge.mission.work.sequencer import Sequencer

# The robot does not drive to a cell with less unswept floor than this [m2].
LEAST_LEFT_M2 = 0.04
# In a fleet, the ledger holds a passed cell while the unswept floor in it and in a rim of RIM_M [m]
# is worth WORTH_S [s]. With each cell passed, CHECKED_CELLS held cells are checked. The robot does
# not return to them: with four robots, returns took 10 % more time, and swept 0.1 % more floor.
WORTH_S, RIM_M, CHECKED_CELLS = 4.0, 0.1, 24
# Without a given share, the robot returns for missed floor if it is more than this share of the
# floor asked for: the base may have driven beside its line, or poses may be rare. On the map of a
# real scan matcher, returns for less took an eighth more time and swept only 0.3 % more floor.
LEAST_MISSED = 0.05
# Least unswept floor that is reported at the end [m2]: less would be rounded to 0.
LEAST_REPORTED_M2 = 0.05


class FloorToSweep(NamedTuple):
    """Areas of floor to sweep, on the newest map and for the present order.

    Attributes:
        asked_m2: reachable floor that is asked for, swept or not [m2]; while the robot is shut in,
            all that was reachable since the order began.
        ahead_m2: unswept part of ``asked_m2`` that the line ahead sweeps [m2].
        left_m2: unswept part of ``asked_m2`` that the line ahead does not sweep [m2].
        passed_m2: unswept rest of ``asked_m2``: floor that the line has passed, and strips as
            narrow as a pixel [m2].
        beyond_m2: free floor out of the tool's reach, asked for or not, by reason [m2].
        possible_m2: floor that would be reachable if walls were a pixel thinner than on the map
            [m2]; None before the end of the order, or if not known.
    """

    asked_m2: float
    ahead_m2: float
    left_m2: float
    passed_m2: float
    beyond_m2: dict[str, float]
    possible_m2: float | None


class UnsweptTally:
    """Keeps the tally of the line up to date with map, order and ledger; inactive without a floor,
    when only cells are counted.

    Attributes:
        share: the share of the floor that is asked for.
    """

    def __init__(
        self,
        sweeping: Sweeping | None,
        map_state: MapState,
        ledger: MissionLedger,
        orders: Sequencer,
    ) -> None:
        self._map, self._ledger, self._orders = map_state, ledger, orders
        self._speed_m_s = sweeping.line.speed_m_s if sweeping else 0.0
        self._price_s_m2 = sweeping.line.price_s_m2 if sweeping else 0.0
        self._worth_m2 = WORTH_S / self._price_s_m2 if self._price_s_m2 else math.inf
        self.share = AskedShare(sweeping.line.swept if sweeping else None)
        self._tally: SweepTally | None = None
        # Window in which causes of unreachable floor may be outdated.
        self._unexplained: Window | None = None
        # The newest reachable area, and the result of ``_reachable`` for it.
        self._reach: tuple[ReachableArea | None, NDArray[np.bool_]] = None, np.empty((0, 0), bool)
        # Window of the last update, with its asked-for and its reachable cells.
        self._asked: tuple[Window, NDArray[np.bool_], NDArray[np.bool_]] | None = None
        # The swept floor at the last update, its number of changes, and how often it had forgotten
        # pixels.
        self._swept: tuple[SweptFloor | None, int] = None, 0
        self._forgotten = 0
        # Floor of a finished order that would be reachable if walls were thinner [m2].
        self._possible_m2: float | None = None

    def follow(self, floor: FloorMap, tally: SweepTally) -> bool:
        """Follow the newest map; return whether it has a new raster, where any pixel may differ."""
        is_other, self._tally = tally is not self._tally, tally
        if is_other:
            self._unexplained = self._asked = None
        elif self._unexplained is not None and floor.shift is not None:
            self._unexplained = self._unexplained.moved(*floor.shift)
        return is_other

    @property
    def has_forgotten(self) -> bool:
        """Whether the ledger has forgotten swept floor since the last update, to be swept again."""
        return self._ledger.floor.forgotten != self._forgotten

    @property
    def areas(self) -> FloorToSweep | None:
        """Areas of floor to sweep; None before a floor is known."""
        tally = self._tally
        if tally is None or self._map.area is None:
            return None
        self._explain()
        left_m2 = tally.left_m2
        possible = self._possible_m2 if self._orders.order_state.stage is Stage.OVER else None
        ahead_m2, passed_m2 = tally.open_m2 - left_m2, tally.passed_m2
        return FloorToSweep(
            tally.wanted_m2, ahead_m2, left_m2, passed_m2, tally.beyond_m2, possible
        )

    @property
    def is_worth_driving(self) -> bool:
        """Whether the line ahead sweeps enough floor to drive it."""
        tally = self._tally
        return tally is not None and tally.open_m2 - tally.left_m2 >= self._worth_m2

    def sum_up(self) -> str:
        """Return how much floor an order has swept, as the end of a sentence; "" if nearly all."""
        floor, grid, stamped = self._map.ground.floor, self._map.grid, self._map.pose
        self._possible_m2 = None
        if floor is None or grid is None or stamped is None or self._map.area is None:
            return ""
        asked, pose = self._orders.cells.asked_of_me(self._map.area), stamped.pose
        lost = self._orders.reach.lost(self._map.area)
        if self._tally is not None:
            # Update the tally for the whole order, not only for its last part.
            self.update()
        thinner_m = grid.geometry.resolution
        self._possible_m2 = possible_m2(floor, thinner_m, (pose.x, pose.y), asked, lost)
        found = self.areas
        if found is None:
            return ""
        assert self._tally is not None
        of_share = self.share.sum_up(self._tally)
        possible = max(self._possible_m2 or 0.0, found.asked_m2)
        left_m2 = found.ahead_m2 + found.left_m2 + found.passed_m2
        if left_m2 + possible - found.asked_m2 < LEAST_REPORTED_M2:
            return of_share
        swept = f"; {found.asked_m2 - left_m2:.1f} of {found.asked_m2:.1f} m2 of floor swept"
        if possible - found.asked_m2 < LEAST_REPORTED_M2:
            return swept + of_share
        thinner = f", or of {possible:.1f} m2 if walls are a pixel thinner than on the map"
        return swept + thinner + of_share

    def pass_cells(self, passed: NDArray[np.int32]) -> None:
        """Note cells that the robot has passed on its path, int32 (n, 2)."""
        self._credit(passed)
        if self._orders.cells.keeps_passed:
            self._keep(passed)

    def _credit(self, passed: NDArray[np.int32]) -> None:
        """Count passed cells as covered if hardly any of their floor is left.

        A polished line may pass a cell without reaching its stand. A cell without floor asked for,
        for instance in another robot's part, seems swept but needs a visit.
        """
        tally, floor, covered = self._tally, self._map.ground.floor, self._ledger.current
        assert tally is not None
        assert floor is not None
        cells = dict.fromkeys((row, col) for row, col in passed.tolist())
        unseen = [cell for cell in cells if not covered.has_visited(cell)]
        if not unseen:
            return
        self.update()
        if self._asked is None:
            return
        window, asked, _ = self._asked
        is_asked = window.values_at(asked, np.array(unseen, np.int32), 0).tolist()
        for cell, counts in zip(unseen, is_asked, strict=True):
            if counts and tally.missed_m2(floor.box_of(cell)) < LEAST_LEFT_M2:
                # The robot missed the cell's stand, but the cell's floor is swept.
                covered.visit(cell)

    def _keep(self, passed: NDArray[np.int32]) -> None:
        """Keep the passed cells; drop cells once their floor is swept."""
        tally, floor, kept = self._tally, self._map.ground.floor, self._ledger.passed
        assert tally is not None
        assert floor is not None
        for row, col in passed.tolist():
            kept.add((row, col))
        for cell in kept.next(CHECKED_CELLS) if len(passed) else ():
            if tally.open_in_m2(floor.box_of(cell, RIM_M)) < self._worth_m2:
                kept.drop(cell)

    def open_missed(self) -> bool:
        """Reopen covered cells if their missed floor is worth the drive, or if less than the share
        asked for is swept; return whether any is reopened.

        To be called at the end of a path, as the robot may have driven beside its line.
        """
        tally, floor, lattice = self._tally, self._map.ground.floor, self._map.ground.lattice
        if tally is None or floor is None or lattice is None or self._map.pose is None:
            return False
        self.update(tally.forget_passed())
        if self._asked is None:
            return False
        window, asked, _ = self._asked
        is_covered = asked & (self._ledger.current.visits(window) > 0)
        missed = tally.missed().astype(np.float64)
        points = raster_to_map(floor.geometry, missed)
        at = np.floor(points[:, ::-1] / lattice.cell_m).astype(np.int32)
        if self.share.share is not None:
            return self._return_for_share(nearest_stands(missed, at, floor, is_covered))
        if len(points) * tally.unit_m**2 < LEAST_MISSED * tally.wanted_m2:
            return False
        found, pixels = np.unique(at, axis=0, return_counts=True)
        through_s = lattice.cell_m / self._speed_m_s
        is_worth = self._price_s_m2 * pixels * tally.unit_m**2 > through_s
        kept = is_worth & window.values_at(is_covered, found, 0).astype(np.bool_)
        cells = ((row, col) for row, col in found[kept].tolist())
        again = [cell for cell in cells if self._ledger.may_open_again(cell)]
        self._ledger.open_again(again)
        return bool(again)

    def _return_for_share(self, at: NDArray[np.int32]) -> bool:
        """Reopen cells for the share asked for; return whether any is.

        ``at``: int32 (n, 2), a cell for each missed pixel.
        """
        assert self._tally is not None
        state = self._orders.order_state
        if state.late or state.stage is Stage.RETURNING:
            # The order ends with this path: cells reopened now would count as not covered.
            return False
        if self._orders.scope.is_first_done:
            # The rest of the pass is covered before.
            return False
        self._begin_part()
        found, pixels = np.unique(at, axis=0, return_counts=True)
        may_open = [self._ledger.may_open_again((row, col)) for row, col in found.tolist()]
        again = self.share.returns_to(self._tally, found[may_open], pixels[may_open])
        if again:
            self._ledger.open_again(again)
        return bool(again)

    def _begin_part(self) -> None:
        state = self._orders.order_state
        # A reset or another building makes another object of the swept floor; an order that is
        # given again forgets floor.
        swept = self._ledger.floor
        self.share.begin((swept, swept.forgotten, state.order, state.zone, state.pass_number))

    @property
    def price_factor(self) -> float:
        """Factor on the price of floor on a complete map."""
        assert self._tally is not None
        self._begin_part()
        return self.share.factor(self._tally)

    def _explain(self) -> None:
        """Update the causes of unreachable floor where they may have changed."""
        tally, floor, part = self._tally, self._map.ground.floor, self._unexplained
        assert tally is not None
        assert floor is not None
        if part is None or self._asked is None or self._asked[0] != floor.stands.lattice.window:
            return
        self._unexplained = None
        for strip in strips(part.intersection(floor.geometry.window) or NOWHERE):
            free = self._map.ground.free_floor or floor
            tally.set_causes(strip, causes_of(floor, free, self._asked[2], strip))

    def update(self, touched: Window | None = None) -> None:
        """Update the tally where order or ledger have changed, and in a window of the raster."""
        tally, floor = self._tally, self._map.ground.floor
        assert tally is not None
        assert floor is not None
        swept = self._ledger.floor
        whole = floor.geometry.window
        # A reset makes another object, and forgetting may change any pixel.
        known, since = self._swept
        news = swept.changed_since(since) if known is swept else ANYWHERE
        if known is not swept or self.has_forgotten:
            tally.forget_passed()
            news = ANYWHERE
        self._forgotten = swept.forgotten
        part = Window.around(self._asked_part(floor), touched)
        if self._asked is not None and self._asked[0] != floor.stands.lattice.window:
            self._asked = None
        if self._asked is not None and part and (part := part.intersection(whole)):
            self._unexplained = Window.around(self._unexplained, part)
            for strip in strips(part):
                wanted = floor.reached(self._asked[1], strip)
                if self._orders.cells.is_at_edge:
                    # Along the edge the tool reaches into inner cells, which are not asked for.
                    within = self._asked[2] & ~self._asked[1]
                    wanted &= ~floor.lying_in(within, strip)
                tally.set_open(strip, wanted, swept.swept_on(floor.geometry, strip))
        driven = pixels_under(news, floor.geometry).intersection(whole) if news else None
        if driven is not None and driven != part:
            for strip in strips(driven):
                tally.set_open(strip, None, swept.swept_on(floor.geometry, strip))
        self._swept = swept, swept.changes

    def _asked_part(self, floor: FloorMap) -> Window | None:
        """Update the asked-for cells; return the window of pixels where they changed."""
        area = self._map.area
        # The first update with a reachable area covers the whole raster.
        if area is None or area.lattice.window != floor.stands.lattice.window:
            return None
        window, reachable = area.lattice.window, self._reachable(area)
        asked = reachable & self._orders.cells.asked_of_me(area)
        asked = self._orders.scope.worth.first(asked, window)
        before, self._asked = self._asked, (window, asked, reachable)
        if before is None:
            return floor.geometry.window
        changed = asked != carried(before[1], before[0], window)
        changed |= reachable != carried(before[2], before[0], window)
        return floor.pixels_of(changed) if changed.any() else None

    def _reachable(self, area: ReachableArea) -> NDArray[np.bool_]:
        """Return the cells with floor that counts as reachable, bool (rows, cols) of an area.

        These are the area's reachable cells. While the robot is shut in, they are all cells that
        were reachable before, as nearly all floor would seem swept otherwise.
        """
        if self._reach[0] is not area:
            reachable = area.reachable
            if self._orders.is_shut_in(area):
                reachable = self._orders.reach.known(area.lattice) & area.lattice.coverable
            self._reach = area, reachable
        return self._reach[1]
