"""Pictures of a walk over the lattice, and of a mission: visited cells and the driven path."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fasaco_edge.drawing import palette
from fasaco_edge.drawing.plot import MapLayer, Plot, PlotView, bounds_of
from fasaco_edge.drawing.sheet import KeyEntry, Sheet
from fasaco_edge.drawing.tints import ENDS, draw_visits, number_rooms, paint_rooms, visits_of
from fasaco_edge.grid.geometry import Polygon
from fasaco_edge.grid.label_place import label_place
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.grid.rooms import FoundRooms

UNSWEPT = palette.UNSWEPT, "reachable floor not swept"
BY_OTHERS = palette.BY_OTHERS, "swept by other robots of its fleet"
"""Colour and label of floor."""


def draw_floor(
    plot: Plot, floor: MapLayer | None, colour: palette.Colour, label: str
) -> list[KeyEntry]:
    """Paint floor; return its legend entry, none without any floor."""
    if floor is None or not floor.mask.any():
        return []
    plot.paint(floor, colour)
    return [KeyEntry("tile", colour, f"{label} ({floor.area_m2:,.1f} m2)")]


def draw_order(plot: Plot, zones: Sequence[Polygon], keep_out: Sequence[Polygon]) -> list[KeyEntry]:
    """Outline the zones and keep-out zones of an order; return their legend entries."""
    key = []
    for polygons, colour, label in (
        (zones, palette.BLUE, "zone to cover"),
        (keep_out, palette.VERMILION, "keep-out zone"),
    ):
        for polygon in polygons:
            plot.outline(polygon, colour)
        key += [KeyEntry("tile", colour, label)] if polygons else []
    return key


Points = NDArray[np.float64]

# Cosine of the angle up to which a walk goes straight on.
STRAIGHT = 0.999


def directions(points: Points) -> Points:
    """Return unit vectors (n - 1, 2) along points (n, 2), no two in succession equal."""
    steps = np.diff(points, axis=0)
    unit: Points = steps / np.hypot(steps[:, 0], steps[:, 1])[:, None]
    return unit


def lanes(points: Points, offset: float) -> tuple[Points, Points]:
    """Return start and end of every segment, both (m, 2), of a line parallel to ``points``.

    Args:
        points: a walk or any other line (n, 2), no two points in succession equal.
        offset: distance of the parallel line to the right [same unit].
    """
    along = directions(points)
    right = np.stack([along[:, 1], -along[:, 0]], axis=1)
    cosine = (along[:-1] * along[1:]).sum(axis=1)
    corner, back = np.abs(cosine) < STRAIGHT, cosine <= -0.5
    at_start, at_end = right.copy(), right.copy()
    # Where the walk turns, the two lanes meet beside the corner.
    corner &= ~back
    beside = (right[:-1] + right[1:])[corner] / (1 + cosine[corner])[:, None]
    at_end[:-1][corner] = at_start[1:][corner] = beside
    # Where it turns back, the lanes are joined a little beyond the centre.
    at_end[:-1][back] += along[:-1][back]
    at_start[1:][back] += along[:-1][back]
    starts, ends = points[:-1] + offset * at_start, points[1:] + offset * at_end
    corners = np.stack([starts, ends], axis=1).reshape(-1, 2)
    moved = (np.abs(np.diff(corners, axis=0)) > 1e-9).any(axis=1)
    return corners[:-1][moved], corners[1:][moved]


def arrow_places(points: Points, every: float) -> NDArray[np.intp]:
    """Return the indices of segments with an arrow: straight ones, about ``every`` apart."""
    along = directions(points)
    travelled = np.cumsum(np.hypot(*np.diff(points, axis=0).T))
    goes_on = (along[1:] * along[:-1]).sum(axis=1) > 0.99
    straight = np.zeros(len(along), np.bool_)
    straight[1:] |= goes_on
    straight[:-1] |= goes_on
    candidates = np.flatnonzero(straight)
    if not len(candidates):
        return candidates
    wanted = np.arange(every / 2, travelled[-1], every)
    nearest = np.searchsorted(travelled[candidates], wanted)
    return np.unique(candidates[nearest[nearest < len(candidates)]])


# Offset of a lane from the cells' centres, width of its line, size of an arrow [cells].
LANE_OFFSET = 0.11
LINE_WIDTH = 0.13
ARROW_SIZE = 0.34

SMALLEST_ARROW_PX = 7
ARROW_EVERY_PX = 170
MOST_ARROWS = 400


def draw_walk(
    lattice: CoverageLattice,
    cells: NDArray[np.int32],
    *,
    grid: OccupancyGrid | None,
    title: str,
    lines: Sequence[str],
    line_xy: Points | None = None,
    is_backward: NDArray[np.bool_] | None = None,
    swept: MapLayer | None = None,
    unswept: MapLayer | None = None,
    rooms: FoundRooms | None = None,
) -> Image.Image:
    """Return a picture, RGB, of a walk over the lattice, with the map below it.

    Args:
        lattice: the planning grid.
        cells: the walk's cells (row, col) from the start, in the lattice's window, int32 (n, 2),
            n >= 1.
        grid: the map that the lattice was made from; None draws the lattice's own states.
        title: heading.
        lines: caption below it.
        line_xy: points (x, y) [m] of the line driven instead, float64 (n, 2), n >= 1; None for the
            centres of the cells.
        is_backward: which of its segments are driven backward, bool (n - 1,), if it is a curve.
        swept: floor that it sweeps, drawn instead of the visited cells; None for the cells.
        unswept: reachable floor that it leaves; None if not known.
        rooms: rooms, drawn instead of cells and swept floor; None without rooms.
    """
    centres = lattice.centres(cells)
    driven = centres if line_xy is None else line_xy
    plot = Plot(PlotView.over(bounds_of(grid, lattice, driven), lattice.cell_m))
    plot.ground(lattice if grid is None else grid)
    if rooms is not None:
        paint_rooms(plot, rooms)
    left = draw_floor(plot, unswept, *UNSWEPT)
    if rooms is not None:
        key = [*ENDS]
    elif swept is not None:
        key = [*ENDS, *draw_floor(plot, swept, palette.COVERED, "floor swept")]
    else:
        key = draw_visits(plot, lattice, visits_of(lattice, cells), tuple(cells[0].tolist()))
    key += draw_driven(plot, driven, is_backward, lattice.cell_m) + left
    if rooms is not None:
        number_rooms(plot, rooms)
    bar = ("0", f"{len(cells) - 1:,} steps")
    return Sheet(title, lines, key, bar, plot.view.scale).around(plot.finished())


def draw_driven(
    plot: Plot, line: Points, is_backward: NDArray[np.bool_] | None, cell_m: float
) -> list[KeyEntry]:
    """Draw a line, or a curve, with its ends; return its legend entries."""
    key: list[KeyEntry] = []
    if is_backward is None:
        draw_line(plot, in_pieces(line, cell_m), cell_m)
    else:
        key += draw_curve(plot, line, is_backward, cell_m)
    if (line[0] != line[-1]).any():
        plot.end_mark(line[-1])
    plot.start_mark(line[0])
    return key


def in_pieces(line: Points, longest: float) -> Points:
    """Return a line (n, 2), n >= 1, with points added so that no piece is longer than ``longest``.

    A tolerance keeps pieces whole that rounding made slightly longer.
    """
    ways = np.diff(line, axis=0)
    counts = np.maximum(np.ceil(np.hypot(*ways.T) / longest - 1e-3), 1).astype(np.int64)
    segment = np.repeat(np.arange(len(ways)), counts)
    number = np.arange(1, len(segment) + 1) - (np.cumsum(counts) - counts)[segment]
    share = (number / counts[segment])[:, None]
    return np.vstack([line[:1], line[:-1][segment] + share * ways[segment]])


def draw_line(plot: Plot, line: Points, cell_m: float) -> None:
    """Draw a line, points (n, 2) with n >= 2 [m], a little to its right, and arrows along it."""
    moves = np.ones(len(line), np.bool_)
    moves[1:] = (np.diff(line, axis=0) != 0).any(axis=1)
    points = line[moves]
    offset = LANE_OFFSET * cell_m
    plot.track(*lanes(points, offset), LINE_WIDTH * cell_m)
    _draw_arrows(plot, points, offset, cell_m)


def draw_curve(
    plot: Plot, curve: Points, is_backward: NDArray[np.bool_], cell_m: float
) -> list[KeyEntry]:
    """Draw a curve, points (n, 2) [m], and arrows along it; return its legend entries.

    ``is_backward``: which segments are driven backward, bool (n - 1,).
    """
    plot.track(curve[:-1], curve[1:], LINE_WIDTH * cell_m)
    changes = np.flatnonzero(np.diff(is_backward, prepend=False, append=False)).tolist()
    for first, last in zip(changes[::2], changes[1::2], strict=True):
        plot.line(curve[first : last + 1], palette.GREEN, LINE_WIDTH * cell_m * plot.view.scale)
    if len(curve) > 1:
        _draw_arrows(plot, in_pieces(curve, cell_m), 0.0, cell_m)
    return [KeyEntry("tile", palette.GREEN, "driven backward")] if changes else []


def _draw_arrows(plot: Plot, points: Points, offset: float, cell_m: float) -> None:
    along = directions(points)
    right = np.stack([along[:, 1], -along[:, 0]], axis=1)
    middles = (points[:-1] + points[1:]) / 2 + right * offset
    size = max(ARROW_SIZE * cell_m, SMALLEST_ARROW_PX / plot.view.scale)
    every = max(ARROW_EVERY_PX / plot.view.scale, len(along) * cell_m / MOST_ARROWS)
    for place in arrow_places(points, every).tolist():
        plot.arrow(middles[place], along[place], size)


# Width of a driven track [cells].
DRIVEN_WIDTH = 0.12
# Width of the border of a room.
ROOM_PX = 1.2


def draw_mission(
    grid: OccupancyGrid,
    lattice: CoverageLattice,
    driven_xy: NDArray[np.float64],
    visits: NDArray[np.uint16] | None = None,
    *,
    title: str,
    lines: Sequence[str],
    driven: NDArray[np.bool_] | None = None,
    swept: MapLayer | None = None,
    unswept: MapLayer | None = None,
    by_others: MapLayer | None = None,
    zones: Sequence[Polygon] = (),
    keep_out: Sequence[Polygon] = (),
    rooms: Sequence[tuple[str, Polygon]] = (),
) -> Image.Image:
    """Return a picture, RGB, of a mission's result.

    Args:
        grid: the map at the mission's end.
        lattice: the planning grid at the mission's end.
        driven_xy: the robot's positions (x, y) [m], in order, float64 (n, 2), n >= 1.
        visits: number of visits of each cell, uint16, shape of the lattice; None with ``swept``.
        title: heading.
        lines: caption below it.
        driven: which positions are joined with the next one, bool (n - 1,); None for all.
        swept: reachable floor that was swept, drawn instead of visited cells; None for the cells.
        unswept: reachable floor that was not swept; None if not known.
        by_others: floor that other robots swept; None without other robots.
        zones, keep_out: polygons of the order [m].
        rooms: names and outlines [m].
    """
    plot = Plot(PlotView.over(bounds_of(grid, lattice, driven_xy), lattice.cell_m))
    plot.ground(grid)
    start = lattice.cell_at(*driven_xy[0].tolist())
    if swept is None:
        assert visits is not None
        key = draw_visits(plot, lattice, visits, start)
    else:
        key = [*ENDS, *draw_floor(plot, swept, palette.COVERED, "reachable floor swept")]
    key += draw_floor(plot, unswept, *UNSWEPT) + draw_floor(plot, by_others, *BY_OTHERS)
    for _, outline in rooms:
        plot.line(np.array((*outline, outline[0])), palette.FAINT_INK, ROOM_PX)
    key += draw_order(plot, zones, keep_out)
    lengths_m = np.hypot(*np.diff(driven_xy, axis=0).T)
    driven = np.ones(len(lengths_m), np.bool_) if driven is None else driven
    plot.track(driven_xy[:-1][driven], driven_xy[1:][driven], DRIVEN_WIDTH * lattice.cell_m)
    plot.end_mark(driven_xy[-1])
    plot.start_mark(driven_xy[0])
    for name, outline in rooms:
        if (place := label_place(outline)) is not None:
            plot.text(name, place[:2])
    bar = ("0", f"{lengths_m[driven].sum():,.0f} m driven")
    return Sheet(title, lines, key, bar, plot.view.scale).around(plot.finished())
