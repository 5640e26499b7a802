"""Pictures of a fleet: tracks, floor swept by robot, and floor swept again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fasaco_edge.client.phrases import scale_words
from fasaco_edge.drawing import palette
from fasaco_edge.drawing.pictures import UNSWEPT, draw_floor
from fasaco_edge.drawing.plot import MapLayer, Plot, PlotView, bounds_of
from fasaco_edge.drawing.sheet import KeyEntry, Sheet
from fasaco_edge.errors import UnreadableRecording
from fasaco_edge.fleet.observer.cells import Cells, mask_of, together, window_of
from fasaco_edge.fleet.recording.notes import numbers_of
from fasaco_edge.fleet.review.report import FleetReview
from fasaco_edge.grid.geometry import Window
from fasaco_edge.grid.lattice import CoverageLattice
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.recording.read.robot_clock import clock
from fasaco_edge.text import percent

# Opacity of the colour of a robot's cells.
TINT = 0.35
# Width of a track.
TRACK_PX = 1.6


def draw_fleet_mission(
    grid: OccupancyGrid,
    lattice: CoverageLattice,
    tracks: Mapping[str, NDArray[np.float64]],
    swept: Sequence[MapLayer],
    unswept: MapLayer,
    recording: Sequence[Path],
    *,
    title: str,
    lines: Sequence[str],
) -> Image.Image:
    """Return a picture, RGB, of the tracks and the swept floor of several robots.

    Args:
        grid: the map at the end.
        lattice: the planning grid at the end.
        tracks: driven positions (x, y) of each robot [m], by name, float64 (n, 2), n >= 1.
        swept: reachable floor that each robot swept, in the order of ``tracks``, all on one raster.
        unswept: reachable floor that no robot swept.
        recording: files of the fleet's recording, for the robots' colours.
        title: heading.
        lines: caption below it.
    """
    plot = Plot(
        PlotView.over(bounds_of(grid, lattice, np.vstack(list(tracks.values()))), lattice.cell_m)
    )
    plot.ground(grid)
    key = [KeyEntry("disc", palette.START, "start"), KeyEntry("square", palette.END, "end")]
    times = np.zeros(unswept.mask.shape, np.int8)
    numbers = {name: number for number, name in enumerate(tracks)}
    with suppress(UnreadableRecording):
        numbers |= numbers_of(recording)
    for name, layer in zip(tracks, swept, strict=True):
        number = numbers[name]
        plot.paint(layer, robot_tint(number))
        times += layer.mask
        key.append(
            KeyEntry("tile", robot_tint(number), f"swept by {name} ({layer.area_m2:,.1f} m2)")
        )
    twice = MapLayer(unswept.geometry, times > 1)
    plot.paint(twice, palette.RULE)
    key.append(KeyEntry("tile", palette.RULE, f"by two or more ({twice.area_m2:,.1f} m2)"))
    key += draw_floor(plot, unswept, *UNSWEPT)
    for name, track in tracks.items():
        plot.line(track, _track_colour(numbers[name]), TRACK_PX)
        plot.end_mark(track[-1])
        plot.start_mark(track[0])
    return Sheet(title, lines, key, None, plot.view.scale).around(plot.finished())


def robot_tint(number: int) -> palette.Colour:
    """Return the colour of the floor that the robot with a number sweeps."""
    return palette.tint(_track_colour(number), TINT)


def _track_colour(number: int) -> palette.Colour:
    return palette.robot(number)[1]


# A cell counts as swept again if more than this share of a robot's steps there sweeps again.
MOSTLY = 0.5


def draw_fleet_review(review: FleetReview) -> Image.Image:
    """Return the picture of a review, RGB."""
    figures, seat = review.figures, review.seat
    swept = [np.array([*track.swept_ms], np.int64).reshape(-1, 2) for track in review.tracks]
    window = window_of(together([review.ground, *swept])) or Window(0, 0, 1, 1)
    geometry = seat.geometry(window)

    def layer(cells: Cells) -> MapLayer:
        return MapLayer(geometry, mask_of(cells, window))

    plot = Plot(PlotView.over(geometry.bounds(), seat.cell_m))
    plot.paint(layer(review.ground), palette.FREE)
    key = [KeyEntry("disc", palette.START, "start"), KeyEntry("square", palette.END, "end")]
    for robot, track, cells in zip(figures.robots, review.tracks, swept, strict=True):
        plot.paint(layer(cells), robot_tint(track.number))
        words = f"{robot.name}: {robot.swept_m2:.1f} m2, {clock(robot.busy_s)} at work"
        key.append(KeyEntry("tile", robot_tint(track.number), words))
    shares = {cell: share for track in review.tracks for cell, share in track.again.items()}
    for is_again, colour, what, area_m2 in (
        (False, palette.RULE, "driven through", figures.through_m2),
        (True, palette.UNSWEPT, "swept again", figures.again_m2),
    ):
        some = [cell for cell, share in shares.items() if (share > MOSTLY) == is_again]
        plot.paint(layer(np.array(some, np.int64).reshape(-1, 2)), colour)
        key.append(KeyEntry("tile", colour, f"after another robot {what}, {area_m2:.1f} m2"))
    for track in review.tracks:
        rows, cols = track.entered[:, 1], track.entered[:, 2]
        points = np.array(
            [geometry.to_map(c - window.col0 + 0.5, r - window.row0 + 0.5)
             for r, c in zip(rows.tolist(), cols.tolist(), strict=True)]
        ).reshape(-1, 2)  # fmt: skip
        plot.line(points, _track_colour(track.number), TRACK_PX)
        if len(points):
            plot.end_mark(points[-1])
            plot.start_mark(points[0])
    lines = [
        f"makespan {clock(figures.makespan_s)}; time at work (least / most): "
        f"{figures.busy_balance:.2f}; waited {figures.waited_s:.0f} s in all",
        f"{figures.swept_m2:.1f} m2 swept, {percent(figures.again_share)} of it swept again",
    ]
    if simulated := scale_words(figures.time_scale):
        lines.insert(0, f"{simulated}: times are by the robots' clocks")
    title = f"Fleet {figures.fleet}: {len(figures.robots)} robots"
    return Sheet(title, lines, key, None, plot.view.scale).around(plot.finished())
