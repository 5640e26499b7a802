"""A review on one picture: the map with what was covered, and three charts over time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fasaco_edge.drawing import palette
from fasaco_edge.drawing.chart import draw_panels
from fasaco_edge.drawing.pictures import draw_mission
from fasaco_edge.mission.coverage.ledger import JUMP_CELLS
from fasaco_edge.review.charts import coverage_panel, replan_panel, state_panel
from fasaco_edge.review.review import Review
from fasaco_edge.review.rows import clock

SIZE = (1600, 900)
# What title, caption and key take beside the map.
AROUND = (56, 210)
TRAIL_SPACING_M = 0.02
DONE = {True: "complete", False: "not complete", None: "recorded in part"}


def draw_review(review: Review) -> Image.Image:
    """Return a picture, RGB, of ``SIZE``."""
    panels = [
        coverage_panel([review], [""]),
        replan_panel([review], [""]),
        state_panel(review),
    ]
    charts = draw_panels("", (), panels, columns=1)
    sheet = Image.new("RGB", SIZE, palette.PAPER)
    # The empty title above the charts may be cut off.
    sheet.paste(charts, (SIZE[0] - charts.width, SIZE[1] - charts.height))
    space = SIZE[0] - charts.width
    mission = draw_map(review, (space - AROUND[0], SIZE[1] - AROUND[1]))
    if mission is not None:
        # A caption of many lines leaves less space for the map.
        mission.thumbnail((space, SIZE[1]))
        place = ((space - mission.width) // 2, (SIZE[1] - mission.height) // 2)
        sheet.paste(mission, place)
    return sheet


def draw_map(review: Review, space: tuple[int, int]) -> Image.Image | None:
    """Return the map at the end with cells and track; None where a recording lacks them.

    Args:
        review: of what.
        space: the most the map may take (width, height) [px].
    """
    grid, lattice, drive = review.data.grid, review.lattice, review.drive
    track = _thinned(review.data.track[:, :2])
    if grid is None or lattice is None or drive is None or not len(track):
        return None
    return draw_mission(
        grid,
        lattice,
        track,
        drive.visits,
        title=f"{review.record.recording_id}: {DONE[review.complete]}",
        lines=_caption(review),
        space=space,
        jump_m=JUMP_CELLS * lattice.cell_m,
    )


def _caption(review: Review) -> list[str]:
    counts, walk, replans = review.counts, review.walk, review.replans
    lines = []
    if counts is not None:
        lines.append(
            f"{counts.covered:,} of {counts.coverable:,} reachable cells covered; "
            f"recorded for {clock(review.duration_s)}"
        )
    if walk is not None:
        lines.append(
            f"{walk.steps:,} steps, {walk.revisits:,} revisits, {walk.turns_90:,} quarter-turns"
        )
    median, slowest = replans.milliseconds(50), replans.milliseconds(100)
    if median is not None and slowest is not None:
        lines.append(
            f"{len(replans.later):,} replans, {median:.1f} ms in the median, "
            f"{slowest:.0f} ms at worst; {review.faults.total:,} messages refused"
        )
    return lines


def _thinned(track: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a track (n, 2) without the points that lie as good as on others."""
    if len(track) < 3:
        return track
    way = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(track, axis=0).T))))
    kept = np.diff(np.floor(way / TRAIL_SPACING_M), prepend=-1.0) > 0
    kept[-1] = True
    return track[kept]
