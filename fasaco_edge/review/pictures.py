"""Pictures of a review: the map with the track, pheromone fields, all on one sheet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fasaco_edge.bench.floor import swept_words
from fasaco_edge.drawing import palette
from fasaco_edge.drawing.chart import draw_panels
from fasaco_edge.drawing.pictures import draw_mission
from fasaco_edge.drawing.plot import MapLayer
from fasaco_edge.grid.geometry import Window
from fasaco_edge.mission.coverage.ledger import JUMP_CELLS
from fasaco_edge.review.panels import coverage_panel, replan_panel, state_panel
from fasaco_edge.review.review import Review
from fasaco_edge.review.rows import clock

# Fields on a page; the edge of the square that each has to fit into [px].
FIELDS, FIELD_PX = 4, 440


def draw_fields(review: Review) -> list[tuple[float, Image.Image]]:
    """Return the pheromone field at four moments: when [s], and RGB pictures of one place."""
    fields, record = review.record.fields, review.record
    around = Window.around(*(field.window for field in fields))
    if around is None:
        return []
    first, last = fields[0].at_ns, fields[-1].at_ns
    wanted = [first + (last - first) * number // FIELDS for number in range(1, FIELDS + 1)]
    chosen = [max((f for f in fields if f.at_ns <= at), key=lambda f: f.at_ns) for at in wanted]
    scale = max(FIELD_PX // max(around.rows, around.cols), 1)
    pictures = []
    for field in dict.fromkeys(chosen):
        levels = np.zeros((around.rows, around.cols), np.uint8)
        levels[field.window.slices_in(around)] = field.levels
        pixels = palette.gradient(levels.ravel() / 255.0).reshape(*levels.shape, 3)
        pixels[levels == 0] = palette.UNKNOWN
        size = around.cols * scale, around.rows * scale
        shown = Image.fromarray(pixels[::-1]).resize(size, Image.Resampling.NEAREST)
        shown.thumbnail((FIELD_PX, FIELD_PX))
        pictures.append((1e-9 * (field.at_ns - record.began_ns), shown))
    return pictures


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
    """Return the map at the end with cells, floor not swept and track; None without any of them.

    Args:
        review: of what.
        space: the most the map may take (width, height) [px].
    """
    grid, lattice, drive, floor = review.data.grid, review.lattice, review.drive, review.floor
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
        unswept=MapLayer(floor.geometry, floor.unswept) if floor else None,
    )


def _caption(review: Review) -> list[str]:
    counts, walk, replans = review.counts, review.walk, review.replans
    lines = []
    if counts is not None:
        lines.append(
            f"{counts.covered:,} of {counts.coverable:,} reachable cells covered; "
            f"recorded for {clock(review.duration_s)}"
        )
    if review.floor is not None:
        figures = review.floor.figures
        swept = swept_words(figures.swept_m2, figures.reachable_m2)
        lines.append(f"reachable floor swept: {swept}")
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
