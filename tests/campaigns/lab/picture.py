"""Pictures of missions in the lab: what was swept and what is claimed, with a legend."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from fasaco_edge.drawing import palette
from fasaco_edge.drawing.palette import Colour
from fasaco_edge.drawing.sheet import KeyEntry, Sheet
from tests.campaigns.lab.judge import Figures
from tests.campaigns.lab.mission import LabRun
from tests.campaigns.lab.truth import Truth

BOTH: Colour = (150, 210, 150)
UNCLAIMED: Colour = (150, 180, 240)
UNSWEPT: Colour = (250, 170, 0)
BESIDE: Colour = (255, 220, 140)
MISSED: Colour = (230, 60, 60)
TRACK: Colour = (60, 60, 60)
CONTACT: Colour = (200, 0, 200)
KEY = (
    (BOTH, "swept and claimed"),
    (UNCLAIMED, "swept, not claimed"),
    (UNSWEPT, "claimed, not swept"),
    (BESIDE, "claimed out of reach"),
    (MISSED, "missed"),
    (palette.UNKNOWN, "out of reach"),
    (TRACK, "true track"),
    (CONTACT, "contact"),
)
# Radii of the marks of a contact, and of start and end [pixels].
CONTACT_PX, MARK_PX = 3, 8
# Largest edge of a picture [pixels].
MOST_PX = 1400


def draw(run: LabRun, truth: Truth, figures: Figures, file: Path) -> None:
    """Draw a mission as PNG."""
    plot = _plot(run, truth)
    scale = max(-(-max(plot.size) // MOST_PX), 1)
    plot = plot.reduce(scale) if scale > 1 else plot
    key = [KeyEntry("tile", colour, label) for colour, label in KEY]
    key += [KeyEntry("disc", palette.START, "start"), KeyEntry("disc", palette.END, "end")]
    settings = run.settings
    title = f"{run.building.name}, seed {settings.seed}: {figures.ending}"
    lines = [
        f"truly swept {figures.true_share:.1%} of what can be reached, {figures.clear_share:.1%} "
        f"of what is not beside a wall; claimed {figures.claimed_share:.1%}; {figures.contacts} "
        f"contacts",
        f"pose error {100 * figures.pose_error_median_m:.1f} cm (95%: "
        f"{100 * figures.pose_error_p95_m:.1f}); {figures.seconds:.0f} s, {figures.driven_m:.0f} m",
        f"{settings.people} people, noise {settings.noise_m:g} m, "
        f"{'ideal' if settings.ideal else 'slip and drift'}; {figures.state}: {figures.reason}",
    ]
    pixels_per_m = 1.0 / (truth.geometry.resolution * scale)
    Sheet(title, lines, key, None, pixels_per_m).around(plot).save(file)


def _plot(run: LabRun, truth: Truth) -> Image.Image:
    swept, claimed, reachable = truth.swept, truth.claimed, truth.reachable
    pixels = np.full((*swept.shape, 3), palette.UNKNOWN, np.uint8)
    pixels[reachable & ~swept] = MISSED
    pixels[swept & claimed] = BOTH
    pixels[swept & ~claimed] = UNCLAIMED
    pixels[claimed & ~swept & reachable] = UNSWEPT
    pixels[claimed & ~swept & ~reachable] = BESIDE
    pixels[truth.occupied] = palette.OCCUPIED
    of = run.trace.columns()
    cols, rows = (axis.astype(int) for axis in truth.geometry.to_pixels(of["x"], of["y"]))
    pixels[rows, cols] = TRACK
    for at in np.flatnonzero(of["touches"]):
        row, col = rows[at], cols[at]
        near = CONTACT_PX
        pixels[max(row - near, 0) : row + near + 1, max(col - near, 0) : col + near + 1] = CONTACT
    shown = np.argwhere(reachable | truth.occupied)
    (row0, col0), (row1, col1) = shown.min(axis=0), shown.max(axis=0)
    plot = Image.fromarray(np.flipud(pixels[row0 : row1 + 1, col0 : col1 + 1]))
    pen = ImageDraw.Draw(plot)
    for tick, colour in ((0, palette.START), (-1, palette.END)):
        x, y = int(cols[tick] - col0), int(row1 - rows[tick])
        pen.ellipse((x - MARK_PX, y - MARK_PX, x + MARK_PX, y + MARK_PX), outline=colour, width=3)
    return plot
