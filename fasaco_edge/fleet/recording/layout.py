"""Layout of a fleet's recording: a map of all robots, a card, curves, states, and the log.

The card beside the map shows each robot's activity and colour.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fasaco_edge.drawing import palette
from fasaco_edge.fleet.observer.observed import ObservedFleet
from fasaco_edge.fleet.observer.survey import Survey
from fasaco_edge.grid.geometry import Bounds
from fasaco_edge.recording import entities
from fasaco_edge.recording.scene.blueprint import (
    MAP_BACKGROUND,
    eye_above,
    log_view,
    plot_view,
    up_to_cursor,
)
from fasaco_edge.recording.scene.curves import Plot
from fasaco_edge.recording.scene.runcard import markdown_cell
from fasaco_edge.recording.sdk import rrb

# Width over height of the map view at 1280 x 720; time for which a track is shown [s].
MAP_ASPECT, TRAIL_S = 1.62, 300.0


def robot_entity(robot: str, name: str) -> str:
    """Return the path of a robot's entity."""
    return f"{entities.ROBOTS}/{robot}/{name}"


def build_layout(robots: Sequence[str], bounds: Bounds) -> rrb.Blueprint:
    """Return the layout for robots, with the view fitted to ``bounds`` [m]."""

    def each(name: str) -> list[str]:
        return [f"/{robot_entity(robot, name)}" for robot in robots]

    def plot(title: str, name: str, *, top: float = 0.0) -> rrb.TimeSeriesView:
        return plot_view(Plot(title, rrb.Corner2D.LeftTop, top), each(f"metrics/{name}"))

    trails = {robot_entity(robot, "world/trail"): up_to_cursor(TRAIL_S) for robot in robots}
    worlds = [f"{world}/**" for world in each("world")]
    map_view = rrb.Spatial3DView(
        origin="/",
        name="Robots, paths, swept floor, shares",
        contents=[*worlds, f"/{entities.FLEET_SHARES}", f"/{entities.FLEET_TWICE}"],
        eye_controls=eye_above(bounds, MAP_ASPECT),
        line_grid=False,
        background=MAP_BACKGROUND,
        overrides=trails,
    )
    states = rrb.StateTimelineView(origin="/", name="States", contents=each("state"))
    card = rrb.TextDocumentView(origin=f"/{entities.RUN_CARD}", name="Who does what")
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(map_view, rrb.Horizontal(states, log_view()), row_shares=[5, 2]),
            rrb.Vertical(
                card,
                plot("Swept [m2]", "swept_m2"),
                plot("Cells left, as each knows", "left_cells"),
                row_shares=[5, 4, 3],
            ),
            column_shares=[18, 10],
        ),
        rrb.TimePanel(state="collapsed", timeline=entities.WALL_CLOCK),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


LEGEND = """\
- **Tint** swept by the robot of that colour, **pale** its share of what is left, **grey** by two
- **Line** bright its path, dark where it drove"""


def card_of(title: str, members: ObservedFleet, states: Mapping[str, str], survey: Survey) -> str:
    """Return the card as Markdown; ``states``: the robots' states, by name."""
    twice_m2, rows, swept_m2 = survey.twice_m2, [], 0.0
    for member in members:
        cell_m2, waits_for = member.seat.cell_m**2, member.newest.waits_for
        robot_m2 = member.swept.count * cell_m2
        swept_m2 += robot_m2
        state = f"waits for {waits_for}" if waits_for else states[member.name]
        colour, _ = palette.robot(member.number)
        left_m2 = survey.left[member.name] * cell_m2
        rows.append((member.name, colour, state, f"{robot_m2:.1f}", f"{left_m2:.1f}"))
    heading = (
        f"**{markdown_cell(title)}**: {swept_m2 - twice_m2:.1f} m2 swept, {twice_m2:.1f} by two"
    )
    lines = [heading, "", "| robot | colour | state | swept m2 | left to it m2 |"]
    lines += [
        "|---|---|---|---|---|",
        *(f"| {' | '.join(map(markdown_cell, row))} |" for row in rows),
    ]
    return "\n".join(lines) + f"\n\n{LEGEND}\n"
