"""The figures beside the picture: a row of name and value each, the most important first."""

from __future__ import annotations

from rich.table import Table
from rich.text import Text

from fasaco_edge.text import one_line
from fasaco_edge.watch import phrases
from fasaco_edge.watch.glyphs import GlyphSet
from fasaco_edge.wire.replies import CoverageReport, MissionReport
from fasaco_edge.wire.status import PathReport, Status, SupervisedRecorder

Row = tuple[str, Text]

# How a state is to be taken.
STATE_COLOURS = {
    "planning": "magenta",
    "covering": "green",
    "returning": "green",
    "paused": "yellow",
    "blocked": "red",
    "degraded": "yellow",
    "done": "blue",
}
LONGEST_BAR = 40
LABEL_WIDTH = 9
# From so many characters on optional parts are shown.
WIDE = 30


def figures(status: Status, width: int, glyphs: GlyphSet) -> Table:
    """Return all figures of a status as a table ``width`` characters wide."""
    table = Table.grid(padding=(0, 1), pad_edge=False)
    table.add_column(width=LABEL_WIDTH, style="cyan", no_wrap=True)
    table.add_column(overflow="fold")
    table.width = width
    for name, value in _rows(status, width - LABEL_WIDTH - 1, glyphs):
        table.add_row(name, value)
    return table


def _rows(status: Status, width: int, glyphs: GlyphSet) -> list[Row]:
    state = Text(one_line(status.state), f"bold {state_colour(status.state)}")
    # The path's number is shown with the path.
    if status.path is None or status.reason != f"path {status.path.revision}":
        state.append(f": {one_line(status.reason)}", "not bold")
    rows: list[Row] = [("state", state)]
    if status.coverage is not None:
        rows += _coverage(
            status.coverage, glyphs.bar(status.coverage.fraction, min(width, LONGEST_BAR))
        )
    if status.path is not None:
        rows += _path(status.path, width)
    rows += _mission(status.mission)
    rows += _running(status)
    return rows


def state_colour(state: str) -> str:
    """Return the colour of a state."""
    return STATE_COLOURS.get(state, "bright_black")


def _coverage(coverage: CoverageReport, bar: Text) -> list[Row]:
    share = Text(phrases.percent(coverage.fraction), "bold")
    share.append(f", {coverage.covered} of {coverage.coverable} cells", "not bold")
    areas = f"{coverage.covered_m2:.1f} m2, {coverage.to_cover_m2:.1f} m2 to go"
    rows: list[Row] = [("covered", share), ("", bar), ("", _text(areas))]
    if coverage.recovered:
        rows.append(("twice", _text(_cells(coverage.recovered))))
    return rows


def _path(path: PathReport, width: int) -> list[Row]:
    left = f"{path.remaining_steps} of {path.steps} steps to go" if path.steps else "stop"
    rows: list[Row] = [(f"path {path.revision}", _text(left)), ("", _text(path.reason))]
    if path.planned_steps is not None:
        plan = f"{path.planned_steps} steps"
        if path.lower_bound_steps is not None:
            plan += f", bound {path.lower_bound_steps}"
        if path.gap is not None and width >= WIDE:
            plan += f", gap {100 * path.gap:.1f} %"
        rows.append(("plan", _text(plan)))
    return rows


def _mission(mission: MissionReport) -> list[Row]:
    rows: list[Row] = [("mission", _text(phrases.stage(mission)))]
    for zone in mission.zones:
        at, covered = phrases.zone_progress(zone)
        progress = f"pass {at}, {covered}" if zone.pass_number else at
        rows.append((one_line(zone.name), _text(progress)))
    more = []
    if mission.keep_out:
        more.append(f"keep-out zones: {mission.keep_out}")
    if mission.return_home:
        more.append("returns home")
    if more:
        rows.append(("", _text(", ".join(more))))
    if mission.unreached.cells:
        left = f"{_cells(mission.unreached.cells)}, {mission.unreached.m2:.1f} m2"
        rows.append(("unreached", _text(left)))
    return rows


def _running(status: Status) -> list[Row]:
    latency, errors = status.latency_ms, status.errors
    latencies = [
        f"{name} {milliseconds:.0f}"
        for name, milliseconds in (
            ("plan", latency.plan),
            ("map to path", latency.map_to_path),
            ("map", latency.ingest),
        )
        if milliseconds is not None
    ]
    counted = ", ".join(f"{count} {code}" for code, count in errors.by_code.items())
    rows: list[Row] = [
        ("latency", _text(f"{', '.join(latencies)} ms" if latencies else "-")),
        ("errors", _text(counted, "red") if errors.total else _text("none")),
        ("ledger", _ledger(status)),
        ("recorder", _recorder(status.recorder)),
        ("daemon", _text(f"up {phrases.age(status.uptime_s)}, {status.rss_mb:.0f} MB")),
    ]
    return rows


def _ledger(status: Status) -> Text:
    ledger = status.ledger
    if ledger.fault:
        return _text(ledger.fault, "red")
    if ledger.age_s is None:
        return _text("not written yet")
    return _text(f"written {phrases.age(ledger.age_s)} ago")


def _recorder(recorder: SupervisedRecorder | None) -> Text:
    if recorder is None:
        return _text("none")
    if recorder.state in ("recording", "starting"):
        return _text(recorder.state)
    return _text(f"{recorder.state}: {recorder.reason or ''}", "red")


def _cells(count: int) -> str:
    return "1 cell" if count == 1 else f"{count} cells"


def _text(text: str, style: str = "") -> Text:
    return Text(one_line(text), style)
