"""Look around: a turn on the spot, for a robot whose map shows hardly more than its own place.

The first scan of open floor may leave gaps between its beams, so that the map shows the robot no
cell to drive to. Most mappers take in another scan only once the robot has moved or turned.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Point, Pose2D, Window
from fasaco_edge.grid.lattice import UNKNOWN, beside
from fasaco_edge.grid.reachable_area import ReachableArea
from fasaco_edge.mission.config import MissionConfig
from fasaco_edge.mission.events import Doing
from fasaco_edge.mission.map.map_state import MapState
from fasaco_edge.mission.path.route import Route
from fasaco_edge.states import State

# A map with at most this number of reachable cells shows hardly more than the robot's place: a
# robot with more cells drives, and sees more.
FEW_CELLS = 2
# The robot turns along a triangle with this side [m], as followers drive along points.
SIDE_M = 0.04
# Time for the turn and for a map made after it [s]. A robot farther than AWAY_M [m] from the place
# does not turn, or its pose has jumped.
LOOK_S, AWAY_M = 25.0, 0.3
WHY = "looks around: the map shows hardly more than the place where the robot stands"
WAITS = "waits for a map that shows more than the place where the robot stands"


class LookAround:
    """Turns the robot once, before its first path."""

    def __init__(self, config: MissionConfig, map_state: MapState, route: Route) -> None:
        self._map, self._route = map_state, route
        self._radius_m = config.footprint.robot_radius_m
        self._free_at_most = config.footprint.free_at_most
        self._can_turn = config.sweeping is None or config.sweeping.curves is None
        # Where and when the turn began, x, y [m] and [s]; whether its path is in force.
        self._begun: tuple[Point, float] | None = None
        self._turns = False

    def turn(self, area: ReachableArea | None, now: float) -> Doing | None:
        """Turn the robot, and wait for a map that shows more; None if there is something to drive.

        Args:
            area: the reachable area; None for a robot that is in no cell.
            now: time [s].
        """
        if self._route.requests.plans or (self._begun is None and self._route.revision):
            return None
        stamped, update = self._map.pose, None
        may_grow = self._map.is_on_unknown if area is None else _may_grow(area)
        if stamped is None or not may_grow or not self._can_turn or self._map.is_kept_out:
            return self._end(now) if area is None else None
        here = stamped.pose.x, stamped.pose.y
        if self._begun is None:
            if self._is_near_obstacle(here):
                return None
            self._begun, self._turns = (here, now), True
            update = self._route.publish_way_out(_triangle(stamped.pose), WHY, now)
        place, since = self._begun
        if self._turns and now - since <= LOOK_S and math.dist(here, place) <= AWAY_M:
            return Doing(State.COVERING, WHY, update)
        is_alone = area is not None and np.count_nonzero(area.reachable) == 1
        return self._end(now) or (Doing(State.BLOCKED, WAITS) if is_alone else None)

    def _end(self, now: float) -> Doing | None:
        """End the turn; None if it has ended before."""
        was_turning, self._turns = self._turns, False
        return Doing(State.BLOCKED, WAITS, self._route.stop(WAITS, now)) if was_turning else None

    def _is_near_obstacle(self, here: Point) -> bool:
        """Return whether the turn may touch an obstacle on the map."""
        grid = self._map.grid
        if grid is None:
            return True
        whole = grid.geometry.window
        col, row = (math.floor(at) for at in grid.geometry.to_pixels(*here))
        reach = math.ceil((self._radius_m + SIDE_M) / grid.geometry.resolution)
        square = Window(row - reach, col - reach, row + reach + 1, col + reach + 1)
        near = square.intersection(whole)
        if near is None:
            return False
        return bool((grid.cells[near.slices_in(whole)] > self._free_at_most).any())


def _may_grow(area: ReachableArea) -> bool:
    """Return whether few cells are reachable, and floor that has not been seen is beside them."""
    if np.count_nonzero(area.reachable) > FEW_CELLS:
        return False
    return bool((area.reachable & beside(area.lattice.states == UNKNOWN)).any())


def _triangle(pose: Pose2D) -> NDArray[np.float64]:
    """Return a way around a small triangle, float64 (4, 2): x, y [m]; it turns by 360 degrees."""
    yaws = pose.yaw + math.tau * np.arange(1, 4) / 3.0
    sides = SIDE_M * np.column_stack((np.cos(yaws), np.sin(yaws)))
    return np.array((pose.x, pose.y)) + np.vstack((np.zeros(2), np.cumsum(sides, axis=0)))
