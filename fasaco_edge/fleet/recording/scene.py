"""Scene of a fleet: the data of its robots as entities, all in the fleet's frame.

Each robot has a colour, and a tree of entities of its own. The robots share the rate of each layer,
so that the file grows no faster than with one robot.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.drawing import palette
from fasaco_edge.fleet.observer.cells import mask_of, window_of
from fasaco_edge.fleet.observer.observed import GONE, ObservedFleet, ObservedRobot
from fasaco_edge.fleet.observer.queues import LEAST_SHARING
from fasaco_edge.fleet.observer.survey import Survey, survey_of
from fasaco_edge.fleet.recording.layout import build_layout, card_of, robot_entity
from fasaco_edge.grid.geometry import Bounds, GridGeometry, Pose2D, union_bounds
from fasaco_edge.grid.occupancy import OccupancyGrid, coarser, known_bounds
from fasaco_edge.recording import entities
from fasaco_edge.recording.scene import archetypes as draw
from fasaco_edge.recording.scene.blueprint import NO_MAP
from fasaco_edge.recording.scene.layers import Anchor, Layers, is_far_from, size_in_file
from fasaco_edge.recording.sdk import rr
from fasaco_edge.recording.write.writer import RecordingWriter

# Largest rate of drawings in the file, over all robots [bytes/s]; overhead of a drawing [bytes].
RATES = {
    "map": 3_000, "swept": 3_000, "path": 2_500, "trail": 2_000, "pose": 2_000, "metrics": 2_000,
}  # fmt: skip
FLEET_RATES = {entities.FLEET_SHARES: 2_000, entities.RUN_CARD: 800}
CHUNK_BYTES = 1_200
# Overhead of a layer of cells [bytes].
GRID_BYTES = 1_200
# Limit on the pixels of all maps together, of four bytes each: each file of a recording begins with
# all maps.
MOST_PIXELS = 2_000_000
# The view is fitted again once the maps have grown by this share of their size.
REFRAME = 0.15
MAP_ORDER, SHARE_ORDER, SWEPT_ORDER, TWICE_ORDER = 0.0, 1.0, 2.0, 3.0
SHARE_ALPHA, SWEPT_ALPHA, TWICE_COLOUR = 55, 150, (60, 60, 70, 150)
PATH_Z, TRACK_Z, LABEL_Z = 0.05, 0.04, 0.1
TRACK_SPACING_M = 0.05
MOST_TRACK = 4_000
METRICS = ("swept_m2", "left_cells")
STATES = {**draw.STATES[entities.MISSION_STATE], "waiting": 0xDB2777FF, GONE: 0x111827FF}


@dataclass(slots=True)
class _RobotDrawings:
    state: str = ""
    known: Bounds | None = None
    track: list[tuple[float, float]] = field(default_factory=list)
    figures: dict[str, float] = field(default_factory=dict)


class FleetScene:
    """Draws a fleet into a writer; the caller sets the time."""

    def __init__(self, writer: RecordingWriter, members: ObservedFleet) -> None:
        self._writer = writer
        self._members = members
        self._layers = Layers(FLEET_RATES)
        self._anchor: Anchor | None = None
        self._drawn: dict[str, _RobotDrawings] = {}
        self._framed: Bounds | None = None
        self._shown: tuple[str, ...] = ()
        self._survey, self._card = Survey(), ""
        writer.log_static(entities.FLEET, rr.ViewCoordinates.RIGHT_HAND_Z_UP)

    def join(self, member: ObservedRobot) -> None:
        """Draw a robot from now on."""
        self._drawn[member.name] = _RobotDrawings()
        self._limit()
        colour = _colour(member)
        styles = (("path", 1.3, colour), ("trail", 1.1, _darker(colour)))
        for name, width, tone in styles:
            style = draw.LineStyle(tone, 0.0, width)
            self._writer.log_static(_world(member, name), draw.style_archetype(style))
        body, heading = draw.body_archetypes(max(member.newest.radius_m, 0.05), colour)
        self._writer.log_static(_world(member, "robot/body"), body)
        self._writer.log_static(_world(member, "robot/heading"), heading)
        label = rr.Points3D(
            [(0.0, 0.0, LABEL_Z)], radii=0.0, labels=[member.name], colors=_darker(colour),
            show_labels=True,
        )  # fmt: skip
        self._writer.log_static(_world(member, "robot/label"), label)
        for name in METRICS:
            line = rr.SeriesLines(
                names=member.name, colors=colour, widths=1.8, interpolation_mode="StepAfter"
            )
            self._writer.log_static(robot_entity(member.name, f"metrics/{name}"), line)
        colours = np.array(list(STATES.values()), np.uint32)
        states = rr.StateConfiguration(values=list(STATES), labels=list(STATES), colors=colours)
        self._writer.log_static(robot_entity(member.name, "state"), states)
        self._show()

    def add_pose(self, member: ObservedRobot, pose: Pose2D) -> None:
        """Move a robot, and add to its track."""
        x, y = self._here(member, pose.x, pose.y)
        placed = Pose2D(x, y, pose.yaw + member.seat.frame.yaw)

        def draw_pose() -> None:
            archetype = draw.pose_archetype(placed)
            self._writer.log(_world(member, "robot"), archetype, latched=True)

        self._draw(member, "pose", 60, draw_pose)
        drawn = self._drawn[member.name]
        last = drawn.track[-1] if drawn.track else None
        if last is not None and abs(last[0] - x) + abs(last[1] - y) < TRACK_SPACING_M:
            return
        drawn.track.append((x, y))
        if len(drawn.track) > MOST_TRACK:
            # If the track has not been drawn for long, every other point is dropped.
            drawn.track = drawn.track[::2]

        def draw_track() -> None:
            piece, drawn.track = drawn.track, drawn.track[-1:]
            if len(piece) > 1:
                line = _line(np.array(piece), TRACK_Z)
                self._writer.log(_world(member, "trail"), line, size=12 * len(piece))

        self._draw(member, "trail", 24 * len(drawn.track), draw_track)

    def add_path(self, member: ObservedRobot, xy: NDArray[np.float64]) -> None:
        """Draw the path ahead of a robot."""
        points = np.array([self._here(member, x, y) for x, y in draw.corners(xy).tolist()])
        points = points.reshape(-1, 2)

        def draw_path() -> None:
            line = _line(points, PATH_Z)
            self._writer.log(_world(member, "path"), line, latched=True, size=points.nbytes)

        self._draw(member, "path", 12 * len(points), draw_path)

    def add_map(self, member: ObservedRobot, grid: OccupancyGrid) -> None:
        """Draw a robot's map; unknown pixels are transparent, to let other maps show."""
        grid = coarser(grid, MOST_PIXELS // max(len(self._drawn), LEAST_SHARING))
        x, y = self._here(member, grid.geometry.origin.x, grid.geometry.origin.y)
        yaw = grid.geometry.origin.yaw + member.seat.frame.yaw
        placed = replace(grid, geometry=replace(grid.geometry, origin=Pose2D(x, y, yaw)))
        tones = np.zeros((256, 4), np.uint8)
        tones[:101, :3] = np.rint(np.linspace(250, 20, 101))[:, None]
        tones[:101, 3] = 255
        drawn = self._drawn[member.name]

        def draw_map() -> None:
            pixels = tones[grid.cells.view(np.uint8)]
            archetype = draw.grid_archetype(placed.geometry, pixels, None, MAP_ORDER)
            entity = _world(member, "map")
            self._writer.log(entity, archetype, latched=True, size=pixels.nbytes)
            drawn.known = known_bounds(placed)
            self._show()

        self._draw(member, "map", 2 * size_in_file(grid.cells), draw_map)

    def add_cells(self, member: ObservedRobot) -> None:
        """Draw the cells that a robot has swept."""
        self._draw(
            member, "swept", GRID_BYTES + member.swept.count // 8, lambda: self._draw_swept(member)
        )

    def add_division(self) -> None:
        """Draw the shares of the remaining cells, and the cells that two robots swept."""
        # Drawings of a large ground are rarer, as they take more time.
        size = 2 * CHUNK_BYTES + sum(member.ground.count for member in self._members) // 4
        self._layers.draw(entities.FLEET_SHARES, size, self._draw_survey, self._writer.wall_ns)

    def add_figures(self, member: ObservedRobot, figures: dict[str, float]) -> None:
        """Plot changed figures of a robot, by names of METRICS."""
        drawn = self._drawn[member.name]
        drawn.figures |= figures

        def draw_figures() -> None:
            for name, value in drawn.figures.items():
                entity = robot_entity(member.name, f"metrics/{name}")
                self._writer.log(entity, rr.Scalars(value))
            drawn.figures = {}

        self._draw(member, "metrics", CHUNK_BYTES * (len(drawn.figures) - 1), draw_figures)

    def enter(self, member: ObservedRobot, state: str, why: str = "") -> None:
        """Show and log a robot's new state."""
        drawn = self._drawn[member.name]
        if not state or drawn.state == state:
            return
        drawn.state = state
        entity = robot_entity(member.name, "state")
        self._writer.log(entity, rr.StateChange(state=state), latched=True)
        self.add_line(f"{member.name}: {state}{' ' if why else ''}{why}")

    def add_line(self, line: str, level: str = "INFO") -> None:
        """Add a line to the log."""
        self._writer.log(entities.FLEET_LOG, rr.TextLog(line, level=level))

    def catch_up(self) -> None:
        """Make the drawings that are due; to be called often."""
        self._layers.catch_up(self._writer.wall_ns)

    def describe(self, title: str) -> None:
        """Show the card: each robot's activity."""
        states = {name: drawn.state for name, drawn in self._drawn.items()}
        card = card_of(title, self._members, states, self._survey)
        if card == self._card:
            return
        self._card = card
        document = rr.TextDocument(card, media_type="text/markdown")

        def draw_card() -> None:
            self._writer.log(entities.RUN_CARD, document, latched=True)

        size = CHUNK_BYTES + len(card)
        self._layers.draw(entities.RUN_CARD, size, draw_card, self._writer.wall_ns)

    def finish(self) -> None:
        """Make all waiting drawings, and fit the view to all maps."""
        self.add_division()
        for member in self._members:
            self.add_cells(member)
        self._layers.finish()
        self._framed = None
        self._show()

    def _draw(self, member: ObservedRobot, layer: str, size: int, make: Callable[[], None]) -> None:
        name = f"{layer}/{member.name}"
        self._layers.draw(name, CHUNK_BYTES + size, make, self._writer.wall_ns)

    def _limit(self) -> None:
        """Divide each layer's rate among the robots."""
        each = {
            f"{layer}/{name}": rate / max(len(self._drawn), 1)
            for layer, rate in RATES.items()
            for name in self._drawn
        }
        self._layers.limit(FLEET_RATES | each)

    def _anchored(self, x: float, y: float) -> Anchor:
        if self._anchor is None:
            self._anchor = Anchor.near(x, y)
        return self._anchor

    def _here(self, member: ObservedRobot, x: float, y: float) -> tuple[float, float]:
        """Return where to draw a point that is given in a robot's map frame [m]."""
        x, y = member.placed(x, y)
        anchor = self._anchored(x, y)
        return x - anchor.x, y - anchor.y

    def _draw_swept(self, member: ObservedRobot) -> None:
        cells = member.swept.cells()
        window = window_of(cells)
        if window is None:
            return
        pixels = np.zeros((window.rows, window.cols, 4), np.uint8)
        pixels[mask_of(cells, window)] = (*_colour(member), SWEPT_ALPHA)
        geometry = self._shifted(member.seat.geometry(window))
        self._log_grid(_world(member, "swept"), geometry, pixels, SWEPT_ORDER)

    def _draw_survey(self) -> None:
        self._survey = survey = survey_of(self._members, self._writer.wall_ns)
        if survey.geometry is None:
            return
        geometry, shape = self._shifted(survey.geometry), (*survey.owners.shape, 4)
        if survey.division:
            pixels = np.zeros(shape, np.uint8)
            for member in self._members:
                pixels[survey.owners == member.number] = (*_colour(member), SHARE_ALPHA)
            self._log_grid(entities.FLEET_SHARES, geometry, pixels, SHARE_ORDER)
        if survey.twice.any():
            pixels = np.zeros(shape, np.uint8)
            pixels[survey.twice] = TWICE_COLOUR
            self._log_grid(entities.FLEET_TWICE, geometry, pixels, TWICE_ORDER)

    def _log_grid(
        self, entity: str, geometry: GridGeometry, pixels: NDArray[np.uint8], order: float
    ) -> None:
        archetype = draw.grid_archetype(geometry, pixels, None, order)
        self._writer.log(entity, archetype, latched=True, size=pixels.nbytes)

    def _shifted(self, geometry: GridGeometry) -> GridGeometry:
        anchor = self._anchored(geometry.origin.x, geometry.origin.y)
        return replace(geometry, origin=anchor.pose(geometry.origin))

    def _show(self) -> None:
        """Fit the layout to the robots and their maps, if these have changed much."""
        robots = tuple(member.name for member in self._members)
        known: Bounds | None = None
        for drawn in self._drawn.values():
            known = union_bounds(known, drawn.known)
        framed = self._framed
        is_far = known is not None and (framed is None or is_far_from(framed, known, REFRAME))
        if robots != self._shown or is_far:
            self._shown, self._framed = robots, known
            self._writer.show(build_layout(robots, known or NO_MAP))


def _world(member: ObservedRobot, name: str) -> str:
    return robot_entity(member.name, f"world/{name}")


def _colour(member: ObservedRobot) -> tuple[int, int, int]:
    return palette.robot(member.number)[1]


def _darker(colour: tuple[int, int, int]) -> tuple[int, int, int]:
    red, green, blue = (round(0.6 * one) for one in colour)
    return red, green, blue


def _line(xy: NDArray[np.float64], z: float) -> rr.LineStrips3D:
    return draw.line_archetype(xy, draw.LineStyle((0, 0, 0), z, 0.0))
