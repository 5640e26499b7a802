"""How a recording opens: the field large, figures on the right, the course below."""

from __future__ import annotations

import math

from fasaco_edge.recording import entities
from fasaco_edge.recording.sdk import rrb

Bounds = tuple[float, float, float, float]

# Before there is a map [m].
NO_MAP: Bounds = (-5.0, -5.0, 5.0, 5.0)
# Room for the map to grow a little before the eye moves.
MARGIN = 1.1
# Rerun's vertical field of view, and the shape (width / height) that a spatial view has
# in this layout at 1280 x 720.
FIELD_OF_VIEW_RAD = math.radians(55.0)
VIEW_ASPECT = 1.0
COLUMNS = [5, 5, 4]
TRAIL_S = 30.0
CHANGE_S = 4.0

MAP_BACKGROUND = [38, 41, 48]
PHEROMONE_BACKGROUND = [10, 10, 14]


def build_blueprint(bounds: Bounds | None) -> rrb.Blueprint:
    """Return the layout, its eyes over ``bounds`` (x_min, y_min, x_max, y_max) [m]."""
    bounds = bounds or NO_MAP
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(
                _map_view(bounds), _pheromone_view(bounds), _figures(), column_shares=COLUMNS
            ),
            rrb.Horizontal(_states(), _log(), _card(), column_shares=COLUMNS),
            row_shares=[5, 2],
        ),
        rrb.TimePanel(state="collapsed", timeline=entities.WALL),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def _map_view(bounds: Bounds) -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        origin="/",
        name="Map, coverage and path",
        contents=["/world/**", f"- /{entities.PHEROMONE}/**"],
        eye_controls=_eye_above(bounds),
        line_grid=False,
        background=MAP_BACKGROUND,
        overrides={entities.TRAIL: _last(TRAIL_S), entities.MAP_CHANGE: _last(CHANGE_S)},
    )


def _pheromone_view(bounds: Bounds) -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        origin="/",
        name="Pheromone",
        contents=[f"/{entities.PHEROMONE}/**", f"/{entities.ROBOT}/**"],
        eye_controls=_eye_above(bounds),
        line_grid=False,
        background=PHEROMONE_BACKGROUND,
    )


def _figures() -> rrb.Vertical:
    corner = rrb.PlotLegend(rrb.Corner2D.LeftTop)
    return rrb.Vertical(
        rrb.TimeSeriesView(
            origin="/metrics/coverage",
            name="Coverage [fraction]",
            axis_y=rrb.ScalarAxis(range=(0.0, 1.0)),
            plot_legend=corner,
        ),
        rrb.TimeSeriesView(origin=f"/{entities.LATENCY}", name="Latency [ms]", plot_legend=corner),
        rrb.TimeSeriesView(
            origin="/metrics/colony",
            name="Colony: best walk so far [steps]",
            plot_legend=rrb.PlotLegend(visible=False),
        ),
    )


def _states() -> rrb.StateTimelineView:
    return rrb.StateTimelineView(origin="/state", name="States")


def _log() -> rrb.TextLogView:
    columns = [rrb.encodings.TextLogColumn(kind) for kind in ("LogLevel", "Body")]
    return rrb.TextLogView(
        origin="/log", name="Log", columns=rrb.TextLogColumns(text_log_columns=columns)
    )


def _card() -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin=f"/{entities.RUN_CARD}", name="Run")


def _eye_above(bounds: Bounds) -> rrb.EyeControls3D:
    x0, y0, x1, y1 = bounds
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    reach = max((y1 - y0) / 2, (x1 - x0) / 2 / VIEW_ASPECT, 0.5)
    height = MARGIN * reach / math.tan(FIELD_OF_VIEW_RAD / 2)
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        # Straight down the eye's up axis would be undefined.
        position=[x, y - 1e-3 * height, height],
        look_target=[x, y, 0.0],
        eye_up=[0.0, 1.0, 0.0],
    )


def _last(seconds: float) -> rrb.VisibleTimeRanges:
    return rrb.VisibleTimeRanges(
        timeline=entities.WALL,
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-seconds),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
