"""Table of a status's figures, beside the picture."""

from __future__ import annotations

from rich.table import Table
from rich.text import Text

from fasaco_edge.client import phrases
from fasaco_edge.states import row_of
from fasaco_edge.text import duration, one_line, percent
from fasaco_edge.watch.glyphs import GlyphSet
from fasaco_edge.wire.documents.path_documents import PathReport
from fasaco_edge.wire.documents.replies import FloorReport, MissionReport
from fasaco_edge.wire.documents.rooms import Rooms
from fasaco_edge.wire.documents.status import BatteryReport, FleetReport, Status, SupervisedRecorder
from fasaco_edge.wire.reasons import plain

Row = tuple[str, Text]
# Rich's names of the colours of states that it names otherwise.
SHADES = {"grey": "bright_black", "violet": "magenta", "amber": "yellow"}
LONGEST_BAR = 40
LABEL_WIDTH = 9
# Largest number of rooms shown.
MOST_ROOMS = 12


def figures(status: Status, rooms: Rooms, to_go: str, width: int, glyphs: GlyphSet) -> Table:
    """Return all figures of a status, and of rooms, as a table ``width`` characters wide.

    ``to_go``: the time that the rest of the path takes, in words.
    """
    table = Table.grid(padding=(0, 1), pad_edge=False)
    table.add_column(width=LABEL_WIDTH, style="cyan", no_wrap=True)
    table.add_column(overflow="fold")
    table.width = width
    for name, value in _rows(status, rooms, to_go, width - LABEL_WIDTH - 1, glyphs):
        table.add_row(name, value)
    return table


def _rows(status: Status, rooms: Rooms, to_go: str, width: int, glyphs: GlyphSet) -> list[Row]:
    state = Text(one_line(status.state), f"bold {state_colour(status.state)}")
    if reason := phrases.reason(status):
        state.append(f": {reason}", "not bold")
    rows: list[Row] = [("state", state)]
    rows += [
        ("trouble", _text(f"{what}: {to_do}", "red")) for what, to_do in phrases.troubles(status)
    ]
    if status.coverage is not None:
        bar = glyphs.bar(status.coverage.fraction, min(width, LONGEST_BAR))
        coverage, of_all = status.coverage, " of all floor" if status.mission.zones else ""
        share = Text(percent(coverage.fraction), "bold")
        share.append(f", {coverage.covered} of {coverage.coverable} cells{of_all}", "not bold")
        rows += [("covered", share), ("", bar)]
    if status.path is not None:
        rows += _path(status.path, to_go)
    if status.coverage is not None and status.coverage.recovered:
        rows.append(("twice", _text(_cells(status.coverage.recovered))))
    if status.floor is not None:
        rows += _floor(status.floor)
    rows += _mission(status.mission)
    rows += _rooms(rooms)
    rows += _fleet(status.fleet)
    rows += _running(status)
    return rows


def state_colour(state: str) -> str:
    colour = row_of(state).colour
    return SHADES.get(colour, colour)


def _floor(floor: FloorReport) -> list[Row]:
    left = [f"{left.m2:.1f} m2 left: {left.reason}" for left in floor.left or ()]
    beyond = [f"{part.m2:.1f} m2 out of reach: {part.reason}" for part in floor.out_of_reach or ()]
    rows = [("", _text(each)) for each in (*left, *beyond)]
    return [("swept", _text(phrases.swept(floor))), *rows]


def _path(path: PathReport, time: str) -> list[Row]:
    number = f"path {path.revision}"
    if not path.steps:
        return [(number, _text("stop")), ("", _text(plain(path.reason)))]
    steps = f"{path.remaining_steps} steps"
    to_go = f"{time}, {steps}" if time else steps
    return [("to go", _text(to_go)), (number, _text(plain(path.reason)))]


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
    if mission.left_out:
        more.append(f"leaves out {', '.join(mission.left_out)}")
    if more:
        rows.append(("", _text(", ".join(more))))
    limit = []
    if mission.time_left_s is not None:
        limit.append(f"home in {duration(mission.time_left_s)}")
    if mission.first_from is not None:
        limit.append(f"priority {mission.first_from}+ first")
    if limit:
        rows.append(("limit", _text(", ".join(limit))))
    if mission.unreached.cells:
        left = f"{_cells(mission.unreached.cells)}, {mission.unreached.m2:.1f} m2"
        rows.append(("unreached", _text(left)))
    return rows


def _rooms(found: Rooms) -> list[Row]:
    """Return the swept share of each room; of more than MOST_ROOMS, unfinished rooms first."""
    known = sorted(found.rooms, key=lambda room: (room.swept == 1.0, room.swept is None))
    shown = sorted(known[:MOST_ROOMS], key=lambda room: room.id)
    parts = [
        room.title if room.swept is None else f"{room.title} {percent(room.swept)}"
        for room in shown
    ]
    more = len(known) - len(shown)
    text = ", ".join(parts) + (f", {more} more" if more else "")
    return [("rooms", _text(text))] if parts else []


def _fleet(fleet: FleetReport | None) -> list[Row]:
    if fleet is None:
        return []
    part = "alone" if fleet.part_cells is None else f"{_cells(fleet.part_cells)} are its part"
    rows: list[Row] = [("fleet", _text(f"{fleet.name}: {part}"))]
    for member in fleet.members:
        swept = f"{_cells(member.swept_cells)} swept"
        what = f"away ({member.away}), {swept}" if member.away else f"{member.state}, {swept}"
        rows.append((one_line(member.name), _text(what, "yellow" if member.away else "")))
    return rows


def _running(status: Status) -> list[Row]:
    errors = status.errors
    counted = ", ".join(f"{count} {code}" for code, count in errors.by_code.items())
    return [
        ("drive", _text(phrases.drive(status.drive))),
        *([("battery", _battery(status.battery))] if status.battery else []),
        ("errors", _text(counted, "red") if errors.total else _text("none")),
        ("ledger", _ledger(status)),
        ("recorder", _recorder(status.recorder)),
        ("daemon", _text(f"up {phrases.age(status.uptime_s)}, {status.rss_mb:.0f} MB")),
    ]


def _battery(battery: BatteryReport) -> Text:
    level = "not known" if battery.level is None else percent(battery.level)
    is_low = None not in (battery.level, battery.turns_back_at) and (
        (battery.level or 0.0) <= (battery.turns_back_at or 0.0)
    )
    until = f", goes on at {percent(battery.goes_on_at)}" if battery.goes_on_at else ""
    return _text(f"{level}, {battery.power}{until}", "yellow" if is_low else "")


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
