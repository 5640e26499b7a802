"""Back-out: how a robot that stands inside a wall of the map leaves it, back along its track.

There it does not fit even with the margin of a way out: map or pose are off. Where the hull has
stood, it fits, whatever the map shows: ground that was driven outweighs pixels, unless something
new is there.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.fine_raster import map_to_raster
from fasaco_edge.grid.floor_map import FloorMap
from fasaco_edge.grid.geometry import Point
from fasaco_edge.grid.lattice import UNKNOWN
from fasaco_edge.mission.line.lead_out import squeezed_radius
from fasaco_edge.mission.line.way import comes_nearer, is_clear_between
from fasaco_edge.mission.map.map_state import MapState

# A robot that has stood inside a wall without a way for this long [s] backs out, over this length
# of its track [m] in all until it fits.
WAITS_S, MOST_M = 10.0, 1.5
# A robot that moves less than this stands [m]; a way that is shorter than the second leads nowhere.
STANDING_M, SHORT_M = 0.1, 0.05
# It leaves out what it drove, up to this length [m], before it came to the same place again [m].
LOOP_M, SAME_M = 5.0, 0.1
# The way leads on by so many points of the track once the robot fits.
INTO_POINTS = 4
NO_WAY: NDArray[np.float64] = np.empty((0, 2))
NOWHERE: Point = (math.inf, math.inf)


class BackOut:
    """Leads the robot out of a wall, over a track that is taken back as the robot passes it.

    Attributes:
        has_given_up: whether it has backed out as far as it may, and still does not fit.
    """

    def __init__(self, map_state: MapState, track: deque[Point]) -> None:
        self.has_given_up = False
        self._map, self._track = map_state, track
        # How much of the track it may still drive [m]; None for a robot that does not back out.
        self._left_m: float | None = None
        # Where the robot stands, and since when [s], in steps without a pause between them.
        self._place, self._since = NOWHERE, -math.inf
        self._is_asked = False
        # End of the way that it drives.
        self._to: Point | None = None

    @property
    def is_begun(self) -> bool:
        """Whether the robot has begun to back out, and has not come to floor where it fits."""
        return self._left_m is not None

    def succeed(self, before: BackOut) -> None:
        """Go on with what another mission has begun, on the same track."""
        self._left_m, self.has_given_up = before._left_m, before.has_given_up

    def begin_step(self) -> None:
        """Begin another step: a step without ``lead`` ends the robot's wait."""
        if not self._is_asked:
            self._place = NOWHERE
        self._is_asked = False

    def end(self) -> None:
        """Note that the robot fits, or has another way."""
        self._left_m, self.has_given_up = None, False

    def note_pose(self, here: Point) -> None:
        """Take the track back to where a robot is that backs out; end once it fits there."""
        floor = self._map.floor
        if self._left_m is None or floor is None:
            return
        points, along_m = _behind(self._track, self._left_m)
        passed, apart_m = _place_along(points, here)
        self._left_m -= float(along_m[passed])
        for _ in range(passed):
            self._track.pop()
        if apart_m > floor.discs.radius_m:
            self._track.clear()  # it was driven elsewhere
            self.end()
        elif is_clear_between(floor, at := _on_raster(floor, here), at):
            self.end()

    def lead(
        self, here: Point, now: float, others: NDArray[np.float64], *, drives: bool
    ) -> NDArray[np.float64] | None:
        """Return the way to publish, float64 (n, 2): x, y [m]; None to go on as before.

        To be called in each step in which the robot is shut in without another way.

        Args:
            here: where it is.
            now: the time [s].
            others: other robots, see ``Waiting.discs``.
            drives: whether it drives a way of this.
        """
        self._is_asked = True
        if not drives and math.dist(here, self._place) > STANDING_M:
            self._place, self._since = here, now
        if not drives and now - self._since <= WAITS_S:
            return None
        if not (self.is_begun or self._is_inside(here)):
            return NO_WAY if drives else None
        track, left_m = list(self._track), self._left_m
        if left_m is None:
            track, left_m = [*_before_loop(track, here), here], MOST_M
        # The newest point is the robot's place, or passed.
        points, _ = _behind(track, left_m)
        way = self._way(np.array([here, *points[1:].tolist()]), others)
        before, self._to = self._to, tuple(way[-1].tolist()) if len(way) else None
        self.has_given_up = self.is_begun and not len(way)
        if len(way) and not self.is_begun:
            self._track.clear()
            self._track.extend(track)
            self._left_m = left_m
        return None if drives and self._to == before else way

    def _is_inside(self, here: Point) -> bool:
        """Return whether the robot stands inside a wall: on a map that shows floor, and known."""
        floor, free, grid = self._map.free_floor, self._map.free, self._map.grid
        if floor is None or free is None or grid is None:
            return False
        if not (self._track and self._map.shows_floor):
            return False
        cell = free.cell_at(*here)
        if not free.contains(cell) or free.states[free.local(cell)] == UNKNOWN:
            return False
        at, radius = _on_raster(floor, here), squeezed_radius(floor, grid.geometry.resolution)
        return not is_clear_between(floor, at, at, radius)

    def _way(self, way: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a way from the robot along its track, (n, 2): x, y [m], up to where it fits.

        It ends before keep-out zones. (0, 2) if it is too short, or leads nearer to another robot
        or to something that the map does not show.
        """
        floor = self._map.floor
        assert floor is not None
        raster = [_on_raster(floor, point) for point in way.tolist()]
        beside = np.concatenate([self._map.obstacles.discs(), others])
        end = fitting = 0
        for index, (a, b) in enumerate(pairwise(raster), start=1):
            if floor.touches_keep_out(a, b) or (fitting and not is_clear_between(floor, a, b)):
                break
            if comes_nearer(way[index - 1], way[index], beside):
                return NO_WAY
            end = index
            fitting += is_clear_between(floor, b, b)
            if fitting > INTO_POINTS:
                break
        length_m = float(np.hypot(*np.diff(way[: end + 1], axis=0).T).sum())
        return way[: end + 1] if length_m >= SHORT_M else NO_WAY


def _on_raster(floor: FloorMap, point: Point) -> NDArray[np.float64]:
    return np.array(map_to_raster(floor.geometry, *point))


def _behind(
    track: Sequence[Point], most_m: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the newest points of a track, the newest first, and how far along it they are.

    float64 (n, 2), n >= 1: x, y [m]; and float64 (n,), up to ``most_m`` [m].
    """
    points = np.array(track)[::-1]
    along_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    count = max(int((along_m <= most_m).sum()), 1)
    return points[:count], along_m[:count]


def _before_loop(track: list[Point], here: Point) -> list[Point]:
    """Return a track up to where it was at this place before; all of it if it was not lately."""
    points, _ = _behind(track, LOOP_M)
    been = np.flatnonzero(np.hypot(*(points - here).T) <= SAME_M)
    return track[: len(track) - int(been[-1])] if len(been) else track


def _place_along(points: NDArray[np.float64], here: Point) -> tuple[int, float]:
    """Return the number of the last point that was passed, and how far beside the way a place is.

    Args:
        points: the way, float64 (n, 2), n >= 1: x, y [m].
        here: the place.
    """
    if len(points) == 1:
        return 0, math.dist(here, points[0])
    edges, to = np.diff(points, axis=0), here - points[:-1]
    share = (to * edges).sum(axis=1) / np.maximum((edges * edges).sum(axis=1), 1e-12)
    apart_m = np.hypot(*(to - np.clip(share, 0.0, 1.0)[:, None] * edges).T)
    nearest = int(np.argmin(apart_m))
    return nearest, float(apart_m[nearest])
