"""What a stranger sees on the screen."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
from rich.cells import cell_len
from rich.color import ColorSystem
from rich.console import Console
from rich.text import Text

from fasaco_edge.client.robot_state import Token
from fasaco_edge.watch.glyphs import GlyphSet, ScreenBlocks
from fasaco_edge.watch.page import Page
from fasaco_edge.watch.picture import COVERED, HEADING, TO_COVER, WALL, RobotView
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.documents.rooms import RoomReport, Rooms
from tests.support.statuses import extreme_statuses
from tests.watch.grids import NOW, console, mid_mission, plain, status, tell

SIZES = [(80, 24), (120, 40), (200, 60), (64, 14), (63, 13), (30, 10), (12, 4), (1, 1), (400, 5)]


def page_of(view: RobotView, width: int = 80, height: int = 24, colours: str | None = None) -> str:
    lines = Page(console(width, colours=colours)).lines(view, NOW, width, height)
    return "\n".join(plain(line) for line in lines)


def test_two_pixels_make_a_character():
    kinds = np.array([[WALL, WALL, COVERED], [WALL, COVERED, COVERED]], np.uint8)
    (line,) = GlyphSet(ColorSystem.TRUECOLOR).lines(kinds)
    wall, covered = "214;218;226", "24;112;82"
    assert line == (
        f"\x1b[38;2;{wall};48;2;{wall}m \x1b[0m"
        f"\x1b[38;2;{wall};48;2;{covered}m▀\x1b[0m"
        f"\x1b[38;2;{covered};48;2;{covered}m \x1b[0m"
    )


def test_fewer_colours_or_none_will_do():
    kinds = np.array([[WALL, 0, TO_COVER, HEADING + 2], [WALL, COVERED, 0, 0]], np.uint8)
    assert GlyphSet(None).lines(kinds) == ["#o-↑"]
    glyphs = GlyphSet.of(console(colours="256"))
    (line,) = glyphs.lines(np.array([[WALL], [COVERED]], np.uint8))
    assert "38;5;" in line
    assert "38;2" not in line
    assert GlyphSet.of(console(colours="standard")).colours is None


@pytest.mark.parametrize(("width", "height"), SIZES)
@pytest.mark.parametrize("colours", ["truecolor", "standard", None])
def test_a_page_fills_the_terminal_and_no_more(width, height, colours):
    lines = Page(console(width, colours=colours)).lines(mid_mission(), NOW, width, height)
    assert len(lines) == height
    assert {cell_len(plain(line)) for line in lines} == {width}


def test_the_robot_points_east_over_the_covered_lower_half():
    lines = page_of(mid_mission()).splitlines()[1:18]
    row = next(number for number, line in enumerate(lines) if "→" in line)
    column = lines[row].index("→")
    assert "*" in lines[row][column:]
    assert "o" not in lines[1][:45]
    assert "o" in lines[-4][:45]
    assert row > 8


ZONES = [
    {"name": "kitchen", "passes": 2, "pass": 1, "cells": 60, "covered": 15},
    {"name": "hall", "passes": 1, "pass": 0},
]
ORDER = {
    "ordered": "command", "stage": "covering", "zone": "kitchen", "pass": 1, "passes": 2,
    "pass_kind": "cross", "zones": ZONES, "keep_out": 3, "return_home": True,
    "unreached": {"cells": 5},
}  # fmt: skip
FLOOR = {
    "swept_m2": 9.0,
    "reachable_m2": 10.0,
    "left": [{"m2": 1.5, "reason": "too narrow"}, {"m2": 0.5, "reason": "in a keep-out zone"}],
    "out_of_reach": [{"m2": 2.5, "reason": "closed off"}],
}
MEMBERS = [
    {"name": "r2", "state": "covering", "heard_s": 0.4, "away": None, "swept_cells": 12},
    {"name": "r3", "state": "covering", "heard_s": 7.0, "away": "gone", "swept_cells": 1},
]
STOP = {"revision": 8, "reason": "paused by command"}
SAID = [
    (
        {},
        "25.0 %, 10 of 40 cells", "swept     1.4 m2", "to go     63 s, 30 steps",
        "COVERING  25.0 % of cells  path 7, 63 s to go", "path 7    map: 2 cells more",
        "everything reachable", "drive     0.25 m/s, 90 deg 1.93 s", "written 0.4 s ago", "errors",
        "the daemon is there", "path 7, 11 steps: map: 2 cells more", "┤ 1 m",
    ),
    (
        {"mission": ORDER},
        "10 of 40 cells of all floor", "zone kitchen, pass 1 of 2, cross",
        "kitchen   pass 1 of 2, 25.0 %: 15 of 60 cells", "hall      to come",
        "keep-out zones: 3, returns home", "5 cells, 0.0 m2",
    ),
    (
        {"floor": FLOOR},
        "swept     80.0 %: 8.0 of 10.0 m2", "1.5 m2 left: too narrow",
        "0.5 m2 left: in a keep-out zone", "2.5 m2 out of reach: closed off",
    ),
    (
        {"fleet": {"name": "hall", "division": 2, "part_cells": 40, "members": MEMBERS}},
        "hall: 40 cells are its part", "covering, 12 cells swept", "away (gone), 1 cell swept",
    ),
    (
        {"state": "paused", "reason": "paused by command", "path": STOP},
        "path 8    stop", "paused: paused by command",
    ),
    # While the map grows, the time to go is a minimum.
    (
        {"coverage": {"coverable": 60, "covered": 10}},
        "path 7, at least 63 s to go", "to go     at least 63 s, 30 steps",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("members", "said"), [(members, said) for members, *said in SAID])
def test_it_shows_what_a_status_says(members, said):
    view = mid_mission()
    if members:
        tell(view, "status", status(**members))
    page = page_of(view, 120, 40)
    for text in said:
        assert text in page, page


def test_a_trouble_that_is_the_reason_is_shown_once():
    view = mid_mission()
    lost = {"code": "no_pose", "text": "no pose for 3 s", "do": "look", "since_s": 4.0}
    tell(view, "status", status(state="degraded", reason=lost["text"], troubles=[lost]))
    page = page_of(view, 120, 40)
    assert "trouble   no pose for 3 s (for 4.0 s): look" in page
    assert "state     degraded:" not in page


@pytest.mark.parametrize(
    ("line_s", "scale", "said"),
    [(630.0, 1, "10 min"), (630.0, 20, "32 s"), (63.0, 20, "3.1 s"), (0.0, 0, ""), (63.0, 0, ""),
     (63.0, -1, ""), (63.0, 1e-9, ""), (1e15, 1, ""), (None, 1, "")],
)  # fmt: skip
def test_the_time_to_go_is_by_the_clock(line_s, scale, said):
    view = mid_mission()
    reported = {"revision": 7, "steps": 30, "remaining_steps": 30, "line_s": line_s}
    tell(view, "status", status(path=reported, config={"robot": {"time_scale": scale}}))
    page = page_of(view)
    assert (f"path 7, {said} to go" in page) == bool(said)
    assert f"to go     {said}{', ' if said else ''}30 steps" in page


def test_it_shows_rooms_with_their_swept_shares():
    view = mid_mission()
    hall = RoomReport(1, "hall", ((0, 0), (3, 0), (3, 4), (0, 4)), swept=0.459)
    nook = RoomReport(2, "\x1b[2J", ((3, 0), (6, 0), (6, 4), (3, 4)), skip=True)
    many = tuple(RoomReport(number, swept=1.0) for number in range(3, 20))
    far = RoomReport(40, "far", ((0, 0), (1e14, 0), (0, 1e14)), swept=1.0)
    tell(view, "rooms", encode_json(Rooms("map", 1, (hall, nook, *many, far))))
    tell(
        view,
        "status",
        status(mission={"left_out": ["nook"], "time_left_s": 750.0, "first_from": 60}),
    )
    page = page_of(view, 140, 60)
    assert "leaves out nook" in page
    assert "limit     home in 12 min 30 s, priority 60+ first" in page
    assert " hall 45 % " in page
    assert " 2 " in page  # a name that would control the terminal is none
    assert "hall 45.9 %" in page
    assert ", 8 more" in page
    # In a narrow picture names give way.
    assert " hall " not in page_of(view, 10, 8)


def test_a_daemon_that_is_gone_or_silent_is_named_so():
    view = mid_mission()
    silent = "\n".join(Page(console(colours=None)).lines(view, NOW + 60.0, 80, 24))
    assert "silent for 60 s" in silent
    view.take("token", Token("robot", here=False), NOW)
    assert "gone for 0.0 s; waiting for it to return" in page_of(view)
    view.take("token", Token("robot", here=True), NOW)
    assert "COVERING" in page_of(view)
    assert "the daemon is back" in page_of(view)


def test_before_anything_came_it_says_what_it_waits_for():
    view = RobotView("robot")
    view.take("token", Token("other", here=True), NOW)
    page = page_of(view)
    assert "waiting for a daemon of that name; on this bus: other" in page
    assert "no map" in page
    view.trouble = "refused"
    assert "waiting for the bus at refused" in page_of(view)


def test_texts_off_the_bus_do_not_control_the_terminal():
    view = mid_mission()
    evil = "\x1b[2J\x07\n[red]gone[/red]\u202e"
    mission = {"stage": evil, "zones": [{"name": evil}]}
    errors = {"total": 1, "last": evil, "by_code": {evil: 1}}
    tell(view, "status", status(state=evil, reason=evil, mission=mission, errors=errors))
    tell(
        view,
        "command",
        json.dumps({"command": evil, "order": {"zones": [{"name": evil}]}}).encode(),
    )
    lines = Page(console(colours=None)).lines(view, NOW, 80, 24)
    assert len(lines) == 24
    for line in lines:
        assert line.isprintable(), line
    assert "[red]gone[/red]" in "".join(lines)


def test_an_unchanged_page_is_not_drawn_again():
    page, view = Page(console()), mid_mission()
    first, second = (page.lines(view, NOW, 80, 24) for _ in range(2))
    assert first == second
    assert all(a is b for a, b in zip(first[18:22], second[18:22], strict=True))


def test_no_number_that_a_status_may_have_ends_the_page():
    view = mid_mission()
    for payload in extreme_statuses():
        tell(view, "status", payload)
        assert len(page_of(view, 120, 50).split("\n")) == 50


def test_a_block_says_how_many_rows_have_no_place():
    blocks = ScreenBlocks(Console(file=io.StringIO(), width=40))
    lines = [line.strip() for line in blocks.block(Text("a\nb\nc\nd"), 40, 3)]
    assert lines == ["a", "b", "2 more rows: enlarge the terminal"]
    assert [line.strip() for line in blocks.block(Text("a\nb"), 40, 3)] == ["a", "b", ""]
