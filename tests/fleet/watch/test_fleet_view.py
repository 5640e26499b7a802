"""What is known of a fleet by what its robots tell, whatever one of them sends."""

from __future__ import annotations

import json
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fasaco_edge.client.phrases import KEPT
from fasaco_edge.fleet.observer.observed import GONE_NS, MOST_MEMBERS
from fasaco_edge.fleet.observer.survey import MOST_STEPS
from fasaco_edge.fleet.watch import view as fleet_view
from fasaco_edge.fleet.watch.view import LONGEST, MOST_FAULTS, MOST_FLEETS, FleetView
from fasaco_edge.wire.documents.fleet import CellTile, FleetPart
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.limits import MAX_FLEET_PARTS, MAX_FLEET_TILES
from tests.fleet.told import member
from tests.fleet.watch.fleets import PARTS, say, tell, two_in_a_hall
from tests.watch.grids import NOW, status

GONE_S = 1e-9 * GONE_NS + 0.1
HALL = 20 * 30


@pytest.fixture(autouse=True)
def _at_once(monkeypatch):
    """The floor is made again as often as it changes."""
    monkeypatch.setattr(fleet_view, "LEAST_AGE_S", 0.0)
    monkeypatch.setattr(fleet_view, "LEAST_REST", 0.0)


def texts(view):
    return [entry.text for entry in view.events.entries]


def test_it_tells_who_does_what():
    view = two_in_a_hall()
    document = view.document(NOW)
    json.dumps(document, allow_nan=False)
    a, b = document.pop("robots")
    # Each cell counts once.
    assert document == {
        "fleet": "house", "at_work": 2, "division": 7, "cells": HALL, "swept_cells": 6,
        "swept_twice_cells": 1, "swept_m2": 0.54, "fraction": 0.01, "unheard": [],
    }  # fmt: skip
    assert b | {"part_cells": 0} == {
        "name": "b", "state": "covering", "x": 8.3, "y": 5.2, "waits_for": "a", "away": None,
        "division": 7, "swept_cells": 3, "swept_m2": 0.27, "part_cells": 0, "path": None,
    }  # fmt: skip
    # Cells that are swept are no part of what is left.
    assert a["part_cells"] + b["part_cells"] == HALL - 6
    assert abs(a["part_cells"] - b["part_cells"]) <= 20
    assert {robot.name: robot.doing for robot in view.robots(NOW)} == {
        "a": "covering",
        "b": "waits for a",
    }
    assert texts(view) == [
        "division 7 by b, 2 parts",
        "a joined: covering",
        "b joined: waits for a",
    ]


def test_each_change_is_one_event():
    view = two_in_a_hall()
    for seconds in range(1, 4):
        now = NOW + seconds
        say(view, "a", now, state="blocked", division=8, by="a", parts=PARTS)
        say(view, "b", now, state="done")
        view.tick(now)
    assert texts(view)[3:] == ["division 8 by a, 2 parts", "a: blocked", "b: done"]


def test_a_silent_robot_is_gone_until_its_next_message():
    view = two_in_a_hall()
    later = NOW + GONE_S
    say(view, "a", later)
    view.tick(later)
    a, b = view.robots(later)
    assert (a.silent_s, b.silent_s) == (None, pytest.approx(GONE_S))
    assert (a.is_at_work, b.is_at_work) == (True, False)
    # What it has swept stays.
    assert b.swept_cells == 3
    say(view, "b", later + 2.0)
    view.tick(later + 2.0)
    assert texts(view)[-2:] == ["b is gone: no messages from it", "b is back: covering"]


def test_places_are_in_the_frame_of_the_fleet():
    view = FleetView("house")
    # Its map lies 10 m to the east, turned by a quarter.
    say(view, "a", x=1.0, y=0.5, origin=(10.0, 0.0, 90.0), cells=[(0, 0)])
    (a,) = view.document(NOW)["robots"]
    assert (a["x"], a["y"]) == (9.5, 1.0)
    say(view, "a", NOW + 1, origin=(0.0, 0.0, 0.0))
    assert "its frame has changed" in texts(view)[-1]


def test_a_robot_that_others_leave_out_is_shown_as_such():
    view = two_in_a_hall()
    others = [
        {"name": "b", "away": "stands", "heard_s": 0.5},
        {"name": "c", "away": "gone", "heard_s": 20.0},
        {"name": "long-gone", "away": "gone", "heard_s": 9000.0},
        {"name": "no name\x1b", "away": "gone", "heard_s": 20.0},
    ]
    tell(view, "a", "status", status(fleet={"name": "house", "members": others}))
    a, b = view.robots(NOW)
    assert (a.away, b.away) == ("", "stands")
    assert a.revision == 7
    assert view.unheard(NOW) == ["c"]
    assert view.unheard(NOW + GONE_S) == []


def test_a_second_daemon_of_a_name_tells_nothing():
    view = two_in_a_hall()
    tell(view, "a", "status", status(claim={"id": "2f", "stand": "waits"}))
    assert view.robots(NOW)[0].revision is None


