"""Pictures of a review: the map with the track, a moment, spots."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fasaco_edge.drawing import palette
from fasaco_edge.drawing.pictures import (
    BY_OTHERS,
    UNSWEPT,
    draw_floor,
    draw_mission,
    draw_order,
)
from fasaco_edge.drawing.plot import MapLayer, Plot, PlotView, bounds_of
from fasaco_edge.drawing.sheet import KeyEntry, Sheet
from fasaco_edge.judge.floor import swept_words
from fasaco_edge.recording.read.robot_clock import clock
from fasaco_edge.review.floor_and_rooms import outlined
from fasaco_edge.review.instant import DRIVE_S, InstantPicture
from fasaco_edge.review.moments import refused_by_code
from fasaco_edge.review.orders import ordered_words
from fasaco_edge.review.output.answers import instant_rows, spot_rows
from fasaco_edge.review.review import Review
from fasaco_edge.review.run_data import RunData
from fasaco_edge.review.spot import Spot
from fasaco_edge.text import one_line
from fasaco_edge.wire.documents.settings import known_settings

TRACK_SPACING_M = 0.02
# Width of a driven track drawn together with lines of paths [m].
DRIVE_M = 0.04
DONE = {True: "complete", False: "not complete", None: "recorded in part"}


def draw_review(reviews: Sequence[Review]) -> Image.Image | None:
    """Return the maps of reviews side by side, RGB; None if there is none."""
    maps = [found for found in map(draw_map, reviews) if found is not None]
    if not maps:
        return None
    size = sum(one.width for one in maps), max(one.height for one in maps)
    sheet, left = Image.new("RGB", size, palette.PAPER), 0
    for one in maps:
        sheet.paste(one, (left, 0))
        left += one.width
    return sheet


def draw_map(review: Review) -> Image.Image | None:
    """Return the last map with cells, unswept floor and track; None without a map or poses."""
    grid, lattice, visits, floor = review.data.grid, review.lattice, review.visits, review.floor
    track, driven = _thinned(review.data)
    if grid is None or lattice is None or visits is None or not len(track):
        return None
    others = None
    if review.by_others is not None and floor is not None:
        others = MapLayer(floor.geometry, review.by_others)
    # A smoothed line covers floor without passing the centres of cells, which visits count.
    is_line = known_settings(review.data.config).planner.line != "cells"
    return draw_mission(
        grid,
        lattice,
        track,
        visits,
        title=f"{review.record.name}: {DONE[review.complete]}",
        lines=_caption(review),
        driven=driven,
        swept=MapLayer(floor.geometry, floor.swept) if floor and (is_line or others) else None,
        unswept=MapLayer(floor.geometry, floor.unswept) if floor else None,
        by_others=others,
        zones=review.data.zones,
        keep_out=review.data.keep_out,
        rooms=[(one_line(room.title), room.outline) for room in outlined(review.data)],
    )


HEADING_M = 0.3
# Distance of the number of a spot from its mark [m].
NUMBER_M = 0.2


def draw_instant(review: Review, shown: InstantPicture) -> Image.Image | None:
    """Return the map at one moment with paths, driven track and robot; None without a map."""
    grid, lattice, instant, data = shown.grid, review.lattice, shown.instant, review.data
    if grid is None or lattice is None:
        return None
    near = np.flatnonzero(np.abs(data.times - instant.at_s) <= DRIVE_S)
    drive, driven = _thinned(data, slice(near[0], near[-1] + 1) if len(near) else slice(0))
    plot = Plot(PlotView.over(bounds_of(grid, lattice, drive), lattice.cell_m))
    plot.ground(grid)
    key = draw_order(plot, data.zones, data.keep_out)
    for line, colour, width, label in (
        (shown.before, palette.RULE, 4.0, "path before"),
        (shown.line, palette.PURPLE, 3.0, "path in force"),
        (shown.after, palette.SKY, 1.5, "path after"),
    ):
        if line is not None and len(line.xy):
            plot.line(line.xy, colour, width)
            key.append(KeyEntry("tile", colour, f"{label} ({line.revision})"))
    if driven.any():
        plot.track(drive[:-1][driven], drive[1:][driven], DRIVE_M)
    if (changed := instant.map) is not None and (box := changed.around) is not None:
        corners = [(box.x_min, box.y_min), (box.x_max, box.y_min)]
        corners += [(box.x_max, box.y_max), (box.x_min, box.y_max)]
        plot.outline(corners, palette.ORANGE)
        key.append(KeyEntry("tile", palette.ORANGE, "map changed lately"))
    if instant.x is not None and instant.y is not None and instant.yaw_deg is not None:
        yaw = math.radians(instant.yaw_deg)
        place, along = np.array([instant.x, instant.y]), np.array([math.cos(yaw), math.sin(yaw)])
        plot.start_mark(place)
        plot.line(np.array([place, place + HEADING_M * along]), palette.INK, 4.0)
    lines = [*_simulated(review), *(f"{name}: {text}" for name, text in instant_rows(instant))]
    bar = (f"{DRIVE_S:.0f} s before", f"{DRIVE_S:.0f} s after")
    title = f"{review.record.name} at {clock(instant.at_s)}"
    return Sheet(title, lines, key, bar, plot.view.scale).around(plot.finished())


def draw_spots(review: Review, spots: Sequence[Spot]) -> Image.Image | None:
    """Return the map at the end with marks at ``spots``; None without a map or spots."""
    lattice, data = review.lattice, review.data
    if data.grid is None or lattice is None or not spots:
        return None
    drive, driven = _thinned(data)
    plot = Plot(PlotView.over(bounds_of(data.grid, lattice, drive), lattice.cell_m))
    plot.ground(data.grid)
    key = []
    if review.floor is not None:
        geometry, others = review.floor.geometry, review.by_others
        key += draw_floor(plot, MapLayer(geometry, review.floor.unswept), *UNSWEPT)
        if others is not None:
            key += draw_floor(plot, MapLayer(geometry, others), *BY_OTHERS)
    key += draw_order(plot, data.zones, data.keep_out)
    if driven.any():
        plot.track(drive[:-1][driven], drive[1:][driven], DRIVE_M)
    gaps = [drive[at : at + 2] for at in np.flatnonzero(~driven).tolist()]
    for gap in gaps:
        plot.line(gap, palette.ORANGE, 1.5)
    if gaps:
        key.append(KeyEntry("tile", palette.ORANGE, "no pose in between: does not count"))
    for number, spot in enumerate(spots, 1):
        plot.end_mark(np.array([spot.x, spot.y]))
        if len(spots) > 1:
            plot.text(str(number), (spot.x + NUMBER_M, spot.y))
    key.append(KeyEntry("square", palette.END, "asked for"))
    lines = [*_simulated(review), *spot_lines(spots)]
    title = f"{review.record.name}: {'one spot' if len(spots) == 1 else f'{len(spots)} spots'}"
    bar = ("0:00", clock(review.duration_s))
    return Sheet(title, lines, key, bar, plot.view.scale).around(plot.finished())


def spot_lines(spots: Sequence[Spot]) -> list[str]:
    """Return the lines of a caption about spots; several have the numbers of their marks."""
    return [
        f"{f'{number} ' * (len(spots) > 1)}{name}: {text}"
        for number, spot in enumerate(spots, 1)
        for name, text in spot_rows(spot)
    ]


def _simulated(review: Review) -> list[str]:
    words = review.record.clock.words
    return [f"{words}: times are the robot's"] if words else []


def _caption(review: Review) -> list[str]:
    cells, replans = review.cells, review.replans
    lines = _simulated(review)
    if cells is not None:
        lines.append(
            f"{cells[0]:,} of {cells[1]:,} reachable cells covered; "
            f"recorded for {clock(review.duration_s)}"
        )
    if before := review.data.restored_cells:
        lines.append(f"{before:,} cells were covered before: the recording does not show which")
    if review.floor is not None:
        figures = review.floor.figures
        swept = swept_words(figures.swept_m2, figures.reachable_m2)
        lines.append(f"floor swept{ordered_words(review.orders)}: {swept}, by recorded poses")
    median, slowest = replans.milliseconds(50), replans.milliseconds(100)
    if median is not None and slowest is not None:
        refused = sum(refused_by_code(review.data).values())
        lines.append(
            f"{len(replans.later):,} replans, {median:.1f} ms in the median, "
            f"{slowest:.0f} ms at worst; {refused:,} messages refused"
        )
    return lines


def _thinned(
    data: RunData, part: slice = slice(None)
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return a track of spaced points, float64 (n, 2), and its driven segments, bool (n - 1,)."""
    track = data.track[part, :2]
    gaps = np.concatenate(([0], np.cumsum(~data.driven)))[: len(data.poses)][part]
    if len(track) > 2:
        ways = np.hypot(*np.diff(track, axis=0).T)
        way = np.concatenate(([0.0], np.cumsum(ways)))
        kept = np.diff(np.floor(way / TRACK_SPACING_M), prepend=-1.0) > 0
        kept[-1] = True
        # Keep the point before each gap, too.
        kept[:-1] |= np.diff(gaps) > 0
        track, gaps = track[kept], gaps[kept]
    return track, np.diff(gaps) == 0
