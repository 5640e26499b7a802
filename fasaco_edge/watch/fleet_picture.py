"""The picture of a fleet: one map of all robots, what each has swept, its part, way and place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Bounds, Pose2D, union_bounds
from fasaco_edge.grid.occupancy import OccupancyGrid, known_bounds
from fasaco_edge.watch import picture
from fasaco_edge.watch.fleet_floor import REACHED, SWEPT, FleetFloor
from fasaco_edge.watch.fleet_robot import FleetRobot
from fasaco_edge.watch.picture import COLOURS, Frame, Kinds

# Longest edge of a picture; what is farther from the first robots is left out [m].
MOST_EDGE_M = 3_000.0
# A robot is drawn at least so large [pixels].
LEAST_RADIUS = 0.8


class FleetPicture:
    """Draws a fleet; maps and cells are drawn again only where they changed.

    Attributes:
        pixel_m: edge of a pixel of that picture [m]; None before the first.
    """

    def __init__(self) -> None:
        self.pixel_m: float | None = None
        self._key: tuple[object, ...] = ()
        self._bounds: Bounds | None = None
        self._known: dict[int, tuple[OccupancyGrid, Bounds | None]] = {}
        self._frame: Frame | None = None
        self._ground: Kinds | None = None
        self._drawn: tuple[tuple[object, ...], Kinds] | None = None

    def kinds(
        self,
        robots: Sequence[FleetRobot],
        maps: Sequence[OccupancyGrid],
        floor: FleetFloor,
        columns: int,
        lines: int,
    ) -> Kinds | None:
        """Return a picture, uint8 (2 * lines, columns); None while there is nothing to show."""
        colours = tuple((robot.name, robot.number, robot.place) for robot in robots)
        # Grids and floors are values: a new one is another object.
        if (key := (floor, *maps, *colours)) != self._key:
            self._key, self._ground = key, None
            self._bounds = self._joined([*maps, *floor.cells.values()])
        bounds = self._bounds or _near([(at.x, at.y, at.x, at.y) for at in robots])
        if bounds is None:
            return None
        frame = Frame.over(bounds, columns, lines)
        if frame != self._frame or self._ground is None:
            self._frame = frame
            self._ground = _ground(self._walls(frame, maps), frame, robots, floor)
        self.pixel_m = frame.pixel_m
        kinds = self._ground.copy()
        present = sorted(robots, key=lambda robot: robot.silent_s is None)
        for robot in present:
            if robot.silent_s is None:
                _draw_way(kinds, frame, robot)
        for robot in present:
            _draw_robot(kinds, frame, robot)
        return kinds

    def _joined(self, grids: Sequence[OccupancyGrid]) -> Bounds | None:
        before = self._known
        self._known = {
            id(grid): before.get(id(grid)) or (grid, known_bounds(grid)) for grid in grids
        }
        return _near([bounds for _, bounds in self._known.values() if bounds is not None])

    def _walls(self, frame: Frame, maps: Sequence[OccupancyGrid]) -> Kinds:
        """Return the kinds of all pixels by all maps: what is wall on one is wall."""
        key = (frame, *maps)
        if self._drawn is None or self._drawn[0] != key:
            kinds = np.full(frame.shape, picture.UNKNOWN, np.uint8)
            for grid in maps:
                kinds = np.maximum(kinds, picture.ground(frame, grid, None))
            self._drawn = key, kinds
        return self._drawn[1]


def _near(parts: Sequence[Bounds]) -> Bounds | None:
    """Return the bounds of parts; one far away from those before it is left out."""
    joined: Bounds | None = None
    for part in parts:
        both = union_bounds(joined, part)
        if both is not None and max(both[2] - both[0], both[3] - both[1]) <= MOST_EDGE_M:
            joined = both
    return joined


def _ground(walls: Kinds, frame: Frame, robots: Sequence[FleetRobot], floor: FleetFloor) -> Kinds:
    """Return the kinds of all pixels, uint8 (2 * lines, columns), without ways and robots."""
    cells = np.full(frame.shape, picture.UNKNOWN, np.uint8)
    sampled = {name: frame.sampled(grid, 1, -1) for name, grid in floor.cells.items()}
    for values in sampled.values():
        cells[values == REACHED] = picture.TO_COVER
    if floor.parts is not None:
        tints = np.zeros(256, np.uint8)
        for robot in robots:
            tints[robot.number] = picture.PARTS[robot.place % COLOURS]
        parts = tints[frame.sampled(floor.parts, 1, -1).view(np.uint8)]
        cells[parts > 0] = parts[parts > 0]
    seen: NDArray[np.bool_] = np.zeros(frame.shape, np.bool_)
    for robot in robots:
        if robot.name not in sampled:
            continue
        swept = sampled[robot.name] == SWEPT
        cells[swept] = np.where(seen[swept], picture.TWICE, picture.SWEPT[robot.place % COLOURS])
        seen |= swept
    hidden = (cells == picture.UNKNOWN) | (walls == picture.WALL)
    return np.where(hidden, walls, cells)


def _draw_way(kinds: Kinds, frame: Frame, robot: FleetRobot) -> None:
    """Draw the next metres of a robot's path."""
    points = np.concatenate([np.array([[robot.x, robot.y]]), robot.ahead])
    lengths = np.hypot(*np.diff(points, axis=0).T)
    way = np.concatenate([[0.0], np.cumsum(lengths)])
    # Of a way as long as can be told no more points than the picture has pixels.
    length_m = min(float(way[-1]), frame.pixel_m * sum(frame.shape) * 2)
    at = np.append(np.arange(0.0, length_m, frame.pixel_m / 2), length_m)
    xy = np.stack([np.interp(at, way, points[:, axis]) for axis in (0, 1)], axis=-1)
    picture.draw_points(kinds, frame, xy, picture.WAYS[robot.place % COLOURS])


def _draw_robot(kinds: Kinds, frame: Frame, robot: FleetRobot) -> None:
    """Draw a robot's disc, and its heading if that is known."""
    radius_m = max(robot.radius_m, LEAST_RADIUS * frame.pixel_m)
    colour = robot.place % COLOURS
    picture.draw_disc(kinds, frame, robot.x, robot.y, radius_m, picture.DISCS[colour])
    if robot.yaw is not None:
        heading = picture.HEADING + picture.EIGHTHS * (1 + colour)
        picture.draw_heading(kinds, frame, Pose2D(robot.x, robot.y, robot.yaw), heading)
