"""Picture of a mission in half blocks, and the data that it shows: map, coverage, path, robot."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.client.robot_state import RobotState, WatchedPath
from fasaco_edge.grid.geometry import Bounds, Pose2D, union_bounds
from fasaco_edge.grid.label_place import label_place
from fasaco_edge.grid.occupancy import OccupancyGrid, known_bounds
from fasaco_edge.wire.documents.json_text import decode_document
from fasaco_edge.wire.documents.path_documents import PathAttachment
from fasaco_edge.wire.documents.rooms import Rooms
from fasaco_edge.wire.documents.settings import known_settings
from fasaco_edge.wire.messages.maps import CoverageValue, decode_map_update, decode_occupancy_grid
from fasaco_edge.wire.messages.paths import decode_path

LEAST_PIXEL_M = 0.01
# Step in which the area shown grows [m], so that the picture does not jump with each row of a map.
ROUNDED_TO_M = 0.5


class RobotView(RobotState):
    """The newest map, coverage, path, pose and status of one robot, and the latest events.

    Attributes:
        map, coverage: None before the first.
    """

    def __init__(self, robot: str) -> None:
        super().__init__(robot)
        self.map: OccupancyGrid | None = None
        self.coverage: OccupancyGrid | None = None
        self._readers |= {
            "map": self._read_map,
            "map_update": self._read_map_update,
            "path": self._read_path,
            "coverage": self._read_coverage,
        }

    @property
    def path_ahead(self) -> NDArray[np.float64]:
        """The path still to drive, float64 (n, 2) [m], from the robot's position."""
        rest = np.array(self.walk.xy[self.walk.at + 1 :], np.float64).reshape(-1, 2)
        if not len(rest):
            return rest
        pose = self.pose
        here = self.walk.xy[self.walk.at] if pose is None else (pose.x, pose.y)
        return np.concatenate([np.array([here]), rest])

    def _read_map(self, sample: Sample, _: float) -> None:
        self.map = decode_occupancy_grid(sample.payload)

    def _read_map_update(self, sample: Sample, _: float) -> None:
        patch = decode_map_update(sample.payload)
        # Updates of a map that this process has not received are ignored.
        if self.map is not None:
            self.map = self.map.patched(patch)

    def _read_path(self, sample: Sample, now: float) -> None:
        about = decode_document(sample.attachment or b"{}", PathAttachment)
        self.walk = WatchedPath(decode_path(sample.payload).xy, about.revision)
        steps = f"{about.steps} steps" if len(self.walk.xy) else "stop"
        self.events.add(now, f"path {about.revision}, {steps}: {about.reason}")

    def _read_coverage(self, sample: Sample, _: float) -> None:
        self.coverage = decode_occupancy_grid(sample.payload)


@dataclass(frozen=True, slots=True)
class Frame:
    """A raster of square pixels over the map frame, y upwards: row 0 is its northern edge.

    Two pixels, one above the other, make a character.

    Attributes:
        left, top: map coordinates of the upper left corner [m].
        pixel_m: edge of a pixel [m].
        columns, lines: size in characters; there are ``2 * lines`` rows of pixels.
    """

    left: float
    top: float
    pixel_m: float
    columns: int
    lines: int

    @classmethod
    def over(cls, bounds: Bounds, columns: int, lines: int) -> Frame:
        """Return the largest frame in a number of characters that shows all of ``bounds``.

        Args:
            bounds: x0, y0, x1, y1 [m].
            columns, lines: the space for the frame, each at least 1.
        """
        x0, y0 = (math.floor(low / ROUNDED_TO_M) * ROUNDED_TO_M for low in bounds[:2])
        x1, y1 = (math.ceil(high / ROUNDED_TO_M) * ROUNDED_TO_M for high in bounds[2:])
        pixel_m = max((x1 - x0) / columns, (y1 - y0) / (2 * lines), LEAST_PIXEL_M)
        left = (x0 + x1 - columns * pixel_m) / 2
        top = (y0 + y1 + 2 * lines * pixel_m) / 2
        return cls(left, top, pixel_m, columns, lines)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of pixels."""
        return 2 * self.lines, self.columns

    def pixels(self, xy: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the pixels (row, col), int64 (n, 2), that contain points (x, y) [m], (n, 2)."""
        cols = np.floor((xy[:, 0] - self.left) / self.pixel_m)
        rows = np.floor((self.top - xy[:, 1]) / self.pixel_m)
        beyond = 2.0**31
        return np.stack([rows, cols], axis=-1).clip(-beyond, beyond).astype(np.int64)

    def sampled(self, grid: OccupancyGrid, per_pixel: int = 1) -> NDArray[np.int8]:
        """Return a grid's values on this raster, int8 (rows * per_pixel, cols * per_pixel).

        There are ``per_pixel`` samples per pixel and axis; outside the grid the value is -1.
        """
        rows, cols = (size * per_pixel for size in self.shape)
        step, origin = self.pixel_m / per_pixel, grid.geometry.origin
        scale = 1.0 / grid.geometry.resolution
        dx = (self.left + (np.arange(cols) + 0.5) * step - origin.x)[None, :] * scale
        dy = (self.top - (np.arange(rows) + 0.5) * step - origin.y)[:, None] * scale
        if origin.yaw == 0.0:
            # A row and a column of indices are enough.
            col, row = np.floor(dx).astype(np.int64), np.floor(dy).astype(np.int64)
        else:
            cos, sin = math.cos(origin.yaw), math.sin(origin.yaw)
            col = np.floor(cos * dx + sin * dy).astype(np.int64)
            row = np.floor(cos * dy - sin * dx).astype(np.int64)
        height, width = grid.cells.shape
        inside = (row >= 0) & (row < height) & (col >= 0) & (col < width)
        values = grid.cells[row.clip(0, height - 1), col.clip(0, width - 1)]
        sampled: NDArray[np.int8] = np.where(inside, values, np.int8(-1))
        return sampled


