"""The picture of a fleet's review: floor swept by each robot, floor swept again, and tracks."""

from __future__ import annotations

import numpy as np
from PIL import Image

from fasaco_edge.drawing import palette
from fasaco_edge.drawing.plot import MapLayer, Plot, View
from fasaco_edge.drawing.sheet import KeyEntry, Sheet
from fasaco_edge.fleet.observer.cells import Cells, mask_of, together, window_of
from fasaco_edge.fleet.review.drawing import robot_tint
from fasaco_edge.fleet.review.report import FleetReview
from fasaco_edge.grid.geometry import Window
from fasaco_edge.review.wording import clock

TRACK_PX = 1.6
# Share from which a cell counts as swept again.
MOSTLY = 0.5


def draw_fleet_review(review: FleetReview) -> Image.Image:
    """Return the picture, RGB."""
    figures, seat = review.figures, review.seat
    swept = [np.array([*track.swept_ms], np.int64).reshape(-1, 2) for track in review.tracks]
    window = window_of(together([review.ground, *swept])) or Window(0, 0, 1, 1)
    geometry = seat.geometry(window)

    def layer(cells: Cells) -> MapLayer:
        return MapLayer(geometry, mask_of(cells, window))

    plot = Plot(View.over(geometry.bounds(), seat.cell_m))
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
        rows, cols = track.passes[:, 1], track.passes[:, 2]
        points = np.array(
            [geometry.to_map(c - window.col0 + 0.5, r - window.row0 + 0.5)
             for r, c in zip(rows.tolist(), cols.tolist(), strict=True)]
        ).reshape(-1, 2)  # fmt: skip
        colour = palette.ROBOTS[track.number % len(palette.ROBOTS)][1]
        plot.line(points, colour, TRACK_PX)
        if len(points):
            plot.end_mark(points[-1])
            plot.start_mark(points[0])
    lines = [
        f"makespan {clock(figures.makespan_s)}; time at work, least over most: "
        f"{figures.busy_balance:.2f}; waited {figures.waited_s:.0f} s in all",
        f"{figures.swept_m2:.1f} m2 swept, {figures.again_share:.1%} of it swept again",
    ]
    title = f"Fleet {figures.fleet}: {len(figures.robots)} robots"
    return Sheet(title, lines, key, None, plot.view.scale).around(plot.finished())
