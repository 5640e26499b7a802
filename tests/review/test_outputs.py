"""What a review writes: pictures, files; and what it says where it cannot."""

from __future__ import annotations

import csv
import io
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from PIL import Image

pytest.importorskip("rerun")

from rich.console import Console
from rich.text import Text

from fasaco_edge.cli import main
from fasaco_edge.cli.console import terminal
from fasaco_edge.cli.review.screen import print_review
from fasaco_edge.drawing import palette
from fasaco_edge.grid.geometry import FARTHEST_M, Pose2D
from fasaco_edge.grid.occupancy import OccupancyGrid
from fasaco_edge.review.conversion import FLOOR, document_of
from fasaco_edge.review.moments import Span
from fasaco_edge.review.output import pictures
from fasaco_edge.review.output.export import export
from fasaco_edge.review.output.pictures import draw_review
from fasaco_edge.review.output.rows import charge_rows, screen_rows
from fasaco_edge.review.review import read_review, review_of
from fasaco_edge.review.run_data import StatusSample
from fasaco_edge.review.spot import explain
from fasaco_edge.wire.documents.replies import (
    CoverageReport,
    FloorLeft,
    FloorReport,
    MissionReport,
    ZoneReport,
)
from fasaco_edge.wire.documents.status import BatteryReport, LedgerReport, Status
from tests.review.test_parts import run_told
from tests.support.processes import ENVIRONMENT, PROGRAM, fasaco_edge
from tests.support.reviews import document

TABLES = (*("trail", "paths", "path_points", "states", "coverage", "plots", "pheromone"),)
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    return run_told(tmp_path_factory.mktemp("one") / "runs", faults={"<odd>": 2})


@pytest.fixture(scope="module")
def review(parts):
    return read_review(parts)


def test_a_line_over_the_floor_is_drawn_by_what_it_sweeps(review):
    """Its track passes beside the centres of cells that the daemon counts as covered."""
    cells = {colour for _, colour in draw_review([review]).getcolors(maxcolors=1 << 20)}
    assert {palette.OCCUPIED, palette.COVERED, palette.REVISITED[0], palette.START} <= cells
    assert palette.UNSWEPT in cells
    config = {**review.data.config, "planner": {"line": "thorough"}}
    line = replace(review, data=replace(review.data, config=config))
    colours = {colour for _, colour in draw_review([line]).getcolors(maxcolors=1 << 20)}
    assert {palette.COVERED, palette.UNSWEPT} <= colours
    assert not {palette.LEFT_OUT, *palette.REVISITED} & colours


def test_floor_that_others_of_its_fleet_swept_is_not_left(review):
    left = review.floor.unswept
    fleet = replace(review.data, config={**review.data.config, "fleet": {"name": "house"}})
    half = left & (np.arange(left.shape[1]) < left.shape[1] // 2)
    shared = review_of(review.record, fleet, 0, lambda *_: half.copy())
    told, pixel_m2 = document_of(shared), review.floor.geometry.resolution**2
    assert told.swept_by_others_m2 == pytest.approx(half.sum() * pixel_m2, abs=0.01)
    assert told.reachable_m2 == pytest.approx(
        document_of(review).reachable_m2 - told.swept_by_others_m2, abs=0.01
    )
    assert (shared.floor.unswept == left & ~half).all()
    row, col = np.argwhere(half)[len(np.argwhere(half)) // 2].tolist()
    (spot,) = explain(shared, [review.floor.geometry.to_map(col + 0.5, row + 0.5)])
    assert (spot.why, spot.swept) == ("swept by others", False)
    assert "more swept by other robots" in dict(screen_rows(shared, told))["by others"]
    colours = {colour for _, colour in draw_review([shared]).getcolors(maxcolors=1 << 20)}
    assert {palette.BY_OTHERS, palette.UNSWEPT} <= colours
    # An older recording does not say where.
    unknown = review_of(review.record, fleet, 0)
    assert document_of(unknown).not_recorded["swept_by_others_m2"]
    assert "counts as left" in dict(screen_rows(unknown, document_of(unknown)))["by others"]


@pytest.mark.parametrize(("height", "fits"), [(60, True), (14, False)])
def test_on_a_low_terminal_it_says_how_many_rows_are_left_out(review, monkeypatch, height, fits):
    shown = io.StringIO()
    console = Console(file=shown, force_terminal=True, width=80, height=height)
    monkeypatch.setattr(terminal, "out", lambda: console)
    print_review(review, document_of(review), full=False)
    lines = shown.getvalue().splitlines()
    # The prompt takes the last line.
    assert len(lines) < height
    found = re.match(r"(\d+) more rows?: --long", Text.from_ansi(lines[-1]).plain)
    assert (found is None) == fits
    names = [name for name, _ in screen_rows(review, document_of(review))]
    told = [Text.from_ansi(line).plain.split("  ")[0] for line in lines]
    missing = [name for name in names if name not in told]
    assert missing == names[len(names) - (int(found[1]) if found else 0) :]


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"grid": None}, "there is no map"),
        ({"config": {}}, "there is no configuration"),
        ({"origin": Pose2D(FARTHEST_M, 0.0)}, "reaches beyond"),
        ({"resolution": 1e3}, "exceeds"),
    ],
)
def test_a_map_without_a_lattice_is_named(review, changes, why):
    data = review.data
    if changes.keys() <= {"grid", "config"}:
        data = replace(data, **changes)
    else:
        geometry = replace(data.grid.geometry, **changes)
        data = replace(data, grid=OccupancyGrid(geometry, data.grid.cells))
    without = review_of(review.record, data, 0)
    assert without.lattice is None
    assert draw_review([without]) is None
    told = document(without)
    assert told["swept_m2"] is None
    assert why in told["not_recorded"][FLOOR]