# If several kinds share a character of a terminal without colours, the largest number is shown.
UNKNOWN, FLOOR, TO_COVER, COVERED, REVISITED, WALL, AHEAD, NEXT, ROBOT = range(9)
HEADING = ROBOT + 1
"""The character of the robot's centre: this plus its heading in eighths of a turn."""
EIGHTHS = 8
LETTER = HEADING + EIGHTHS
"""A letter of a room's name: this plus its place in ``LETTERS``."""
LETTERS = bytes((*range(0x20, 0x7F), *range(0xA1, 0xAD), *range(0xAE, 0x100))).decode("latin1")

# Thresholds of occupancy: the defaults of the daemon's configuration.
FREE_AT_MOST, OCCUPIED_AT_LEAST = 25, 65
# Largest number of samples per pixel and axis: enough for thin walls, except on very large maps.
MOST_SAMPLES = 12
# Length of the next part of the path, which is highlighted [m].
NEXT_M = 3.0
# If lanes are closer than RESOLVED_PIXELS, only the first NEAR_M [m] of the path are drawn, so that
# the ground stays visible.
RESOLVED_PIXELS, NEAR_M = 2.0, 15.0

Kinds = NDArray[np.uint8]


def ground(frame: Frame, grid: OccupancyGrid | None, coverage: OccupancyGrid | None) -> Kinds:
    """Return the kinds of all pixels, uint8 (2 * lines, columns), without path and robot.

    A pixel that contains an occupied pixel of the map is wall; without a map, a blocked cell is.
    """
    cells: Kinds | None = None
    if coverage is not None:
        table = _COVERAGE_AND_BLOCKED_KINDS if grid is None else _COVERAGE_KINDS
        cells = table[frame.sampled(coverage).view(np.uint8)]
    if grid is None:
        return np.full(frame.shape, UNKNOWN, np.uint8) if cells is None else cells
    finer = math.ceil(frame.pixel_m / grid.geometry.resolution)
    samples = min(max(finer, 1), MOST_SAMPLES)
    sampled = _MAP_KINDS[frame.sampled(grid, samples).view(np.uint8)]
    rows, cols = frame.shape
    kinds: Kinds = sampled.reshape(rows, samples, cols, samples).max(axis=(1, 3))
    if cells is not None:
        tinted = (kinds == FLOOR) & (cells != UNKNOWN)
        kinds[tinted] = cells[tinted]
    return kinds


def draw_path(kinds: Kinds, frame: Frame, xy: NDArray[np.float64]) -> bool:
    """Draw the path ahead, float64 (n, 2) [m], into ``kinds``; its next part is highlighted.

    If its lanes would merge, only the first ``NEAR_M`` are drawn. Return whether all is drawn.
    """
    if len(xy) < 2:
        return True
    lengths = np.hypot(*np.diff(xy, axis=0).T)
    way = np.concatenate([[0.0], np.cumsum(lengths)])
    resolved = float(np.median(lengths)) >= RESOLVED_PIXELS * frame.pixel_m
    drawn_m = way[-1] if resolved else min(way[-1], NEAR_M)
    at = np.append(np.arange(0.0, drawn_m, frame.pixel_m / 2), drawn_m)
    points = np.stack([np.interp(at, way, xy[:, axis]) for axis in (0, 1)], axis=-1)
    # The part nearest to the robot is drawn last: it is visible where the path crosses itself.
    for kind, some in ((AHEAD, points[at > NEXT_M]), (NEXT, points[at <= NEXT_M])):
        _put(kinds, frame.pixels(some), kind)
    return bool(drawn_m == way[-1])


