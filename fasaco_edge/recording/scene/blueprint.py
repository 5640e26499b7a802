"""The blueprint of a recording, its layout in Rerun: a page for the mission, one for details."""

from __future__ import annotations

import math
from collections.abc import Sequence

from fasaco_edge.grid.geometry import Bounds
from fasaco_edge.recording import entities
from fasaco_edge.recording.scene.curves import COVERAGE, CURVES, DETAILS, Plot
from fasaco_edge.recording.sdk import rr, rrb

# Bounds of the view without a map [m].
NO_MAP: Bounds = (-5.0, -5.0, 5.0, 5.0)
# Space for the map to grow a little without a new view.
MARGIN = 1.1
# Rerun's vertical field of view, and the aspect ratios (width / height) of the spatial views in
# this layout at 1280 x 720.
FIELD_OF_VIEW_RAD = math.radians(55.0)
VIEW_ASPECT, PHEROMONE_ASPECT = 1.3, 2.2

MAP_BACKGROUND = [38, 41, 48]
PHEROMONE_BACKGROUND = [10, 10, 14]
# The path over the field: its colour, and its width [points], thin enough to see the field.
PATH_ON_FIELD, PATH_WIDTH = [255, 255, 255], 0.8


def build_blueprint(bounds: Bounds | None) -> rrb.Blueprint:
    """Return the layout; its spatial views show ``bounds`` (x_min, y_min, x_max, y_max) [m]."""
    bounds = bounds or NO_MAP
    states = rrb.StateTimelineView(origin="/state", name="States")
    card = rrb.TextDocumentView(origin=f"/{entities.RUN_CARD}", name="Run")
    return rrb.Blueprint(
        rrb.Tabs(
            rrb.Horizontal(
                rrb.Vertical(_map_view(bounds), states, row_shares=[9, 2]),
                rrb.Vertical(
                    _pheromone_view(bounds),
                    log_view(),
                    rrb.Horizontal(card, _curves_view(COVERAGE), column_shares=[3, 2]),
                    row_shares=[6, 3, 4],
                ),
                name="Mission",
            ),
            rrb.Grid(*map(_curves_view, DETAILS), grid_columns=2, name="Details"),
        ),
        rrb.TimePanel(state="collapsed", timeline=entities.WALL_CLOCK),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def _map_view(bounds: Bounds) -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        # The parent entity may lie too far away for float32.
        origin=f"/{entities.WORLD}",
        name="Map, swept floor, track and path",
        contents=["/world/**", f"- /{entities.PHEROMONE}/**"],
        eye_controls=eye_above(bounds, VIEW_ASPECT),
        line_grid=False,
        background=MAP_BACKGROUND,
        overrides={entities.DRIVEN_PATH: up_to_cursor()},
    )


def _pheromone_view(bounds: Bounds) -> rrb.Spatial3DView:
    thin_path = rr.LineStrips3D.from_fields(colors=[PATH_ON_FIELD], radii=[-PATH_WIDTH])
    return rrb.Spatial3DView(
        origin=f"/{entities.WORLD}",
        name="Pheromone that ants follow (bright: much), and the path of that time (white)",
        contents=[f"/{entities.PHEROMONE}/**", f"/{entities.PATH}", f"/{entities.ROBOT}/**"],
        eye_controls=eye_above(bounds, PHEROMONE_ASPECT),
        line_grid=False,
        background=PHEROMONE_BACKGROUND,
        overrides={entities.PATH: thin_path},
    )


def plot_view(plot: Plot, contents: Sequence[str]) -> rrb.TimeSeriesView:
    """Return a view of curves over the whole time."""
    axis = rrb.ScalarAxis(range=(0.0, plot.top)) if plot.top else None
    # The whole mission; Rerun's default is a minute.
    whole = rrb.TimeAxis(
        view_range=rr.TimeRange(
            start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.infinite()
        )
    )
    return rrb.TimeSeriesView(
        origin="/",
        contents=list(contents),
        name=plot.title,
        axis_x=whole,
        axis_y=axis,
        plot_legend=rrb.PlotLegend(plot.legend),
    )


def _curves_view(plot: Plot) -> rrb.TimeSeriesView:
    return plot_view(plot, [f"/{curve.entity}" for curve in CURVES if curve.plot is plot])


def log_view() -> rrb.TextLogView:
    """Return a view of all logs, without the lines of level DEBUG."""
    # The view is too narrow for a column of times; the cursor shows the time.
    columns = rrb.TextLogColumns(
        timeline_columns=[rrb.encodings.TimelineColumn(entities.WALL_CLOCK, visible=False)],
        text_log_columns=[rrb.encodings.TextLogColumn("Body")],
    )
    rows = rrb.TextLogRows(filter_by_log_level=["INFO", "WARN", "ERROR"])
    return rrb.TextLogView(origin="/log", name="Log", columns=columns, rows=rows)


def eye_above(bounds: Bounds, aspect: float) -> rrb.EyeControls3D:
    """Return a camera that looks down on ``bounds``, in a view of width / height ``aspect``."""
    x0, y0, x1, y1 = bounds
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    reach = max((y1 - y0) / 2, (x1 - x0) / 2 / aspect, 0.5)
    height = MARGIN * reach / math.tan(FIELD_OF_VIEW_RAD / 2)
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        # Exactly straight down, the camera's up axis would be undefined.
        position=[x, y - 1e-3 * height, height],
        look_target=[x, y, 0.0],
        eye_up=[0.0, 1.0, 0.0],
    )


def up_to_cursor(seconds: float | None = None) -> rrb.VisibleTimeRanges:
    """Return the range of the last ``seconds`` [s] before the cursor; None for all before it."""
    since = rrb.TimeRangeBoundary.infinite()
    if seconds is not None:
        since = rrb.TimeRangeBoundary.cursor_relative(seconds=-seconds)
    return rrb.VisibleTimeRanges(
        timeline=entities.WALL_CLOCK, start=since, end=rrb.TimeRangeBoundary.cursor_relative()
    )