def zone(cells, covered):
    return ZoneReport(cells=cells, covered=covered)


@pytest.mark.parametrize(
    ("state", "covered", "zones", "complete"),
    [
        ("done", 24, (), True),
        ("done", 23, (), False),
        ("covering", 24, (), False),
        ("done", 10, (zone(4, 4), zone(2, 2)), True),
        ("done", 10, (zone(4, 4), zone(2, 1)), False),
        ("", 24, (), None),
    ],
)
def test_complete_is_done_and_nothing_left_over(review, state, covered, zones, complete):
    count = CoverageReport(24, covered)
    last = StatusSample(0.0, Status(mission=MissionReport(zones=zones), coverage=count))
    told = replace(
        review,
        data=replace(review.data, statuses=[last]),
        # A daemon that is ended after the mission says nothing any more.
        states=(Span(state, 0, 1), Span("silent", 1, 2)) if state else (),
    )
    assert told.complete is complete


def test_floor_swept_before_the_recording_is_not_estimated(review):
    before = StatusSample(0.0, Status(ledger=LedgerReport(restored_cells=7)))
    data = replace(review.data, statuses=[before, *review.data.statuses])
    told = document(review_of(review.record, data, 0))
    assert told["swept_m2"] is None
    assert "7 cells were covered before" in told["not_recorded"][FLOOR]
    caption = pictures._caption(review_of(review.record, data, 0))
    assert "7 cells were covered before: the recording does not show which" in caption


def test_floor_of_a_cancelled_order_is_what_was_swept(review):
    """After a cancel no floor has to be swept: the last report says 0 of 0 m2."""
    counted = FloorReport(swept_m2=3.0, reachable_m2=9.0, left=(FloorLeft(6.0, "on the path"),))
    over = FloorReport(swept_m2=3.5, reachable_m2=0.0, left=())
    restored = LedgerReport(restored_cells=7)
    kitchen = MissionReport("command", zones=(ZoneReport("kitchen", 1, 1, 9, 3),))
    floors = [
        StatusSample(at_s, Status(state=state, floor=floor, ledger=restored, mission=mission))
        for at_s, state, floor, mission in (
            (1.0, "covering", counted, kitchen),
            (2.0, "idle", over, MissionReport()),
        )
    ]
    data = replace(review.data, statuses=[*review.data.statuses, *floors])
    cancelled = review_of(review.record, data, 0)
    document = document_of(cancelled)
    assert dict(screen_rows(cancelled, document))["floor swept"].startswith("3.5 m2, by the daemon")
    assert document.left_by_reason == {"on the path": 6.0}


def test_a_screen_says_how_long_each_state_lasted(review):
    document = document_of(replace(review, states=(Span("paused", 0, 9), Span("covering", 9, 70))))
    assert dict(screen_rows(review, document))["time"] == "covering 1:01.0, paused 0:09.0"


def test_troubles_of_the_recorder_are_reported(review):
    states = (Span("recording", 0, 2), Span("disk full", 2, 5, "less than 50 MB are free"))
    told = document(replace(review, recorder_states=states))
    assert {
        "state": "recorder: disk full",
        "reason": "less than 50 MB are free",
        "at_s": 2,
        "seconds": 3,
    } in told["troubles"]


def test_texts_of_a_recording_do_nothing_to_a_terminal(review, capsys):
    told = document_of(review)
    told.robot, told.remarks = "[/red] \x1b]0;title\x07", ["[/]\x1b[2J"]
    print_review(review, told, full=True)
    out = capsys.readouterr().out
    assert "\x1b" not in out
    assert "[/red]" in out
    assert r"[/]\x1b[2J" in out


def test_a_text_like_a_formula_is_exported_as_text(review, tmp_path):
    names = ("=1+1", "+1+1", "-1+1", "@sum", "-1.5e-3", "a\nb", "ok")
    states = tuple(Span(name, 0, 1, name) for name in names)
    export(replace(review, states=states), tmp_path)
    with (tmp_path / "states.csv").open(encoding="utf-8", newline="") as file:
        told = [row["state"] for row in csv.DictReader(file)]
    assert told == ["'=1+1", "'+1+1", "'-1+1", "'@sum", "-1.5e-3", "a\\nb", "ok"]


