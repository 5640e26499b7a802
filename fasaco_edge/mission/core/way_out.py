"""Way out: back along the driven track, for a robot that the map has shut in.

On the next map a gap that the robot has just driven through may be too narrow: a wall is a pixel
thicker there, or a chair has moved. The robot fits wherever it has stood, so it drives back along
its track, with a smaller margin.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.fine_raster import map_to_raster
from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import Point, Pose2D
from fasaco_edge.grid.lattice import Cell
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.mission.events import Doing
from fasaco_edge.mission.line.way import LEAST_SHARE, fitting_radius, is_clear_between
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.map.stay import Stay
from fasaco_edge.mission.path.route import Route
from fasaco_edge.mission.work.sequencer import Sequencer
from fasaco_edge.states import State

# Length of the track that is kept, and spacing of its points [m].
TRACK_M, SPACING_M = 40.0, 0.05
# On the way out the robot may come this much nearer to walls [pixels of the map]: a wall may be a
# pixel thicker on the map than it is, and the pose off by half a pixel.
SQUEEZE_PX = 1.5
# A robot that moves less than STANDING_M [m] on its way out in STANDING_S [s] cannot drive it. The
# robot tries again after that time, which doubles with each failure.
STANDING_M, STANDING_S = 0.1, 15.0
# The way out leads this many points of the track past the first place where the robot can continue.
INTO_POINTS = 4
# Lengths of loops that are left out, the longest first [points of the track].
LEAPS = (256, 128, 64, 32, 16, 8, 4, 2)
NO_WAY: NDArray[np.float64] = np.empty((0, 2))


class WayOut:
    """Keeps the track, and leads the robot out along it.

    Attributes:
        why: what shuts the robot in; "" for nothing.
    """

    def __init__(self, map_state: MapState, orders: Sequencer, route: Route) -> None:
        self.why = ""
        self._map, self._orders, self._route = map_state, orders, route
        self._track: deque[Point] = deque(maxlen=round(TRACK_M / SPACING_M))
        # Where the way out leads to, and the floor on which it was found.
        self._to: Point | None = None
        self._seen: tuple[FloorMap | None, int] = None, 0
        # Where the robot stands, and the number of ways from there that it could not drive.
        self._stay, self._tries = Stay(STANDING_M), 0

    def receive_pose(self, pose: Pose2D) -> None:
        """Add the robot's place to the track."""
        here = pose.x, pose.y
        if not self._track or math.dist(here, self._track[-1]) >= SPACING_M:
            self._track.append(here)

    def continue_from(self, before: WayOut) -> None:
        """Continue with the track of a predecessor."""
        self._track = before._track

    def forget_why(self) -> None:
        """Begin a step: nothing shuts the robot in so far."""
        self.why = ""

    def forget_track(self) -> None:
        """Forget the track: the robot was carried, or drove it on another map."""
        self._track.clear()

    def lead_out(self, why: str, now: float, goal: Cell | None = None) -> Doing:
        """Lead the robot back along its track, to a place where it can continue, or to a goal.

        A robot in a keep-out zone stays, as a person has drawn the zone. To be called in each step
        while the robot cannot continue.

        Args:
            why: what shuts it in.
            now: time [s].
            goal: destination; None for the nearest work.
        """
        if self._map.is_kept_out:
            return Doing(State.BLOCKED, why)

        def leads_on(area: ReachableArea) -> bool:
            return area.contains(goal) if goal else not self._orders.is_shut_in(area)

        way, update = self._lead(leads_on, why, now), None
        back = f"{why}: drives back along its track"
        if way is not None:
            update = self._route.publish_way_out(way, back if len(way) else why, now)
        if self._route.is_way_out:
            return Doing(State.COVERING, back, update)
        return Doing(State.BLOCKED, why, update)

    def why_shut_in(self, area: ReachableArea) -> str:
        """Return what shuts the robot in; "" if it can reach most of its former area."""
        if not self._orders.is_shut_in(area):
            return ""
        reached, once = self._orders.uncovered.reached_m2(area)
        return f"shut in: {reached:.1f} of {once:.1f} m2 in reach"

    def _lead(
        self, leads_on: Callable[[ReachableArea], bool], why: str, now: float
    ) -> NDArray[np.float64] | None:
        """Return the way to publish, float64 (n, 2): x, y [m]; None to continue as before."""
        self.why = why
        floor, stamped, drives = self._map.ground.floor, self._map.pose, self._route.is_way_out
        assert stamped is not None
        here = stamped.pose.x, stamped.pose.y
        has_moved = self._stay.update(here, now)
        if has_moved:
            self._tries = 0
        waits_s = now - self._stay.since
        seen, self._seen = self._seen, (floor, floor.revision if floor else 0)
        if drives and waits_s > STANDING_S:
            self._stay.count_from(now)
            self._tries += 1
            return NO_WAY
        if self._tries and not drives and waits_s <= STANDING_S * 2 ** (self._tries - 1):
            return None
        is_same_floor = seen[0] is floor and seen[1] == self._seen[1]
        knows_none = self._to is None and not (has_moved or self._tries)
        if is_same_floor and (drives or knows_none):
            return None
        way = self._find(leads_on)
        to, self._to = self._to, tuple(way[-1].tolist()) if len(way) else None
        if drives:
            return None if to == self._to else way
        self._stay.count_from(now)
        return way

    def _find(self, leads_on: Callable[[ReachableArea], bool]) -> NDArray[np.float64]:
        """Return the way from the robot back to where it can continue, float64 (n, 2): x, y [m].

        The way is empty, (0, 2), if there is none, or no map of the floor.
        """
        floor, lattice, stamped = self._map.ground.floor, self._map.ground.lattice, self._map.pose
        if floor is None or lattice is None or stamped is None or self._map.grid is None:
            return NO_WAY
        here = stamped.pose.x, stamped.pose.y
        way = [here, *reversed(self._track)]
        raster = [np.array(map_to_raster(floor.geometry, x, y)) for x, y in way]
        full_px = floor.discs.radius_m / floor.geometry.resolution
        squeeze_px = SQUEEZE_PX * self._map.grid.geometry.resolution / floor.geometry.resolution
        radius = max(full_px - squeeze_px, LEAST_SHARE * full_px)
        radius = min(radius, fitting_radius(floor, raster[0]))
        if radius < LEAST_SHARE * full_px:
            return NO_WAY
        # Cells of areas in which the robot cannot continue, its own among them.
        seen = np.zeros(lattice.states.shape, bool)
        for index, (a, b) in enumerate(pairwise(raster), start=1):
            if not is_clear_between(floor, a, b, radius):
                break
            cell = lattice.cell_at(*way[index])
            is_coverable = lattice.contains(cell) and lattice.coverable[lattice.local(cell)]
            if not is_coverable or seen[lattice.local(cell)] or not is_clear_between(floor, b, b):
                continue
            area = ReachableArea.around(lattice, cell)
            if leads_on(area):
                # Lead well into the cell: at its border the robot may still count as outside.
                end = index
                while end < min(index + INTO_POINTS, len(way) - 1) and is_clear_between(
                    floor, raster[end], raster[end + 1]
                ):
                    end += 1
                found = np.array(way)[_without_loops(floor, raster[: end + 1])]
                return found if end > index else self._into(cell, found, radius)
            seen |= area.reachable
        return NO_WAY

    def _into(self, cell: Cell, way: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
        """Return a way that leads on to the stand of its last cell, if it can.

        A way that ends at the border of that cell may be too short to be driven.
        """
        floor, stand = self._map.ground.floor, self._map.ground.place_of(cell)
        if floor is None or stand is None:
            return way
        a, b = (np.array(map_to_raster(floor.geometry, *at)) for at in (way[-1].tolist(), stand))
        return np.vstack((way, stand)) if is_clear_between(floor, a, b, radius) else way


def _without_loops(floor: FloorMap, track: list[NDArray[np.float64]]) -> list[int]:
    """Return the indices of a track's points that remain without its loops.

    Loops are left out only where the robot's whole disc fits; elsewhere the way keeps to the track.
    """
    kept, last = [0], len(track) - 1
    while kept[-1] < last:
        at = kept[-1]
        ahead = [at + leap for leap in LEAPS if at + leap <= last]
        clear = (n for n in ahead if is_clear_between(floor, track[at], track[n]))
        kept.append(next(clear, at + 1))
    return kept
