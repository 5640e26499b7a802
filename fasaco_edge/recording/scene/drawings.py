"""Drawings of paths, of the driven path, and of zones, keep-outs and rooms in a recording."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from msgspec.structs import astuple
from numpy.typing import NDArray

from fasaco_edge.grid.geometry import Polygon, Pose2D
from fasaco_edge.recording import entities
from fasaco_edge.recording.scene import archetypes as draw
from fasaco_edge.recording.scene.layers import Anchor, Layers
from fasaco_edge.recording.sdk import rr
from fasaco_edge.recording.write.writer import RecordingWriter
from fasaco_edge.text import one_line
from fasaco_edge.wire.documents.path_documents import PathAttachment
from fasaco_edge.wire.documents.replies import MissionReport
from fasaco_edge.wire.messages.paths import PathMessage
from fasaco_edge.wire.reasons import plain

# Bytes of a path's point in the file: each path is drawn twice, later as the previous path.
POINT_BYTES = 2 * 12
# Time after which another plan of the same kind is logged at level INFO again.
LOGGED_AGAIN_NS = 60_000_000_000


Line = NDArray[np.float64]


class PathDrawing:
    """Draws paths, each as soon as the rate limit of its layer allows."""

    def __init__(self, writer: RecordingWriter, layers: Layers) -> None:
        self._writer = writer
        self._layers = layers
        # Kind and time [ns] of the last plan logged at level INFO.
        self._logged = ("", -LOGGED_AGAIN_NS)
        self._revision = -1
        self._has_window = False
        # Revision and line of the path drawn last.
        self._drawn: tuple[int, Line | None] = (-1, None)

    def add(self, message: PathMessage, about: PathAttachment, anchor: Anchor) -> None:
        """Draw a path relative to the anchor, and log it unless it was published before."""
        revision = about.revision
        if revision:
            self._writer.sequence(entities.REPLAN, revision)
        if self._revision != revision:
            self._log(about, _path_line(message, about))
            self._draw_window(about, anchor)
        self._revision, line = revision, draw.corners(message.xy - anchor.xy)

        def draw_path() -> None:
            (before, old), self._drawn = self._drawn, (revision, line)
            if old is not None and before != revision:
                self._draw(entities.OLD_PATH, old, draw.OLD_PATH)
            self._draw(entities.PATH, line, draw.PATH)

        self._layers.draw(entities.PATH, POINT_BYTES * len(line), draw_path, self._writer.wall_ns)

    def _log(self, about: PathAttachment, line: str) -> None:
        """Log a path, at level DEBUG if it says nothing new; the layout does not show that level.

        A plan of the same kind as the last is new again after ``LOGGED_AGAIN_NS``; a path without a
        plan, such as a polished line, is never new.
        """
        kind, now_ns = about.reason.partition(":")[0], self._writer.wall_ns
        shown, at_ns = self._logged
        is_new = bool(about.planner) and (kind != shown or now_ns - at_ns >= LOGGED_AGAIN_NS)
        if is_new:
            self._logged = kind, now_ns
        log_line = rr.TextLog(line, level="INFO" if is_new else "DEBUG")
        self._writer.log(entities.PATH_LOG, log_line)

    def _draw_window(self, about: PathAttachment, anchor: Anchor) -> None:
        if about.changed is not None:
            x0, y0, x1, y1 = np.subtract(astuple(about.changed), anchor.xy * 2).tolist()
            box = draw.box_archetype((x0, y0, x1, y1), draw.WINDOW)
            label = draw.label_archetype((x0, y0, x1, y1), plain(about.reason))
        elif self._has_window:
            box = draw.line_archetype(np.zeros((0, 2)), draw.WINDOW)
            label = rr.Points3D(np.zeros((0, 3)))
        else:
            return
        self._has_window = about.changed is not None
        self._writer.log(entities.REPLAN_WINDOW, box, latched=True)
        self._writer.log(entities.REPLAN_REASON, label, latched=True)

    def _draw(self, entity: str, line: Line, style: draw.LineStyle) -> None:
        archetype = draw.line_archetype(line, style)
        self._writer.log(entity, archetype, latched=True, size=line.nbytes)


def _path_line(message: PathMessage, about: PathAttachment) -> str:
    named = f"path {about.revision}" if about.revision else "path"
    # The figures of a plan are those at planning time; part of its path may be driven by now.
    planned = about.planned_steps
    facts = [f"{max(len(message.xy) - 1, 0) if planned is None else planned} steps"]
    if about.planned_cost_s is not None:
        facts.append(f"{about.planned_cost_s:.0f} s to drive")
    if about.gap is not None:
        facts.append(f"gap {100 * about.gap:.0f} %")
    if about.planner:
        facts.append(f"{about.planner} took {about.plan_ms:.0f} ms")
    return f"{named}{': ' if about.reason else ''}{plain(about.reason)} ({', '.join(facts)})"


SPACING_M = 0.02
# Period of drawing the driven path: drawn at each flush, the path would be 5 % of the recording.
PERIOD_NS = 2_000_000_000


class DrivenPathDrawing:
    """Draws the driven path piece by piece."""

    def __init__(self, writer: RecordingWriter) -> None:
        self._writer = writer
        self._piece: list[tuple[float, float]] = []
        self._drawn_ns = 0

    def add(self, x: float, y: float) -> None:
        """Add a point [m]."""
        if self._piece and math.dist(self._piece[-1], (x, y)) < SPACING_M:
            return
        self._piece.append((x, y))
        self.catch_up()

    def catch_up(self) -> None:
        """Draw the waiting piece once it is due; call it often."""
        if self._writer.wall_ns - self._drawn_ns >= PERIOD_NS:
            self.finish()

    def finish(self) -> None:
        """Draw the waiting piece."""
        if len(self._piece) < 2:
            return
        self._drawn_ns = self._writer.wall_ns
        piece = draw.line_archetype(np.array(self._piece), draw.DRIVEN)
        self._writer.log(entities.DRIVEN_PATH, piece)
        # The next piece begins where this one ends.
        self._piece = self._piece[-1:]


Named = tuple[str, Polygon | None]


class AreaDrawing:
    """Draws the outlines of rooms, of zones, and of keep-outs, if they have changed.

    Args:
        writer: writes the drawings.
        layers: limits the rate of the rooms.
        anchored: returns the origin of drawings; the first call sets it near the given pose.
    """

    def __init__(
        self, writer: RecordingWriter, layers: Layers, anchored: Callable[[Pose2D], Anchor]
    ) -> None:
        self._writer, self._layers, self._anchored = writer, layers, anchored
        self._newest: dict[str, Sequence[Named]] = {}

    def add_report(self, report: MissionReport) -> None:
        """Draw the zones and keep-outs of a mission."""
        kept_out = [
            (f"keep out: {each.name}" if each.name else "keep out", each.polygon)
            for each in report.keep_outs
        ]
        zones = [(zone.name, zone.polygon) for zone in report.zones]
        for entity, areas, style in (
            (entities.ZONES, zones, draw.ZONE),
            (entities.KEEP_OUT, kept_out, draw.KEEP_OUT),
        ):
            if self._is_new(entity, areas):
                self._draw(entity, areas, style)

    def add_rooms(self, rooms: Sequence[Named]) -> None:
        if self._is_new(entities.ROOMS, rooms):
            size = 2 * POINT_BYTES * sum(len(outline or ()) for _, outline in rooms)
            self._layers.draw(
                entities.ROOMS,
                size,
                lambda: self._draw(entities.ROOMS, rooms, draw.ROOM),
                self._writer.wall_ns,
            )

    def _is_new(self, entity: str, areas: Sequence[Named]) -> bool:
        before, self._newest[entity] = self._newest.get(entity, []), areas
        return before != areas

    def _draw(self, entity: str, areas: Sequence[Named], style: draw.LineStyle) -> None:
        placed = [
            (one_line(name), np.array(corners) - self._anchored(Pose2D(*corners[0])).xy)
            for name, corners in areas
            if corners
        ]
        self._writer.log(entity, draw.polygons_archetype(placed, style), latched=True)
