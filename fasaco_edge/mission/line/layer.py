"""Line layer: converts each path over cells to the line that is published.

It follows map, poses and paths, and publishes a changed line even if the path is unchanged.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.changes import carried
from fasaco_edge.grid.fine_raster import raster_to_map, strips
from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.possible_floor import possible_m2
from fasaco_edge.mission.config import Sweeping
from fasaco_edge.mission.core.events import PathUpdate
from fasaco_edge.mission.core.route import Route
from fasaco_edge.mission.coverage.floor_tiles import pixels_under
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.coverage.swept_floor import ANYWHERE, NOWHERE, SweptFloor
from fasaco_edge.mission.line.curver import Curver
from fasaco_edge.mission.line.figures import AheadFigures, FloorToSweep
from fasaco_edge.mission.line.line_ahead import LineAhead
from fasaco_edge.mission.line.missed_floor import REASONS, MissedFloor, causes_of
from fasaco_edge.mission.line.offset import Offset
from fasaco_edge.mission.line.polisher import Polisher
from fasaco_edge.mission.line.polyline import CURVED
from fasaco_edge.mission.line.published_line import Publication
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.orders.sequencer import Sequencer

# The robot does not drive to a cell with less unswept floor than this [m2].
LEAST_LEFT_M2 = 0.04
# A passed cell is kept while the floor left in it, and in a rim of this width around it, is worth
# this much [s], [m]; number of kept cells that are checked each time that the robot passes one. The
# robot does not go back to them: at the end of a mission that took four robots a tenth more time,
# for 0.1 % of the floor.
WORTH_S, RIM_M, LOOKED_AT = 4.0, 0.1, 24
# Nor does it go back for floor that was missed here and there, up to this share of all floor: on
# the map of a real scan matcher that took an eighth more time, for 0.3 % of the floor. A base that
# drives beside its line misses more, and poses that come seldom leave more unknown.
LEAST_MISSED = 0.05
# Least unswept floor that is reported at the end [m2]: less would be rounded to 0.
LEAST_TOLD_M2 = 0.05


class LineLayer:
    """Owns the line; inactive where cells are counted.

    Attributes:
        offset: whether the robot drives beside the line all the time.
    """

    def __init__(
        self,
        sweeping: Sweeping | None,
        map_state: MapState,
        ledger: MissionLedger,
        orders: Sequencer,
        route: Route,
    ) -> None:
        self._map, self._ledger, self._orders, self._route = map_state, ledger, orders, route
        self.offset = Offset(sweeping.tool_m if sweeping else 0.0)
        self._config = sweeping.line if sweeping else None
        self._polisher = Polisher(sweeping.line) if sweeping else None
        self._curver = Curver(sweeping.curves) if sweeping and sweeping.curves else None
        self._publication = Publication(route, sweeping.line.speed_m_s if sweeping else 0.0)
        self._missed = MissedFloor.at(sweeping.line, WORTH_S) if sweeping else None
        price_s_m2 = sweeping.line.price_s_m2 if sweeping else 0.0
        self._worth_m2 = WORTH_S / price_s_m2 if price_s_m2 else math.inf
        self._ahead: LineAhead | None = None
        # Window of map and floor that may have changed since the last update; window, asked-for
        # cells and reachable cells of that update.
        self._touched: Window | None = None
        self._is_dropped = False
        # Window in which causes of unreachable floor may be outdated.
        self._unexplained: Window | None = None
        self._asked: tuple[Window, NDArray[np.bool_], NDArray[np.bool_]] | None = None
        # Whether the map is complete; None before the first check.
        self._is_settled: bool | None = None
        # The swept floor at the last update, its number of changes, and how often it had forgotten
        # pixels.
        self._swept: tuple[SweptFloor | None, int] = None, 0
        self._forgotten = 0
        # The floor at the last update, and its revision.
        self._seen: tuple[FloorMap | None, int] = None, 0
        # Floor of an order that is over which may be reachable [m2].
        self._possible_m2: float | None = None

    def note_map(self) -> None:
        """Follow the newest map; to be called with each."""
        floor = self._map.floor
        if floor is None or (floor is self._seen[0] and floor.revision == self._seen[1]):
            return
        self._seen = floor, floor.revision
        if self._ahead is None:
            self._ahead = LineAhead(floor, is_curved=self._curver is not None)
            self._asked, self._touched = None, None
            return
        before = self._ahead.tally
        if self._ahead.follow_floor(floor):
            self._is_dropped = True
        # A floor without its last keep-out is another floor object, even if the newest map has
        # changed little.
        if floor.shift is None or self._ahead.tally is not before:
            whole = Window(0, 0, floor.geometry.rows, floor.geometry.cols)
            self._touched, self._unexplained, self._asked = whole, None, None
            return
        touched, self._unexplained = (
            window and window.moved(*floor.shift) for window in (self._touched, self._unexplained)
        )
        self._touched = Window.around(touched, floor.touched)

    def note_pose(self, pose: Pose2D, farthest_m: float = 0.0) -> None:
        """Note the robot's pose, which may be on its line.

        ``farthest_m``: how far it can have driven since the pose before; 0 if not known [m].
        """
        ahead = self._ahead
        if ahead is None:
            return
        # Forgotten floor is opened before more is passed.
        if self._ledger.floor.forgotten != self._forgotten:
            self._take_floor()
        before = self._route.held.index
        ahead.drive(pose, farthest_m)
        self.offset.note((pose.x, pose.y), ahead.beside)
        self._route.follow_line(ahead.cell)
        path = self._route.held
        passed = path.cells[before : path.index]
        self._credit(passed)
        if self._orders.cells.keeps_passed:
            self._note_passed(passed)
        is_on_it = ahead.is_followed and len(path.cells) > 0
        row, col = path.cells[path.index].tolist() if is_on_it else (0, 0)
        self._map.follow_path((row, col) if is_on_it else None)

    def finish(self, update: PathUpdate | None, now: float) -> PathUpdate | None:
        """Return the update to publish after a step, with or without a new path."""
        ahead, stamped = self._ahead, self._map.pose
        if ahead is None or stamped is None or self._polisher is None or self._map.floor is None:
            self._publication.forget()
            return update
        touched, self._touched = self._touched, None
        self._take_floor(touched)
        reason, path = "", self._route.path
        # The robot's cell may be ahead of its place on the line, which may skip cells.
        is_further = path.index > ahead.cell
        if update is not None:
            self._set_aside(ahead, len(update.cells) > 0)
            self._lay(ahead, update.cells, stamped.pose, is_cut=self._route.is_cut)
        elif why := self._why_anew(ahead, is_further and touched is not None):
            self._lay(ahead, path.ahead, stamped.pose)
            if len(path.ahead):
                update = replace(self._route.publish_anew(why, now), may_wait=True)
        self._is_dropped = False
        if touched is not None and ahead.check(touched):
            reason = "line blocked"
        if touched is not None or self._is_settled is None:
            self._is_settled = not self._orders.cells.is_exploring
        # Urgent updates are published first; the rest comes with the next pose.
        held = self._publication.look(ahead)
        if update is None and not reason and not is_further:
            self._explain()
        may_change = (update is None or update.may_wait) and not reason and not is_further
        # On such a way the robot sweeps nothing beside its path.
        if may_change and not self._is_way:
            held = max(held, ahead.line.first_below(CURVED)) if self._curver else held
            self._polisher.polish(ahead, self._map.floor, held, is_settled=self._is_settled)
            self._publication.look(ahead)
        if self._curver is None:
            return self._publication.finish(ahead, update, reason, now, is_way=self._is_way)
        reason = self._curve(self._curver, ahead, self._map.floor, stamped.pose) or reason
        update = self._publication.finish(ahead, update, reason, now, is_way=self._is_way)
        if update is None or update.xy is None:
            return update
        return replace(update, yaw=self._curver.yaw(update.xy, stamped.pose))

    def _curve(self, curver: Curver, ahead: LineAhead, floor: FloorMap, pose: Pose2D) -> str:
        """Make a curve of the line where it is due; return why to publish a way, or "".

        On a way nothing waits for the robot to come near.
        """
        if not curver.curve(ahead, floor, pose):
            return ""
        self._publication.look(ahead)
        return "curve further ahead" if self._is_way else ""

    @property
    def _is_way(self) -> bool:
        """Whether the path is only a way: home, to the dock or to a refuge.

        At the usual end of an order the line home sweeps what floor is left beside it.
        """
        state = self._orders.order_state
        return bool(state.errand or state.late) or self._route.aside is not None

    def _lay(
        self, ahead: LineAhead, cells: NDArray[np.int32], pose: Pose2D, *, is_cut: bool = False
    ) -> None:
        """Lay the line along cells; a way leads straight to the goal, clear of other robots."""
        beside = self._route.beside
        ahead.lay(cells, pose, is_cut=is_cut, keeps=not self._is_way, beside=beside)

    def _set_aside(self, ahead: LineAhead, is_driven: bool) -> None:
        """Set the line aside with the path, and resume it with the next path that is driven."""
        if self._route.aside is not None:
            ahead.set_aside()
        elif is_driven:
            ahead.take_up()

    def _why_anew(self, ahead: LineAhead, is_further: bool) -> str:
        """Return why to lay the line along the same path again; "" to leave it."""
        if self._is_dropped:
            return "map on another raster"
        # The next plan ended where the path was cut off.
        if ahead.is_cut and not self._route.is_cut and len(self._route.path.cells):
            return "path complete"
        return "robot further on its path" if is_further else ""

    @property
    def to_sweep(self) -> FloorToSweep | None:
        """Areas of floor to sweep; None where cells are counted, or before a floor is known."""
        if self._ahead is None or self._map.area is None:
            return None
        tally = self._ahead.tally
        open_m2, left_m2 = tally.open_m2, tally.left_m2
        beyond_m2 = {REASONS[cause]: m2 for cause, m2 in tally.beyond_m2.items()}
        ahead_m2 = open_m2 - left_m2
        possible_m2 = self._possible_m2 if self._orders.is_over else None
        return FloorToSweep(
            tally.wanted_m2, ahead_m2, left_m2, tally.passed_m2, beyond_m2, possible_m2
        )

    def unswept(self) -> tuple[GridGeometry, NDArray[np.uint8]] | None:
        """Return the raster, and why its pixels are not swept, see ``Unswept``."""
        floor = self._map.floor
        if floor is None or self._ahead is None or self.to_sweep is None:
            return None
        return floor.geometry, self._ahead.tally.unswept()

    def ahead(self) -> AheadFigures | None:
        """Return figures of the line ahead; None where cells are counted, or without a line."""
        to_sweep, floor = self.to_sweep, self._map.floor
        if self._ahead is None or self._config is None or to_sweep is None or floor is None:
            return None
        seconds = self._config.seconds(self._ahead.line.points, self._ahead.tally.unit_m)
        tool_m = floor.discs.tool_m
        length_m = (to_sweep.ahead_m2 - math.pi * tool_m**2 / 4.0) / tool_m
        return AheadFigures(seconds, max(length_m, 0.0) / self._config.speed_m_s)

    def sum_up(self) -> str:
        """Return at the end of an order how much floor was swept, as text that follows another.

        "" if hardly any floor is left, or if cells are counted.
        """
        floor, grid, stamped = self._map.floor, self._map.grid, self._map.pose
        self._possible_m2 = None
        if floor is None or grid is None or stamped is None or self._map.area is None:
            return ""
        asked, pose = self._orders.cells.asked_of_me(self._map.area), stamped.pose
        cut_off = self._orders.known(self._map.area.lattice) & ~self._map.area.reachable
        if self._ahead is not None:
            # Of the whole order, not of its last part.
            self._take_floor()
        thinner_m = grid.geometry.resolution
        self._possible_m2 = possible_m2(floor, thinner_m, (pose.x, pose.y), asked, cut_off)
        found = self.to_sweep
        if found is None:
            return ""
        possible = max(self._possible_m2 or 0.0, found.asked_m2)
        left_m2 = found.ahead_m2 + found.left_m2 + found.passed_m2
        if left_m2 + possible - found.asked_m2 < LEAST_TOLD_M2:
            return ""
        swept = f"; {found.asked_m2 - left_m2:.1f} of {found.asked_m2:.1f} m2 of floor swept"
        if possible - found.asked_m2 < LEAST_TOLD_M2:
            return swept
        return f"{swept}, or of {possible:.1f} m2 if walls are a pixel thinner than on the map"

    @property
    def is_followed(self) -> bool:
        """Whether the robot is on the line; False if cells are counted."""
        return self._ahead is not None and self._ahead.is_followed

    @property
    def is_worth_driving(self) -> bool:
        """Whether the line ahead sweeps enough floor to drive it; False if cells are counted."""
        if self._ahead is None:
            return False
        return self._ahead.tally.open_m2 - self._ahead.tally.left_m2 >= self._worth_m2

    def _credit(self, passed: NDArray[np.int32]) -> None:
        """Count passed cells as covered if hardly any of their floor is left.

        A polished line need not pass the stand of a cell. Cells in which no floor is asked for, as
        those of another robot's part, need a visit although no floor seems left in them.
        """
        ahead, floor, covered = self._ahead, self._map.floor, self._ledger.current
        assert ahead is not None
        assert floor is not None
        cells = dict.fromkeys((row, col) for row, col in passed.tolist())
        unseen = [cell for cell in cells if not covered.has_visited(cell)]
        if not unseen:
            return
        self._take_floor()
        if self._asked is None:
            return
        window, asked, _ = self._asked
        is_asked = window.values_at(asked, np.array(unseen, np.int32), 0).tolist()
        for cell, counts in zip(unseen, is_asked, strict=True):
            if counts and ahead.tally.missed_m2(floor.box_of(cell)) < LEAST_LEFT_M2:
                self._ledger.credit(cell)

    def open_missed(self) -> bool:
        """Open cells again whose floor left is worth the way; return whether there are any.

        To be called at the end of a path: the robot may have driven beside its line.
        """
        ahead, floor, lattice = self._ahead, self._map.floor, self._map.lattice
        stamped = self._map.pose
        if ahead is None or floor is None or lattice is None or stamped is None:
            return False
        assert self._missed is not None
        self._take_floor(ahead.tally.forget_passed())
        if self._asked is None:
            return False
        window, asked, _ = self._asked
        points = raster_to_map(floor.geometry, ahead.tally.missed().astype(np.float64))
        if len(points) * ahead.tally.unit_m**2 < LEAST_MISSED * ahead.tally.wanted_m2:
            return False
        found, pixels = np.unique(
            np.floor(points[:, ::-1] / lattice.cell_m).astype(np.int32), axis=0, return_counts=True
        )
        is_covered = asked & (self._ledger.current.visits(window) > 0)
        kept = window.values_at(is_covered, found, 0).astype(np.bool_)
        areas_m2 = pixels[kept] * floor.geometry.resolution**2
        cells = ((row, col) for row, col in found[kept].tolist())
        left_m2 = dict(zip(cells, areas_m2.tolist(), strict=True))
        here = lattice.cell_at(stamped.pose.x, stamped.pose.y)
        may_open = self._ledger.may_open_again
        again = self._missed.worth_the_way(left_m2, here, lattice.cell_m, may_open)
        if again:
            self._ledger.open_again(again)
        return bool(again)

    def _note_passed(self, passed: NDArray[np.int32]) -> None:
        """Note the passed cells, and drop those whose floor is swept."""
        ahead, floor, kept = self._ahead, self._map.floor, self._ledger.passed
        assert ahead is not None
        assert floor is not None
        for row, col in passed.tolist():
            kept.note((row, col))
        for cell in kept.next(LOOKED_AT) if len(passed) else ():
            if ahead.tally.open_in_m2(floor.box_of(cell, RIM_M)) < self._worth_m2:
                kept.drop(cell)

    def _explain(self) -> None:
        """Update the causes of unreachable floor where they may have changed."""
        ahead, floor, part = self._ahead, self._map.floor, self._unexplained
        assert ahead is not None
        assert floor is not None
        if part is None or self._asked is None or self._asked[0] != floor.stands.lattice.window:
            return
        self._unexplained = None
        whole = Window(0, 0, floor.geometry.rows, floor.geometry.cols)
        for strip in strips(part.intersection(whole) or NOWHERE):
            free = self._map.free_floor or floor
            ahead.tally.set_causes(strip, causes_of(floor, free, self._asked[2], strip))

    def _take_floor(self, touched: Window | None = None) -> None:
        """Update the tally where the floor to sweep may have changed."""
        ahead, floor = self._ahead, self._map.floor
        assert ahead is not None
        assert floor is not None
        swept = self._ledger.floor
        whole = Window(0, 0, floor.geometry.rows, floor.geometry.cols)
        # After a reset the floor is another object, and changed everywhere; likewise after
        # forgetting.
        known, since = self._swept
        news = swept.changed_since(since) if known is swept else ANYWHERE
        if known is not swept or swept.forgotten != self._forgotten:
            ahead.tally.forget_passed()
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
                    # The tool also reaches floor of the cells within, which is not asked for.
                    within = self._asked[2] & ~self._asked[1]
                    wanted &= ~floor.lying_in(within, strip)
                ahead.tally.set_open(strip, wanted, swept.swept_on(floor.geometry, strip))
        driven = pixels_under(news, floor.geometry).intersection(whole) if news else None
        if driven is not None and driven != part:
            for strip in strips(driven):
                ahead.tally.set_open(strip, None, swept.swept_on(floor.geometry, strip))
        self._swept = swept, swept.changes

    def _asked_part(self, floor: FloorMap) -> Window | None:
        """Update the asked-for cells; return the window of pixels where they changed."""
        area = self._map.area
        # Without a reachable area nothing is known; once there is one, everything is updated.
        if area is None or area.lattice.window != floor.stands.lattice.window:
            return None
        window = area.lattice.window
        asked = area.reachable & self._orders.cells.asked_of_me(area)
        asked = self._orders.scope.worth.first(asked, window)
        before, self._asked = self._asked, (window, asked, area.reachable)
        if before is None:
            return Window(0, 0, floor.geometry.rows, floor.geometry.cols)
        changed = asked != carried(before[1], before[0], window)
        changed |= area.reachable != carried(before[2], before[0], window)
        return floor.pixels_of(changed) if changed.any() else None