def test_other_fleets_are_named_while_this_one_is_absent():
    view = FleetView("house")
    for number in range(2 * MOST_FLEETS):
        say(view, f"r{number}", fleet=f"yard{number:03}\x1b[2J")
    assert len(view.others) == MOST_FLEETS
    assert min(view.others) == r"yard000\x1b[2J"
    assert view.robots(NOW) == []


def test_there_is_room_for_as_many_robots_as_a_fleet_has():
    view = FleetView("house")
    for number in range(MOST_MEMBERS + 7):
        say(view, f"r{number:02}")
        tell(view, f"r{number:02}", "status", status())
    view.tick(NOW)
    assert [robot.revision for robot in view.robots(NOW)] == [7] * MOST_MEMBERS
    assert f"{MOST_MEMBERS} robots of a fleet" in texts(view)[0]


def test_a_robot_that_jumps_on_and_off_does_not_fill_the_log():
    view = two_in_a_hall()
    count = view.events.count
    for tenth in range(1, 300):
        now = NOW + 0.1 * tenth
        say(view, "a", now, state=f"state {tenth}", origin=(float(tenth % 2), 0.0, 0.0))
        say(view, "b", now)
        view.tick(now)
    # Its states once a second, its frames ever more seldom.
    assert view.events.count - count < 45


@pytest.mark.parametrize(
    ("topic", "payload"),
    [
        ("fleet", b""), ("fleet", b"\xff"), ("fleet", b"[" * 100_000), ("fleet", b'{"version": 1}'),
        ("fleet", b'{"version": 2, "fleet": "house"}'),
        ("status", b"[]"), ("status", b"\xff"), ("fleet", b" " * 2_000_000),
    ],
)  # fmt: skip
def test_an_unreadable_sample_changes_nothing_else(topic, payload):
    view = two_in_a_hall()
    before = view.document(NOW)
    for _ in range(9):
        tell(view, "a", topic, payload)
        tell(view, "stranger", topic, payload)
        view.tick(NOW)
    assert view.document(NOW) == before
    told = [text for text in texts(view) if "cannot be read" in text and text.startswith("a: ")]
    assert len(told) == 4
    assert told[-1].endswith("(8 so far)")


def test_unknown_names_take_no_memory():
    view = two_in_a_hall()
    for number in range(2000):
        tell(view, f"r{number}", "fleet", b"no message")
        say(view, f"r{number}", fleet="yard")
    assert len(view._faults) <= MOST_FAULTS
    assert len(view._seen) == 2
    assert len(view.events.entries) < KEPT


def test_texts_of_robots_are_short_and_do_nothing():
    view = FleetView("house")
    evil = "\x1b[2J\n\u202e" + "x" * 250
    say(view, "a", state=evil, waits_for=evil, by=evil, division=1)
    tell(view, "a", "status", status(fleet={"members": [{"name": "a", "away": evil}]}))
    view.tick(NOW)
    (a,) = view.robots(NOW)
    for text in (a.state, a.waits_for, a.away, *texts(view)):
        assert text.isprintable()
        assert len(text) <= 2 * LONGEST


def test_the_largest_maze_takes_a_moment_only():
    """A serpentine: a step further for each of a million cells."""
    view = FleetView("house")
    edge = 22
    maze = np.zeros((64 * edge, 64 * edge), np.bool_)
    maze[::2] = True
    maze[1::4, -1] = maze[3::4, 0] = True
    blocks = maze.reshape(edge, 64, edge, 64).swapaxes(1, 2)
    said = [
        CellTile(row, col, np.packbits(blocks[row, col]).tobytes())
        for row in range(edge)
        for col in range(edge)
    ]
    parts = tuple(FleetPart("a", 0, 0, 0.0, 1.0) for _ in range(MAX_FLEET_PARTS))
    for number in range(0, len(said), MAX_FLEET_TILES):
        ground = tuple(said[number : number + MAX_FLEET_TILES])
        say(view, "a", NOW + 0.2 * number, ground=ground, division=1, parts=parts)
    began = time.monotonic()
    view.tick(NOW + 0.2 * number)
    print(f"{time.monotonic() - began:.1f} s")
    assert view.floor.area == np.count_nonzero(maze) > 900_000
    assert MOST_STEPS <= view.floor.left["a"] < 2 * MOST_STEPS


SAID = member(cells=[(1, 2)], division=3, by="a", parts=PARTS, waits_for="b", ahead=((1.0, 2.0),))
WIRE = encode_json(SAID)


@given(st.integers(0, len(WIRE) - 1), st.binary(max_size=9), st.sampled_from(["a", "z"]))
def test_a_message_with_anything_in_it_raises_nothing(at, anything, robot):
    view = two_in_a_hall()
    tell(view, robot, "fleet", WIRE[:at] + anything + WIRE[at + len(anything) :], NOW + 1)
    view.tick(NOW + 1)
    json.dumps(view.document(NOW + 1), allow_nan=False)
    assert {"a", "b"} <= set(view.names())
