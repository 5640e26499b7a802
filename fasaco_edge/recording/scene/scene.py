"""The scene of a recording: decoded messages in, entities out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.client.phrases import BAD, trouble_changes
from fasaco_edge.errors import PatchWithoutBase
from fasaco_edge.grid.geometry import Bounds, Pose2D, StampedPose, union_bounds
from fasaco_edge.grid.occupancy import MapPatch, OccupancyGrid, known_bounds
from fasaco_edge.mission.orders.order import Command
from fasaco_edge.recording import entities
from fasaco_edge.recording.scene import archetypes as draw
from fasaco_edge.recording.scene.archetypes import log_styles
from fasaco_edge.recording.scene.blueprint import build_blueprint
from fasaco_edge.recording.scene.curves import OF_PATH, OF_PHEROMONE, OF_RECORDER, OF_STATUS, Curves
from fasaco_edge.recording.scene.drawings import AreaDrawing, DrivenPathDrawing, PathDrawing
from fasaco_edge.recording.scene.layers import (
    RATES,
    Anchor,
    Layers,
    is_far_from,
    size_in_file,
)
from fasaco_edge.recording.scene.runcard import Outcome, RunDescription
from fasaco_edge.recording.sdk import rr
from fasaco_edge.recording.write.writer import RecordingWriter
from fasaco_edge.wire.documents.path_documents import PathAttachment
from fasaco_edge.wire.documents.rooms import Rooms
from fasaco_edge.wire.documents.settings import known_settings
from fasaco_edge.wire.documents.status import Recorder, Status
from fasaco_edge.wire.messages.paths import PathMessage
from fasaco_edge.wire.messages.pheromone import PheromoneMessage
from fasaco_edge.wire.reasons import plain

DEFAULT_RADIUS_M = 0.2
# The view follows the growing map in steps of this fraction of its size, as each blueprint takes
# 120 kB.
REFRAME_FRACTION = 0.15


class Scene:
    """Draws a mission into a writer, message by message; the caller sets the time."""

    def __init__(self, writer: RecordingWriter, description: RunDescription) -> None:
        self._writer = writer
        self._run = description
        # Set by the first pose, map or path.
        self._anchor: Anchor | None = None
        self._map: OccupancyGrid | None = None
        self._known: Bounds | None = None
        self._framed: Bounds | None = None
        self._errors = self._restored = 0
        self._robot: Pose2D | None = None
        self._states: dict[str, str] = {}
        self._status: Status | None = None
        # The last drawn content of each grid: a daemon publishes unchanged grids again.
        self._drawn: dict[str, object] = {}
        self._outcome = Outcome()
        self._layers = Layers()
        self._curves = Curves(writer)
        self._driven = DrivenPathDrawing(writer)
        self._paths = PathDrawing(writer, self._layers)
        self._areas = AreaDrawing(writer, self._layers, self._anchored)
        log_styles(writer)
        self._describe()
        self._draw_robot(DEFAULT_RADIUS_M)

    def add_map(self, grid: OccupancyGrid) -> None:
        self._draw_grid(self._anchored(grid.geometry.origin).grid(grid))

    def _draw_grid(self, grid: OccupancyGrid) -> None:
        self._map = grid
        if self._comes_again(entities.MAP, grid.geometry, grid.cells):
            return

        def draw_map() -> rr.GridMap:
            self._frame(grid)
            return draw.map_archetype(grid)

        self._draw(entities.MAP, size_in_file(grid.cells), draw_map, grid.cells.size)

    def add_map_update(self, patch: MapPatch) -> None:
        """Apply a patch to the map.

        Raises:
            PatchWithoutBase: the patch lies outside the map, or there is no map.
        """
        if self._map is None:
            raise PatchWithoutBase("a map update came before any map")
        self._draw_grid(self._map.patched(patch))

    def add_pose(self, stamped: StampedPose) -> None:
        """Move the robot, and draw its driven path."""
        pose = self._anchored(stamped.pose).pose(stamped.pose)
        self._writer.log(entities.ROBOT, draw.pose_archetype(pose), latched=True)
        if self._robot is None:
            self._mark(entities.START, pose, draw.START_COLOUR)
        self._outcome.add_pose(stamped)
        self._robot = pose
        self._driven.add(pose.x, pose.y)

    def _mark(self, entity: str, pose: Pose2D, colour: draw.Colour) -> None:
        name = entity.rpartition("/")[2]
        self._writer.log(entity, draw.mark_archetype(pose, name, colour), latched=True)

    def add_command(self, command: Command) -> None:
        """Log a command accepted by the mission."""
        which = f" {command.keep_out.name!r}" if command.keep_out else ""
        which += f" {command.room.id!r}" if command.room else ""
        self.add_line(entities.MISSION_LOG, f"command: {command.name}{which}")

    def add_rooms(self, found: Rooms) -> None:
        """Draw the outlines of the rooms, with their names."""
        self._areas.add_rooms([(room.title, room.outline) for room in found.outlined])

    def add_path(self, message: PathMessage, about: PathAttachment) -> None:
        """Draw the path to drive, over the previous one, and log its reason."""
        anchor = self._anchor
        if anchor is None and len(message.xy):
            anchor = self._anchored(Pose2D(*message.xy[0].tolist()))
        self._paths.add(message, about, anchor or Anchor())
        self._curves.add(OF_PATH, about)

    def add_floor(self, grid: OccupancyGrid) -> None:
        """Tint the swept floor."""
        if self._comes_again(entities.FLOOR, grid.geometry, grid.cells):
            return
        grid = self._anchored(grid.geometry.origin).grid(grid)
        # With four bytes a pixel, the layer is twice as large after compression.
        size, drawn = 2 * size_in_file(grid.cells), 4 * grid.cells.size
        self._draw(entities.FLOOR, size, lambda: draw.floor_archetype(grid), drawn)

    def add_pheromone(self, message: PheromoneMessage) -> None:
        """Draw the living trail."""
        about = message.geometry, message.trail_min, message.trail_max
        if self._comes_again(entities.PHEROMONE, about, message.levels):
            return
        message = self._anchored(message.geometry.origin).grid(message)
        in_file, size = size_in_file(message.levels), message.levels.size
        self._draw(entities.PHEROMONE, in_file, lambda: draw.pheromone_archetype(message), size)
        self._curves.add(OF_PHEROMONE, message)

    def add_status(self, status: Status) -> None:
        """Plot the daemon's figures, show its states, log its errors."""
        self._curves.add(OF_STATUS, status)
        self._outcome.add_status(status)
        self._add_configuration(status)
        if (restored := status.ledger.restored_cells) != self._restored:
            self._restored = restored
            self.add_line(entities.MISSION_LOG, f"{restored} cells were covered before a restart")
        self._areas.add_report(status.mission)
        self.enter(entities.MISSION_STATE, status.state, plain(status.reason))
        for text, tone in trouble_changes(self._status, status):
            self.add_line(entities.MISSION_LOG, text, "WARN" if tone == BAD else "INFO")
        self._status = status
        errors = status.errors
        # The count falls when the daemon restarts.
        if errors.total > self._errors:
            last = errors.last or "no text"
            self.add_line(entities.MISSION_LOG, f"error {errors.total}: {last}", "ERROR")
        self._errors = errors.total

    def add_report(self, report: Recorder) -> None:
        """Show the recorder's own state and memory."""
        self.enter(entities.RECORDER_STATE, report.state, report.reason)
        self._curves.add(OF_RECORDER, report)

    def enter(self, entity: str, state: str, reason: str = "") -> None:
        """Show that ``entity`` is in ``state`` from now on; log it if there is a reason."""
        if not state or self._states.get(entity) == state:
            return
        self._states[entity] = state
        self._writer.log(entity, rr.StateChange(state=state), latched=True)
        if reason:
            recorder = entity == entities.RECORDER_STATE
            log = entities.RECORDER_LOG if recorder else entities.MISSION_LOG
            self.add_line(log, f"{state}: {reason}")

    def add_line(self, log: str, message: str, level: str = "INFO") -> None:
        self._writer.log(log, rr.TextLog(message, level=level))

    def catch_up(self) -> None:
        """Make the drawings that are due; call it often."""
        self._layers.catch_up(self._writer.wall_ns)
        self._driven.catch_up()

    def finish(self) -> None:
        """Make all waiting drawings, and fit the view to the final map."""
        self._layers.finish()
        self._driven.finish()
        if self._robot is not None:
            self._mark(entities.END, self._robot, draw.END_COLOUR)
        self._curves.finish()
        if self._known is not None and self._known != self._framed:
            self._writer.show(build_blueprint(self._known))

    def _draw(
        self, entity: str, in_file: int, drawn: Callable[[], rr.AsComponents], size: int = 0
    ) -> None:
        """Draw a layer once its rate allows; ``in_file``: its compressed size [bytes]."""

        def log() -> None:
            self._writer.log(entity, drawn(), latched=True, size=size)

        self._layers.draw(entity, in_file, log, self._writer.wall_ns)

    def _comes_again(self, entity: str, about: object, pixels: NDArray[np.generic]) -> bool:
        before, newest = self._drawn.get(entity), (about, hash(pixels.tobytes()))
        self._drawn[entity] = newest
        return before == newest

    def _anchored(self, place: Pose2D) -> Anchor:
        """Return the anchor; the first ``place`` sets it, and logs it if it is far from 0."""
        if self._anchor is None:
            self._anchor = anchor = Anchor.near(place.x, place.y)
            if anchor:
                where = rr.Transform3D(translation=[anchor.x, anchor.y, 0.0])
                self._writer.log_static(entities.WORLD, where)
                self._run = replace(self._run, anchor=(anchor.x, anchor.y))
                self._describe()
        return self._anchor

    def _frame(self, grid: OccupancyGrid) -> None:
        self._known = bounds = union_bounds(self._known, known_bounds(grid))
        if bounds is None:
            return
        if self._framed is None or is_far_from(self._framed, bounds, REFRAME_FRACTION):
            self._framed = bounds
            self._writer.show(build_blueprint(bounds))

    def _add_configuration(self, status: Status) -> None:
        known = replace(
            self._run,
            version=status.version or self._run.version,
            config=status.config or self._run.config,
            outcome=self._outcome.text,
        )
        if known == self._run:
            return
        self._run = known
        self._describe()
        settings = known_settings(status.config)
        # A simulated robot sweeps faster than the recorder's clock runs.
        self._layers.limit({layer: settings.pace * rate for layer, rate in RATES.items()})
        if settings.robot.radius_m > 0:
            self._draw_robot(settings.robot.radius_m)

    def _describe(self) -> None:
        card = rr.TextDocument(self._run.markdown(), media_type="text/markdown")
        # Not static: the outcome changes.
        self._writer.log(entities.RUN_CARD, card, latched=True)
        self._writer.describe(self._run.name)

    def _draw_robot(self, radius_m: float) -> None:
        body, heading = draw.body_archetypes(radius_m)
        self._writer.log_static(entities.ROBOT_BODY, body)
        self._writer.log_static(entities.ROBOT_HEADING, heading)
