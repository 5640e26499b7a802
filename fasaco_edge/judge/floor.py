"""Judge of swept floor: the area swept by a driven line, and the time it took.

Its inputs are a map and a line of points, no cells, walks or planners.

Reachable floor
    All pixels that the tool's disc touches at positions that the robot's disc can reach from the
    beginning of the line. The robot fits where its disc touches only known free pixels. A tool that
    sticks out of the robot's disc touches no floor behind a wall: it touches a pixel only if free
    pixels, roughly within the tool's disc, lead from the robot's disc to this pixel.
Swept floor
    The reachable floor that the tool's disc passed over along the line, by the same rules.
Illegal share
    The share of the line on which the robot's disc would touch pixels that are not known free.
Patch
    Pixels of reachable floor that were not swept, and are connected by their edges.

A map is judged on its own pixels, divided until they are ``FINE_M`` or finer. So walls are exact,
and a robot fits into a corridor that is one or two of the finer pixels wider than itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypedDict

import numpy as np

from fasaco_edge.grid.geometry import GridGeometry, Pose2D, Window
from fasaco_edge.grid.occupancy import FREE, OccupancyGrid, marked_window
from fasaco_edge.judge.driven_line import (
    TOUCH_TOLERANCE_PX,
    ArcBends,
    DriveLimits,
    Points,
    RasterLine,
    drive_seconds,
)
from fasaco_edge.judge.pixels import Mask, Patches, through, within
from fasaco_edge.text import percent

# Largest edge of a pixel [m], except on maps that would then exceed MOST_PIXELS.
FINE_M = 0.025
MOST_PIXELS = 24_000_000
SQRT2 = math.sqrt(2.0)
# Least area of a patch that counts [m2]: 4 dm2.
PATCH_M2 = 0.04
# Depth to which the robot's disc may overlap blocked pixels, to allow for the raster [pixels].
TOUCH_SLACK_PX = 1.5
# Length of the pieces of a line that are checked for walls [pixels], and number checked at a time.
STEP_PX = 0.7
PIECES = 4096


@dataclass(frozen=True, slots=True)
class SweepingRobot:
    """The robot that drives along a line.

    Attributes:
        tool_m: diameter of its tool, a disc [m].
        radius_m: radius of its own disc [m].
        speed_m_s: driving speed [m/s].
        turn_s: time of a quarter-turn [s], if ``limits`` are not known.
        free_at_most: occupancy values up to this are known free [percent].
        limits: its other limits; None to count turns by their angle alone.
        turn_radius_m: radius of its tightest arc [m]; 0 if it turns on the spot. Without
            ``limits``, a change between forward and backward takes ``turn_s``, too.
    """

    tool_m: float
    radius_m: float
    speed_m_s: float = 0.25
    turn_s: float = 1.5
    free_at_most: int = 25
    limits: DriveLimits | None = None
    turn_radius_m: float = 0.0


@dataclass(frozen=True, slots=True)
class FloorFigures:
    """Quality of a line on a floor.

    Attributes:
        reachable_m2: reachable floor [m2].
        swept_m2: reachable floor that was swept [m2].
        swept_share: swept area as a share of the reachable; None if no floor is reachable.
        illegal_share: share of the line on which the robot touches floor not known to be free.
        length_m: length of the line [m].
        quarter_turns: angle turned on the line, in quarter-turns.
        seconds: time of driving and turning [s].
        least_s: lower bound on ``seconds`` for any line that sweeps as much [s]: a tool of width w
            sweeps at most w l + pi w^2 / 4 along a line of length l, and turns are not counted. It
            may be wrong by a pixel along the border, as the swept area may.
        seconds_per_m2: driving time per square metre swept [s/m2]; None if nothing was swept.
        patches_over_4_dm2: patches left that are larger than ``PATCH_M2``.
        largest_patch_m2: the largest patch left [m2].
        pixel_m: edge of the pixels that it was judged on [m].
        reversals: number of changes between forward and backward of a robot with a turning radius.
        spot_turns: number of bends that are too sharp for that radius.
    """

    reachable_m2: float
    swept_m2: float
    swept_share: float | None
    illegal_share: float
    length_m: float
    quarter_turns: float
    seconds: float
    least_s: float
    seconds_per_m2: float | None
    patches_over_4_dm2: int
    largest_patch_m2: float
    pixel_m: float
    reversals: int = 0
    spot_turns: int = 0

    @property
    def gap(self) -> float | None:
        """Relative excess of ``seconds`` over the lower bound; None if the bound is 0."""
        return max(self.seconds / self.least_s - 1.0, 0.0) if self.least_s else None


def swept_words(swept_m2: float, reachable_m2: float) -> str:
    """Return swept and reachable floor [m2] in words; 100 % only if all is swept."""
    areas = f"{swept_m2:,.1f} of {reachable_m2:,.1f} m2"
    return f"{areas} ({percent(swept_m2 / reachable_m2)})" if reachable_m2 else areas


@dataclass(frozen=True, slots=True, eq=False)
class JudgedFloor:
    """A floor and its parts swept by a line.

    Attributes:
        figures: quality of the line.
        geometry: the raster that it was judged on.
        reachable, swept: pixels of that raster, bool (rows, cols); swept floor is reachable.
    """

    figures: FloorFigures
    geometry: GridGeometry
    reachable: Mask
    swept: Mask

    @property
    def unswept(self) -> Mask:
        """Reachable unswept pixels, bool (rows, cols)."""
        return self.reachable & ~self.swept

    def only(self, asked: Mask) -> JudgedFloor:
        """Return the floor within ``asked``, bool (rows, cols); figures of the drive stay."""
        reachable, swept = self.reachable & asked, self.swept & asked
        areas = _areas(reachable, swept, self.geometry.resolution)
        return JudgedFloor(replace(self.figures, **areas), self.geometry, reachable, swept)


def judge_floor(
    grid: OccupancyGrid,
    line_xy: Points,
    robot: SweepingRobot,
    *,
    driven: Mask | None = None,
    stands_at: tuple[float, float] | None = None,
) -> JudgedFloor:
    """Judge a line driven on a map.

    Args:
        grid: the map; it may be rotated in its frame.
        line_xy: points (x, y) [m] in the map frame, joined by straight segments, float64 (n, 2),
            n >= 1.
        robot: the robot.
        driven: which segments it drove, bool (n - 1,); on the others, as where a pose jumped, it
            swept nothing. None for all.
        stands_at: a point (x, y) [m] from which all reachable floor is found; None for the
            beginning of the line.

    Raises:
        ValueError: the line has no points, or points that are not finite, or ``driven`` has another
            length.
    """
    if line_xy.ndim != 2 or line_xy.shape[1] != 2 or not len(line_xy):
        raise ValueError(f"a line must be points (n, 2), n >= 1, got {line_xy.shape}")
    if not np.isfinite(line_xy).all():
        raise ValueError("a line must be of finite points")
    if driven is not None and driven.shape != (len(line_xy) - 1,):
        raise ValueError(
            f"driven must have a member for each of {len(line_xy) - 1} segments, got {driven.shape}"
        )
    floor = _Floor.of(grid, robot)
    line = RasterLine.of(line_xy, floor.geometry, driven)
    reachable = floor.reachable_from(stands_at or tuple(line_xy[0].tolist()))
    swept = floor.under_tool(lambda radius_px: line.swept(radius_px, floor.free.shape))
    swept &= reachable
    return JudgedFloor(_figures(floor, line, reachable, swept), floor.geometry, reachable, swept)


@dataclass(frozen=True, slots=True, eq=False)
class _Floor:
    """Known free floor of a map, on fine pixels, with a margin of blocked pixels around it."""

    geometry: GridGeometry
    free: Mask
    robot: SweepingRobot

    @classmethod
    def of(cls, grid: OccupancyGrid, robot: SweepingRobot) -> _Floor:
        def is_free(rows: slice) -> Mask:
            cells = grid.cells[rows]
            free: Mask = (cells >= FREE) & (cells <= robot.free_at_most)
            return free

        coarse, cells = grid.geometry, grid.cells
        window = marked_window(cells.shape, is_free) or Window(0, 0, 1, 1)
        parts = max(math.ceil(coarse.resolution / FINE_M - TOUCH_TOLERANCE_PX), 1)
        most = math.isqrt(MOST_PIXELS // (window.rows * window.cols))
        parts = max(min(parts, most), 1)
        pixel_m = coarse.resolution / parts
        margin = math.ceil(max(robot.radius_m, robot.tool_m / 2) / pixel_m) + 2
        known = is_free(slice(window.row0, window.row1))[:, window.col0 : window.col1]
        free = np.pad(known.repeat(parts, axis=0).repeat(parts, axis=1), margin)
        x, y = coarse.to_map(window.col0 - margin / parts, window.row0 - margin / parts)
        origin = Pose2D(x, y, coarse.origin.yaw)
        rows, cols = free.shape
        return cls(GridGeometry(rows, cols, pixel_m, origin), free, robot)

    @property
    def radius_px(self) -> float:
        return self.robot.radius_m / self.geometry.resolution

    def reachable_from(self, point: tuple[float, float]) -> Mask:
        """Return the pixels that the tool touches from places reachable from a point (x, y) [m]."""
        # A blocked pixel reaches half a pixel beyond its centre.
        fits = ~within(~self.free, self.radius_px + 0.5 - TOUCH_TOLERANCE_PX)
        stands = Patches.of(fits).nearest_to(*self.geometry.to_pixels(*point))
        return self.under_tool(lambda radius_px: within(stands, radius_px + TOUCH_TOLERANCE_PX))

    def under_tool(self, near: Callable[[float], Mask]) -> Mask:
        """Return the floor that the tool touches, without floor behind walls.

        Args:
            near: returns the pixels within a radius [pixels] of the robot's positions.
        """
        tool_px = self.robot.tool_m / self.geometry.resolution / 2
        under, beyond_px = near(tool_px), tool_px - self.radius_px
        if beyond_px <= 0:
            return under
        # Pixels are connected by their edges: a diagonal distance takes more steps.
        return under & through(self.free, near(self.radius_px), math.ceil(SQRT2 * beyond_px))

    def illegal_share(self, line: RasterLine) -> float:
        touched = within(~self.free, self.radius_px - TOUCH_SLACK_PX - TOUCH_TOLERANCE_PX)
        # Even a robot smaller than a pixel may not stand outside free floor.
        touched |= ~self.free
        rows, cols = self.free.shape
        illegal = length = 0.0
        is_line = bool((line.starts != line.ends).any())
        for start, end in line.pieces(STEP_PX, PIECES):
            col, row = np.floor((start + end) / 2).T
            inside = (row >= 0) & (row < rows) & (col >= 0) & (col < cols)
            touches = np.ones(len(row), np.bool_)
            touches[inside] = touched[row[inside].astype(int), col[inside].astype(int)]
            # A line of one point is judged at that point.
            weight = np.hypot(*(end - start).T) if is_line else np.ones(len(row))
            illegal += float(weight[touches].sum())
            length += float(weight.sum())
        return illegal / length


def _figures(floor: _Floor, line: RasterLine, reachable: Mask, swept: Mask) -> FloorFigures:
    pixel_m, robot = floor.geometry.resolution, floor.robot
    areas = _areas(reachable, swept, pixel_m)
    swept_m2 = areas["swept_m2"]
    ways_px, bends_deg = line.ways_and_bends
    length_m, quarters = float(ways_px.sum()) * pixel_m, float(bends_deg.sum()) / 90.0
    arcs = None
    if robot.turn_radius_m:
        arcs = ArcBends.of(ways_px * pixel_m, bends_deg, robot.turn_radius_m)
    stops = 0 if arcs is None else int(np.count_nonzero(arcs.reverses))
    turned = quarters if arcs is None else float(bends_deg[arcs.spots].sum()) / 90.0 + stops
    seconds = length_m / robot.speed_m_s + turned * robot.turn_s
    if robot.limits is not None:
        seconds = drive_seconds(ways_px * pixel_m, bends_deg, robot.speed_m_s, robot.limits, arcs)
    least_m = max(swept_m2 / robot.tool_m - math.pi * robot.tool_m / 4, 0.0)
    return FloorFigures(
        **areas,
        illegal_share=floor.illegal_share(line),
        length_m=length_m,
        quarter_turns=quarters,
        seconds=seconds,
        least_s=least_m / robot.speed_m_s,
        seconds_per_m2=seconds / swept_m2 if swept_m2 else None,
        pixel_m=pixel_m,
        reversals=stops,
        spot_turns=0 if arcs is None else int(np.count_nonzero(arcs.spots)),
    )


class _Areas(TypedDict):
    reachable_m2: float
    swept_m2: float
    swept_share: float | None
    patches_over_4_dm2: int
    largest_patch_m2: float


def _areas(reachable: Mask, swept: Mask, pixel_m: float) -> _Areas:
    reachable_m2, swept_m2 = (
        int(np.count_nonzero(mask)) * pixel_m * pixel_m for mask in (reachable, swept)
    )
    left_m2 = Patches.of(reachable & ~swept).pixels * pixel_m * pixel_m
    return _Areas(
        reachable_m2=reachable_m2,
        swept_m2=swept_m2,
        swept_share=swept_m2 / reachable_m2 if reachable_m2 else None,
        patches_over_4_dm2=int(np.count_nonzero(left_m2 > PATCH_M2)),
        largest_patch_m2=float(left_m2.max(initial=0.0)),
    )
