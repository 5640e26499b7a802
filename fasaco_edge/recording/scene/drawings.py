"""Drawings of paths and of the driven path, as a recording shows them."""

from __future__ import annotations

import math

import numpy as np
from msgspec.structs import astuple
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Bounds
from fasaco_edge.recording import entities
from fasaco_edge.recording.scene import archetypes as draw
from fasaco_edge.recording.scene.layers import Layers
from fasaco_edge.recording.sdk import rr
from fasaco_edge.recording.write.writer import RecordingWriter
from fasaco_edge.wire.paths import PathMessage
from fasaco_edge.wire.status import PathAttachment, Rectangle

# Edge of a region [steps], and at most about so many of them side by side.
REGION_STEPS = 5
MOST_ACROSS = 16
# Where less of the way than this runs in one direction, there is none.
LEAST_SHARE = 0.2
# A line is as long as this share of its region where all of the way runs along it.
LENGTH = 0.8


def main_directions(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a line, float64 (n, 2, 2), for each region that a path leads through.

    Back and forth is one direction: angles are doubled before they are averaged, so that the
    mean of opposite ones is their axis (K. V. Mardia, P. E. Jupp, Directional Statistics, 1.1).
    The line runs along that axis, the longer the more of the way does.

    Args:
        xy: points of the path [m], float64 (n, 2).
    """
    steps = np.diff(xy, axis=0)
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    moves = lengths > 0
    if not moves.any():
        return np.zeros((0, 2, 2))
    steps, lengths, middles = steps[moves], lengths[moves], (xy[1:] + xy[:-1])[moves] / 2
    edge = _edge(float(np.median(lengths)), float(np.ptp(xy, axis=0).max()))
    _, region = np.unique(np.floor(middles / edge), axis=0, return_inverse=True)
    region = region.ravel()
    doubled = 2 * np.arctan2(steps[:, 1], steps[:, 0])
    along, across, x, y = (
        np.bincount(region, lengths * part)
        for part in (np.cos(doubled), np.sin(doubled), middles[:, 0], middles[:, 1])
    )
    total = np.bincount(region, lengths)
    share, axis = np.hypot(along, across) / total, np.arctan2(across, along) / 2
    half = (LENGTH / 2 * edge * share) * np.array((np.cos(axis), np.sin(axis)))
    centre = np.array((x, y)) / total
    lines = np.stack((centre - half, centre + half)).transpose(2, 0, 1)
    return np.asarray(lines[share >= LEAST_SHARE], np.float64)


def _edge(step: float, extent: float) -> float:
    """Return the edge of a region [m]; it doubles, so that most regions stay where they were."""
    doublings = np.ceil(np.log2(max(extent / (MOST_ACROSS * REGION_STEPS * step), 1.0)))
    return float(REGION_STEPS * step * 2.0**doublings)


# A point of a line in the file; each path is drawn twice, the second time as the one before.
POINT_BYTES = 2 * 12


class PathDrawing:
    """Draws paths, each as soon as the allowance of its layer lets it."""

    def __init__(self, writer: RecordingWriter, layers: Layers) -> None:
        self._writer = writer
        self._layers = layers
        self._revision = 0
        self._count = 0
        self._has_window = False
        self._directions = np.zeros((0, 2, 2))
        # Number and line of the path that is drawn.
        self._drawn: tuple[int, NDArray[np.float64] | None] = (0, None)

    def add(self, message: PathMessage, about: PathAttachment) -> None:
        """Draw a path; one that is published again is still the same."""
        revision = about.revision
        if revision:
            self._writer.sequence(entities.REPLAN, revision)
        if not self._count or revision != self._revision:
            line = rr.TextLog(_path_line(message, about), level="INFO")
            self._writer.log(entities.PATH_LOG, line)
            self._draw_window(about.changed, about.reason)
            self._count += 1
        self._revision, count, line = revision, self._count, draw.corners(message.xy)

        lines = main_directions(message.xy)

        def draw_path() -> None:
            self._draw_directions(lines)
            (before, old), self._drawn = self._drawn, (count, line)
            if old is not None and before != count:
                self._draw(entities.OLD_PATH, old, draw.OLD_PATH)
            self._draw(entities.PATH, line, draw.PATH)

        self._layers.draw(entities.PATH, POINT_BYTES * len(line), draw_path, self._writer.wall_ns)

    def _draw_directions(self, lines: NDArray[np.float64]) -> None:
        if np.array_equal(lines, self._directions):
            return
        self._directions = lines
        archetype = draw.lines_archetype(lines, draw.DIRECTION)
        self._writer.log(entities.DIRECTIONS, archetype, latched=True, size=lines.nbytes)

    def _draw_window(self, changed: Rectangle | None, reason: str) -> None:
        """Draw the part of the map that led to the path; nothing where none did."""
        if changed is not None:
            bounds: Bounds = astuple(changed)
            box = draw.box_archetype(bounds, draw.WINDOW)
            label = draw.label_archetype(bounds, reason)
        elif self._has_window:
            box = draw.line_archetype(np.zeros((0, 2)), draw.WINDOW)
            label = draw.no_label_archetype()
        else:
            return
        self._has_window = changed is not None
        self._writer.log(entities.REPLAN_WINDOW, box, latched=True)
        self._writer.log(entities.REPLAN_REASON, label, latched=True)

    def _draw(self, entity: str, line: NDArray[np.float64], style: draw.LineStyle) -> None:
        archetype = draw.line_archetype(line, style)
        self._writer.log(entity, archetype, latched=True, size=line.nbytes)


def _path_line(message: PathMessage, about: PathAttachment) -> str:
    named = f"path {about.revision}" if about.revision else "path"
    facts = [f"{max(len(message.xy) - 1, 0)} steps"]
    if about.planned_cost_s is not None:
        facts.append(f"{about.planned_cost_s:.0f} s")
    if about.gap is not None and about.planned_steps is not None:
        # Of the plan as it was made; of the path, a part may have been driven since.
        over = f"{100 * about.gap:.0f} % over the bound"
        facts.append(f"planned {about.planned_steps} steps, {over}")
    if about.planner:
        facts.append(about.planner)
    facts.append(f"{about.plan_ms:.0f} ms")
    return f"{named}{': ' if about.reason else ''}{about.reason} ({', '.join(facts)})"


SPACING_M = 0.02
# Drawn as often as the recording is flushed, it would be a twentieth of an hour's file.
PERIOD_NS = 2_000_000_000


class DrivenPathDrawing:
    """Draws the driven path piece by piece."""

    def __init__(self, writer: RecordingWriter) -> None:
        self._writer = writer
        self._piece: list[tuple[float, float]] = []
        self._drawn_ns = 0

    def add(self, x: float, y: float) -> None:
        """Go on to a place [m]."""
        if self._piece and math.dist(self._piece[-1], (x, y)) < SPACING_M:
            return
        self._piece.append((x, y))
        self.catch_up()

    def catch_up(self) -> None:
        """Draw what has waited long enough; call it often."""
        if self._writer.wall_ns - self._drawn_ns >= PERIOD_NS:
            self.finish()

    def finish(self) -> None:
        """Draw what waits."""
        if len(self._piece) < 2:
            return
        self._drawn_ns = self._writer.wall_ns
        piece = draw.strip_archetype(np.array(self._piece), draw.DRIVEN)
        self._writer.log(entities.DRIVEN_PATH, piece)
        # The next piece begins where this one ends.
        self._piece = self._piece[-1:]