def test_a_terminal_with_few_characters_shows_everything(parts, tmp_path):
    """The curve is of ASCII there, and what a name has besides is escaped."""
    odd = shutil.copytree(parts[0].parent, tmp_path / "räum\u2192")
    words = [*PROGRAM, "review", "--long", *map(str, odd.glob("*.rrd"))]
    for command, encoding in ((words, "ascii"), ([*words, "--json"], "latin-1")):
        env = ENVIRONMENT | {"PYTHONIOENCODING": encoding}
        ended = subprocess.run(command, check=False, capture_output=True, env=env)
        assert ended.returncode == 0, ended.stderr
        if encoding == "ascii":
            told = ended.stdout.decode(encoding)
            assert "Coverage over time" in told
            assert "##" in told
            assert "\\u25" not in told


def test_the_command_writes_them(parts, tmp_path):
    picture, folder = tmp_path / "a.png", tmp_path / "files"
    ended = fasaco_edge("review", *parts, "--png", picture, "--export", folder, "--json")
    assert ended.code == 0, ended.err
    with Image.open(picture) as image:
        assert image.width > 300
    names = {file.name for file in folder.iterdir()}
    told = dict(line.split(maxsplit=1) for line in ended.err.splitlines() if str(folder) in line)
    assert set(told) == {str(folder / name) for name in names}
    assert told[str(folder / "trail.csv")] == "a row is a pose of the robot"
    assert names == {*(f"{name}.csv" for name in (*TABLES, "columns")), "end.npz"}


def test_exported_files_hold_what_was_driven(parts, tmp_path):
    review = read_review(parts)
    export(review, tmp_path)
    with (tmp_path / "columns.csv").open(encoding="utf-8") as file:
        described = {(row["file"], row["column"]) for row in csv.DictReader(file)}
    for name in TABLES:
        with (tmp_path / f"{name}.csv").open(encoding="utf-8", newline="") as file:
            assert {(f"{name}.csv", column) for column in next(csv.reader(file))} <= described
    with (tmp_path / "path_points.csv").open(encoding="utf-8") as file:
        points = list(csv.DictReader(file))
    revisions = {str(path.about.revision) for path in review.data.paths}
    assert {row["revision"] for row in points} <= revisions
    assert [row["number"] for row in points][:2] == ["0", "1"]
    with (tmp_path / "trail.csv").open(encoding="utf-8") as file:
        trail = list(csv.DictReader(file))
    assert [float(row["x_m"]) for row in trail] == [0.45, 0.75, 1.05, 1.35, 1.05, 0.75]
    with (tmp_path / "paths.csv").open(encoding="utf-8") as file:
        paths = list(csv.DictReader(file))
    assert [row["reason"] for row in paths][2] == "path blocked at cell (1, 2)"
    assert paths[-1]["plan_ms"] == ""
    with np.load(tmp_path / "end.npz") as arrays:
        assert arrays["map"].shape == (36, 48)
        row0, col0 = arrays["lattice_corner"]
        visits = arrays["visits"]
        assert visits[1 - row0, 1 - col0 : 5 - col0].tolist() == [1, 2, 2, 1]
        assert visits.sum() == 6
        swept_m2 = arrays["swept"].sum() * arrays["floor_resolution_m"] ** 2
        assert swept_m2 == pytest.approx(review.floor.figures.swept_m2, abs=0.01)
        assert (arrays["swept"] <= arrays["reachable"]).all()


def test_each_time_it_charged_is_a_line(parts):
    review = read_review(parts)
    since = review.duration_s
    spans = (Span("charging", since, since + 60.0, "battery"), Span("covering", since + 60.0, 99.0))
    levels = [(since - 1.0, 0.14), (since + 59.0, 0.9)]
    told = [StatusSample(at_s, Status(battery=BatteryReport(level))) for at_s, level in levels]
    data = replace(review.data, statuses=[*review.data.statuses, *told])
    found = document_of(replace(review, states=(*review.states, *spans), data=data))
    assert [row[1:] for row in charge_rows(found)] == [("1:00.0", "14 % to 90 %")]
    assert "14 % to 90 %" in dict(screen_rows(review, found))["charges"]


@pytest.mark.parametrize(
    ("option", "name", "code", "said"),
    [
        ("--png", "/dev/full", 1, "cannot write /dev/full: No space left on device"),
        ("--png", "none/a.png", 78, "there is no folder"),
        ("--export", "file", 78, "cannot write"),
    ],
)
def test_a_file_that_cannot_be_written_is_named(parts, tmp_path, capsys, option, name, code, said):
    (tmp_path / "file").touch()
    assert main(["review", *map(str, parts), option, str(tmp_path / name)]) == code
    assert said in capsys.readouterr().err


def test_an_answer_takes_no_option_of_the_report(parts, tmp_path, capsys):
    words = ["review", *map(str, parts), "--point", "1,1", "--export", str(tmp_path / "tables")]
    assert main(words) == 78
    assert "--export does not go with --point" in capsys.readouterr().err


def test_shares_that_were_never_reached_are_left_out(parts):
    review = read_review(parts)
    reached_s = {"50": 60.0, "90": None, "99": None, "100": None}
    found = msgspec.structs.replace(document_of(review), reached_s=reached_s)
    assert dict(screen_rows(review, found))["cells after"] == "50 % 1:00.0"