def draw_robot(kinds: Kinds, frame: Frame, pose: Pose2D, radius_m: float) -> None:
    """Draw the robot's disc, and its heading as the character at its centre."""
    rows, cols = frame.shape
    across = frame.left + (np.arange(cols) + 0.5) * frame.pixel_m - pose.x
    down = frame.top - (np.arange(rows) + 0.5) * frame.pixel_m - pose.y
    kinds[np.hypot(across[None, :], down[:, None]) <= radius_m] = ROBOT
    row, col = frame.pixels(np.array([[pose.x, pose.y]]))[0]
    upper = int(row) // 2 * 2
    eighth = round(pose.yaw / (math.pi / 4)) % EIGHTHS
    _put(kinds, np.array([[upper, col], [upper + 1, col]]), HEADING + eighth)


def draw_names(kinds: Kinds, frame: Frame, rooms: Rooms) -> None:
    """Write each room's name and swept share, or its name, or its number: the first that fits."""
    for room in rooms.outlined:
        place = label_place(room.outline)
        if place is None:
            continue
        share = "" if room.swept is None else f"{math.floor(100 * room.swept)} %"
        texts = (
            f" {text} " for text in (f"{room.title} {share}".rstrip(), room.title, str(room.id))
        )
        fits = (text for text in texts if len(text) * frame.pixel_m <= place.width_m)
        text = next((text for text in fits if set(text) <= set(LETTERS)), "")
        row, col = frame.pixels(np.array([[place.x, place.y]]))[0]
        upper, first = int(row) // 2 * 2, int(col) - len(text) // 2
        for index, letter in enumerate(text):
            both = np.array([[upper, first + index], [upper + 1, first + index]])
            _put(kinds, both, LETTER + LETTERS.index(letter))


def _put(kinds: Kinds, pixels: NDArray[np.int64], kind: int) -> None:
    rows, cols = kinds.shape
    row, col = pixels.T
    seen = (row >= 0) & (row < rows) & (col >= 0) & (col < cols)
    kinds[row[seen], col[seen]] = kind


# The kind of each value of a map, and of a coverage grid with and without a map below it.
_MAP_KINDS = np.full(256, UNKNOWN, np.uint8)
_MAP_KINDS[: FREE_AT_MOST + 1] = FLOOR
_MAP_KINDS[OCCUPIED_AT_LEAST : 100 + 1] = WALL
_COVERAGE_KINDS = np.full(256, UNKNOWN, np.uint8)
_COVERAGE_KINDS[CoverageValue.TO_COVER] = TO_COVER
_COVERAGE_KINDS[CoverageValue.COVERED] = COVERED
_COVERAGE_KINDS[CoverageValue.RECOVERED] = REVISITED
_COVERAGE_AND_BLOCKED_KINDS = _COVERAGE_KINDS.copy()
_COVERAGE_AND_BLOCKED_KINDS[CoverageValue.BLOCKED] = WALL


class MissionPicture:
    """Drawing of a robot's view; map and coverage are drawn again only if they have changed.

    Attributes:
        pixel_m: edge of a pixel of the last picture [m]; None before the first.
        path_is_whole: whether all of the path was drawn.
    """

    def __init__(self) -> None:
        self.pixel_m: float | None = None
        self.path_is_whole = True
        self._grids: tuple[OccupancyGrid | None, ...] = ()
        self._bounds: Bounds | None = None
        self._frame: Frame | None = None
        self._ground: Kinds | None = None
        self._named: tuple[Rooms, Frame] | None = None
        self._names = np.zeros((0, 0), np.uint8)

    def kinds(self, view: RobotView, columns: int, lines: int) -> Kinds | None:
        """Return a picture, uint8 (2 * lines, columns); None while there is nothing to show."""
        # Grids are immutable: a new grid is another object.
        grids = view.map, view.coverage
        if grids != self._grids:
            self._grids, self._frame = grids, None
            self._bounds = union_bounds(*(known_bounds(grid) for grid in grids if grid is not None))
        if self._bounds is None:
            return None  # without a map or coverage, nothing is drawn
        pose = view.pose
        robot = None if pose is None else (pose.x, pose.y, pose.x, pose.y)
        bounds = union_bounds(self._bounds, robot) or self._bounds
        frame = Frame.over(bounds, columns, lines)
        if frame != self._frame or self._ground is None:
            self._frame = frame
            self._ground = ground(frame, view.map, view.coverage)
        kinds = self._ground.copy()
        self.pixel_m = frame.pixel_m
        self.path_is_whole = draw_path(kinds, frame, view.path_ahead)
        if (view.rooms, frame) != self._named:
            self._named = view.rooms, frame
            self._names = np.zeros_like(kinds)
            draw_names(self._names, frame, view.rooms)
        kinds = np.where(self._names, self._names, kinds)
        if pose is not None:
            settings = known_settings(view.status.config if view.status else {})
            draw_robot(kinds, frame, pose, settings.robot.radius_m)
        return kinds
