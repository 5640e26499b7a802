"""Line layer: converts each path over cells to the line that is published.

It follows map, poses and paths, and publishes a changed line even if the path is unchanged.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.kernels.floor.bits import unpacked
from fasaco_edge.mission.config import Sweeping
from fasaco_edge.mission.coverage.mission_ledger import MissionLedger
from fasaco_edge.mission.events import PathUpdate
from fasaco_edge.mission.line.curver import Curver
from fasaco_edge.mission.line.floor_left import UnsweptTally
from fasaco_edge.mission.line.laying import lay, lay_blocked
from fasaco_edge.mission.line.line_ahead import LineAhead
from fasaco_edge.mission.line.place_on_line import Offset
from fasaco_edge.mission.line.polisher import Polisher
from fasaco_edge.mission.line.polyline import CURVED
from fasaco_edge.mission.line.published_line import Publication
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.path.route import Route
from fasaco_edge.mission.work.sequencer import Sequencer


class AheadFigures(NamedTuple):
    """Time that the line ahead takes, and a lower bound for any line that sweeps as much [s].

    A tool of width w sweeps at most w l + pi w^2 / 4 along a line of length l; turns are left out.
    """

    seconds: float
    least_s: float

    @property
    def gap(self) -> float | None:
        """Excess of the time over the bound, as a share of the bound; None if the bound is 0."""
        return max(self.seconds / self.least_s - 1.0, 0.0) if self.least_s > 0.0 else None


class LineLayer:
    """Owns the line; inactive when only cells are counted.

    Attributes:
        left: the floor that the line has to sweep.
        offset: the robot's constant offset from the line.
    """

    def __init__(
        self,
        sweeping: Sweeping | None,
        map_state: MapState,
        ledger: MissionLedger,
        orders: Sequencer,
        route: Route,
    ) -> None:
        self._map, self._orders, self._route = map_state, orders, route
        self.left = UnsweptTally(sweeping, map_state, ledger, orders)
        self.offset = Offset(sweeping.tool_m if sweeping else 0.0)
        self._config = sweeping.line if sweeping else None
        self._polisher = Polisher(sweeping.line) if sweeping else None
        self._curver = Curver(sweeping.curves) if sweeping and sweeping.curves else None
        self._publication = Publication(route, sweeping.line.speed_m_s if sweeping else 0.0)
        self._ahead: LineAhead | None = None
        # Windows of map and floor that may have changed since the last update, and since the last
        # check of the line, which waits while the robot is stopped.
        self._touched: Window | None = None
        self._unchecked: Window | None = None
        self._is_dropped = self._is_settled = False
        # The floor at the last update, and its revision.
        self._seen: tuple[FloorMap | None, int] = None, 0

    def receive_map(self) -> None:
        """Follow the newest map; to be called with each map."""
        floor = self._map.ground.floor
        if floor is None or (floor is self._seen[0] and floor.revision == self._seen[1]):
            return
        self._seen = floor, floor.revision
        if self._ahead is None:
            self._ahead = LineAhead(floor, is_curved=self._curver is not None)
        elif self._ahead.follow_floor(floor):
            self._is_dropped = True
        if self.left.follow(floor, self._ahead.tally):
            self._touched = self._unchecked = floor.geometry.window
            return
        assert floor.shift is not None
        touched, self._unchecked = (
            window and window.moved(*floor.shift) for window in (self._touched, self._unchecked)
        )
        self._touched = Window.around(touched, floor.touched)

    def receive_pose(self, pose: Pose2D, farthest_m: float = 0.0) -> None:
        """Take in the robot's pose, and find its place on the line.

        ``farthest_m``: the farthest it may have driven since the previous pose; 0 if unknown [m].
        """
        ahead = self._ahead
        if ahead is None:
            return
        # Forgotten floor is reopened before the robot passes more.
        if self.left.has_forgotten:
            self.left.update()
        before = self._route.held.index
        ahead.drive(pose, farthest_m)
        self.offset.record((pose.x, pose.y), ahead.beside)
        self._route.record_index(ahead.cell)
        path = self._route.held
        self.left.pass_cells(path.cells[before : path.index])
        is_on_it = ahead.is_followed and len(path.cells) > 0
        row, col = path.cells[path.index].tolist() if is_on_it else (0, 0)
        self._map.set_path_cell((row, col) if is_on_it else None)

    def finish(self, update: PathUpdate | None, now: float) -> PathUpdate | None:
        """Return the update to publish after a step, with or without a new path."""
        ahead, stamped = self._ahead, self._map.pose
        if (
            ahead is None
            or stamped is None
            or self._polisher is None
            or self._map.ground.floor is None
        ):
            self._publication.line.reset()
            return update
        touched, self._touched = self._touched, None
        self._unchecked = Window.around(self._unchecked, touched)
        self.left.update(touched)
        reason, path = "", self._route.path
        # The line may skip cells, so the robot's cell may be ahead of its place on the line.
        is_further = path.index > ahead.cell
        if update is not None:
            is_kept = self._route.is_cut or self._route.aside is not None
            if is_kept and not len(update.cells):
                ahead.stop()
            else:
                self._lay(ahead, update.cells, stamped.pose)
                update = self._with_price(update, ahead)
        elif self._is_dropped or (is_further and touched is not None):
            self._lay(ahead, path.ahead, stamped.pose)
            if len(path.ahead):
                why = "map on another raster" if self._is_dropped else "robot further on its path"
                update = replace(self._route.publish_anew(why, now), may_wait=True)
        if ahead.is_cut and not self._route.is_cut:
            ahead.end_at_cut()  # no path beyond the cut is kept
        self._is_dropped = False
        is_driven = len(self._route.path.cells) > 0
        if is_driven and self._unchecked is not None:
            reason = "line blocked" if lay_blocked(ahead, self._unchecked) else ""
            self._unchecked = self._unchecked if ahead.is_cut else None
        if touched is not None:
            self._is_settled = not self._orders.cells.is_exploring
        # Urgent updates are published unpolished. In a step with a map or a plan only a change that
        # is due is polished; other polishing comes with the next pose.
        held = self._publication.compare(ahead)
        may_change = (update is None or update.may_wait) and not reason and not is_further
        is_new = update is not None or touched is not None
        may_change = may_change and not (
            is_new and (ahead.is_cut or not self._publication.line.is_near)
        )
        # A way is not polished, as the robot does not sweep along it.
        if may_change and is_driven and not self._is_way:
            held = max(held, ahead.line.first_below(CURVED)) if self._curver else held
            factor = self.left.price_factor if self._is_settled else 1.0
            self._polisher.polish(
                ahead, self._map.ground.floor, held, factor, is_settled=self._is_settled
            )
            self._publication.compare(ahead)
        if self._curver is None:
            return self._publication.finish(ahead, update, reason, now, is_way=self._is_way)
        reason = self._curve(self._curver, ahead, self._map.ground.floor, stamped.pose) or reason
        update = self._publication.finish(ahead, update, reason, now, is_way=self._is_way)
        if update is None or update.xy is None:
            return update
        return replace(update, yaw=self._curver.yaw(update.xy, stamped.pose))

    def _with_price(self, update: PathUpdate, ahead: LineAhead) -> PathUpdate:
        """Return a path; if the robot returns for floor on it, with the time in its reason."""
        share = self.left.share
        if not share.why or update.reason != share.why or self._config is None:
            return update
        seconds = self._config.seconds(ahead.from_place(), ahead.tally.unit_m)
        return replace(update, reason=share.priced(seconds))

    def _curve(self, curver: Curver, ahead: LineAhead, floor: FloorMap, pose: Pose2D) -> str:
        """Make the next curve if it is due; return why to publish a way at once, or ""."""
        if not curver.curve(ahead, floor, pose):
            return ""
        self._publication.compare(ahead)
        return "curve further ahead" if self._is_way else ""

    @property
    def _is_way(self) -> bool:
        """Whether the path is only a way: home, to the dock or to a refuge.

        The path home at the usual end of an order is no way: the robot sweeps along it.
        """
        state = self._orders.order_state
        return bool(state.errand or state.late) or self._route.aside is not None

    def _lay(self, ahead: LineAhead, cells: NDArray[np.int32], pose: Pose2D) -> None:
        """Lay the line along cells; a way leads straight to the goal, clear of other robots."""
        beside, is_cut = self._route.beside, self._route.is_cut
        lay(ahead, cells, pose, is_cut=is_cut, keeps=not self._is_way, beside=beside)

    def unswept(self) -> tuple[GridGeometry, NDArray[np.uint8]] | None:
        """Return the raster, and why its pixels are not swept, uint8 (rows, cols) of ``Unswept``;
        None without a floor."""
        floor = self._map.ground.floor
        if floor is None or self._ahead is None or self.left.areas is None:
            return None
        return floor.geometry, self._ahead.tally.unswept()

    def floor_in_reach(
        self, most: int
    ) -> tuple[GridGeometry, NDArray[np.bool_], NDArray[np.bool_]] | None:
        """Return which squares of the floor the tool can reach, and which of these are swept, bool.

        None without a floor. ``most``: limit on the number of squares; if there are more pixels,
        squares are wider, and have the values of the pixels in their middle.
        """
        floor = self._map.ground.floor
        if floor is None or self._ahead is None or self.left.areas is None:
            return None
        whole = floor.geometry
        step = math.ceil(math.sqrt(max(whole.rows * whole.cols / most, 1.0)))
        within, swept = self._ahead.tally.sampled(step)
        blocked = unpacked(floor.blocked[step // 2 :: step], whole.cols)
        within &= ~blocked[:, step // 2 :: step]
        rows, cols = within.shape
        square_m = whole.resolution * step
        return replace(whole, rows=rows, cols=cols, resolution=square_m), within, swept & within

    def ahead(self) -> AheadFigures | None:
        """Return figures of the line ahead; None without a line."""
        to_sweep, floor = self.left.areas, self._map.ground.floor
        if self._ahead is None or self._config is None or to_sweep is None or floor is None:
            return None
        seconds = self._config.seconds(self._ahead.from_place(), self._ahead.tally.unit_m)
        tool_m = floor.discs.tool_m
        length_m = (to_sweep.ahead_m2 - math.pi * tool_m**2 / 4.0) / tool_m
        return AheadFigures(seconds, max(length_m, 0.0) / self._config.speed_m_s)

    @property
    def is_followed(self) -> bool:
        """Whether the robot is on the line; False if cells are counted."""
        return self._ahead is not None and self._ahead.is_followed
