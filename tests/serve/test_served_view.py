"""What a page is told of a robot, sample by sample."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.client.robot_state import Token
from fasaco_edge.mission.orders.order import read_order
from fasaco_edge.serve import served_view
from fasaco_edge.serve.served_view import OTHER_LASTS_S, ServedView
from fasaco_edge.wire.documents.fleet import FleetMember
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.keys import Keys
from fasaco_edge.wire.messages.paths import encode_path
from tests.support.statuses import FULL, MALFORMED, extreme_statuses, malformed_status

CORNERS = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]


def tell(view: ServedView, topic: str, document: Any, now: float, key: str = "") -> None:
    view.take(topic, Sample(key, encode_json(document)), now)


def heard(view: ServedView, kind: str, now: float) -> Any:
    message = view.news(now).get(kind)
    return json.loads(message) if isinstance(message, str) else message


def test_other_robots_of_the_fleet_are_shown_until_silent():
    view = ServedView(Keys("one"))
    member = FleetMember(1, "hall", 0.3, "map", "covering", 2.0, 3.0, 1.0, 1, 0, 5, ())
    tell(view, "fleet", member, 1.0, "fasaco/@v1/two/fleet")
    assert heard(view, "others", 1.0) == {"kind": "others", "robots": []}
    tell(view, "status", {"state": "covering", "fleet": {"name": "hall"}}, 2.0)
    for robot in ("one", "two", "two"):
        tell(view, "fleet", member, 3.0, f"fasaco/@v1/{robot}/fleet")
    assert heard(view, "others", 3.5)["robots"] == [{"name": "two", "x": 2.0, "y": 3.0}]
    assert heard(view, "others", 4.0 + OTHER_LASTS_S)["robots"] == []


@pytest.mark.parametrize("ended", [{"stage": "over", "ordered": "command"}, {"ordered": None}])
def test_an_order_that_has_ended_can_be_given_again(ended):
    """As it was, but for what was kept of the one before, and the outline that a room had."""
    view = ServedView(Keys())
    tell(view, "status", {"state": "idle", "mission": {"ordered": None}}, 1.0)
    assert heard(view, "state", 1.0)["again"] is None
    zones = [{"name": "hall", "polygon": CORNERS, "room": 3}, {"name": "den", "polygon": CORNERS}]
    order = {"zones": zones, "return_home": True, "keep_covered": True}
    tell(view, "command", {"command": "start", "order": order}, 2.0)
    tell(view, "status", {"state": "covering", "mission": {"ordered": "command"}}, 2.0)
    assert heard(view, "state", 2.0)["again"]["return_home"]
    if ended["ordered"] is None:
        tell(view, "command", {"command": "cancel"}, 3.0)
    tell(view, "status", {"state": "done", "mission": ended}, 3.0)
    assert heard(view, "state", 3.0)["again"] == order | {
        "zones": [{"name": "hall", "room": 3}, zones[1]],
        "keep_covered": False,
    }
    # Start alone does that.
    tell(view, "command", {"command": "start", "order": {"passes": 1, "keep_out": []}}, 4.0)
    tell(view, "status", {"state": "done", "mission": ended, "uptime_s": 9.0}, 4.0)
    assert heard(view, "state", 4.0)["again"] == {}


def test_an_earlier_order_can_be_repeated_from_the_status():
    """Rooms are ordered by their numbers, and as often as they are set where nothing else was."""
    view = ServedView(Keys())
    rooms = [
        {"id": 3, "name": "bath", "outline": CORNERS, "passes": ["auto", "cross"]},
        {"id": 4, "outline": CORNERS},
        {"id": 5, "name": "porch", "outline": CORNERS},
    ]
    tell(view, "rooms", {"rooms": rooms}, 1.0)
    names = {"bath": 2, "room 4": 3, "porch": 1, "area 1": 1}
    zones = [{"name": name, "passes": of, "polygon": CORNERS} for name, of in names.items()]
    keep_outs = [{"polygon": CORNERS, "by": by} for by in ("order", "operator")]
    mission = {"ordered": "command", "stage": "over", "zones": zones, "keep_outs": keep_outs}
    config = {"mission": {"zones": [{"name": "porch", "polygon": CORNERS}]}}
    tell(view, "status", {"state": "done", "mission": mission, "config": config}, 2.0)
    again = heard(view, "state", 2.0)["again"]
    assert again == {
        "zones": [
            {"name": "bath", "room": 3},
            {"name": "room 4", "passes": 3, "room": 4},
            {"name": "porch", "passes": 1, "polygon": CORNERS},
            {"name": "area 1", "passes": 1, "polygon": CORNERS},
        ],
        "keep_out": [CORNERS],
        "return_home": False,
        "keep_covered": False,
    }
    read_order(again)
    # A cancelled order is told as it was given.
    cancelled = {"zones": [{"name": "den", "polygon": CORNERS}], "passes": ["edge"]}
    view = ServedView(Keys())
    tell(view, "status", {"state": "idle", "mission": {"last_order": cancelled}}, 2.0)
    assert heard(view, "state", 2.0)["again"] == cancelled | {"keep_covered": False}
    # What the robot has begun by itself, Start does.
    itself = {"ordered": "itself", "stage": "over"}
    tell(view, "status", {"state": "done", "mission": itself}, 3.0)
    assert heard(view, "state", 3.0)["again"] is None


def test_the_zones_of_an_order_are_drawn_by_the_status_alone():
    view = ServedView(Keys())
    zones = [{"name": "hall", "polygon": CORNERS}, {"name": "of old"}]
    tell(view, "status", {"state": "covering", "mission": {"zones": zones}}, 1.0)
    drawn = [{"name": "hall", "polygon": CORNERS, "is": "ordered"}]
    assert heard(view, "areas", 1.0)["zones"] == drawn


def test_the_keep_outs_in_force_are_drawn_by_the_status_alone():
    """As after a restart of the server, which has received no command."""
    view = ServedView(Keys())
    keep_outs = [
        {"name": "vase", "polygon": CORNERS, "by": "operator"},
        {"name": "", "polygon": CORNERS, "by": "order"},
        {"name": "far", "polygon": [[1e9, 0], [1, 0], [1, 1]], "by": "operator"},
        {"name": "line", "polygon": CORNERS[:2], "by": "operator"},
    ]
    tell(view, "status", {"state": "covering", "mission": {"keep_outs": keep_outs}}, 1.0)
    assert heard(view, "areas", 1.0)["keep_out"] == [
        {"name": "vase", "polygon": CORNERS, "is": "operator"},
        {"name": "", "polygon": CORNERS, "is": "order"},
    ]
    tell(view, "status", {"state": "covering", "mission": {"keep_outs": []}}, 2.0)
    assert heard(view, "areas", 2.0)["keep_out"] == []


def test_unchanged_state_is_not_sent_again():
    view = ServedView(Keys())
    tell(view, "status", {"state": "idle"}, 1.0)
    assert heard(view, "state", 1.0)["state"] == "idle"
    assert view.news(1.05) == {}
    tell(view, "status", {"state": "idle", "uptime_s": 1.0}, 2.0)
    assert "state" not in view.news(2.0)


def test_a_long_path_is_cut_after_its_beginning(monkeypatch):
    monkeypatch.setattr(served_view, "MOST_POINTS", 10)
    view = ServedView(Keys())
    xy = np.stack([np.arange(25.0), np.zeros(25)], axis=-1)
    note = encode_json({"revision": 3, "steps": 24, "reason": "test"})
    view.take("path", Sample("", encode_path(xy, np.zeros(25), "map", 1), "", note), 1.0)
    message = view.news(1.0)["path"]
    assert isinstance(message, bytes)
    head = json.loads(message[4 : 4 + int.from_bytes(message[:4], "little")])
    assert (head["revision"], head["more"]) == (3, 15)
    assert len(view.walk.xy) == 10


def test_an_unreadable_sample_is_reported_and_affects_no_other():
    view = ServedView(Keys())
    for topic in ("map", "floor", "path", "coverage"):
        view.take(topic, Sample("", b"nonsense"), 1.0)
    tell(view, "status", {"state": "idle"}, 1.0)
    news = view.news(1.0)
    assert set(news) >= {"state", "events"}
    assert "cannot be read" in str(news["events"])
    assert not {"map", "floor", "path"} & set(news)


def test_an_unreadable_path_attachment_is_only_an_event():
    """The other topics of the same update are served as usual."""
    view = ServedView(Keys())
    xy = np.stack([np.arange(5.0), np.zeros(5)], axis=-1)
    tell(view, "status", {"state": "covering"}, 1.0)
    view.take("path", Sample("", encode_path(xy, np.zeros(5), "map", 1), "", b"nonsense"), 1.0)
    news = view.news(1.0)
    assert "state" in news
    assert "path cannot be read" in str(news["events"])


def walk_of(view: ServedView, steps: int, now: float, **more: Any) -> dict[str, Any]:
    revision, count = steps + 1, steps + 1 if steps else 0
    xy = np.stack([np.arange(count, dtype=float), np.zeros(count)], axis=-1)
    note = encode_json({"revision": revision, "steps": steps, "reason": "test"})
    path = {"revision": revision, "steps": steps, "remaining_steps": steps} | more.pop("path", {})
    view.take("path", Sample("", encode_path(xy, np.zeros(len(xy)), "map", 1), "", note), now)
    tell(view, "status", {"path": path} | more, now)
    news = view.news(now)
    path, told = news.get("path"), news["state"]
    assert isinstance(told, str)
    found: dict[str, Any] = json.loads(told) | {"shown": None}
    if isinstance(path, bytes):
        found["shown"] = json.loads(path[4 : 4 + int.from_bytes(path[:4], "little")])["revision"]
    return found


def test_a_paused_robot_keeps_its_path_and_its_time_to_go():
    """It is told to stand by an empty path, and goes on with the one before."""
    view, now = ServedView(Keys()), 4.0
    drives = walk_of(view, 4, 1.0, state="covering", path={"line_s": 12.4})
    assert (drives["to_go_s"], drives["shown"]) == (12, 5)
    paused = walk_of(view, 0, 2.0, state="paused", path={"line_s": 10.0})
    assert (paused["to_go_s"], paused["shown"]) == (10, None)
    assert len(view.walk.xy) == 5
    # One that waits by itself has no path, and nobody knows for how long.
    waits = walk_of(view, 0, 3.0, state="covering", path={"line_s": 10.0})
    assert (waits["to_go_s"], waits["shown"]) == (None, 1)
    # After a restart of the daemon, where cells are driven, or of a speed of almost 0.
    endless = {"revision": 3, "steps": 9, "line_s": 1e14}
    for path in (None, {"revision": 3, "steps": 9}, endless):
        tell(view, "status", {"state": "covering", "path": path}, now := now + 1.0)
        assert heard(view, "state", now)["to_go_s"] is None
        view = ServedView(Keys())


@pytest.mark.parametrize(
    ("zones", "at", "stage", "part", "more"),
    [
        ("", ("", 1, 1), "covering", "", False),
        ("", ("", 1, 2), "covering", "pass", True),
        ("", ("", 2, 2), "covering", "pass", False),
        ("bath", ("bath", 1, 1), "covering", "place", False),
        ("bath den", ("bath", 1, 1), "covering", "place", True),
        ("bath den", ("bath", 2, 2), "covering", "pass", True),
        ("bath den", ("den", 1, 1), "covering", "place", False),
        ("bath den", ("", None, None), "over", "places", False),
        ("bath", ("", None, None), "retrying", "place", False),
        ("", ("", None, None), "over", "", False),
    ],
)
def test_figures_name_the_room_or_pass_that_they_count(zones, at, stage, part, more):
    view, (zone, number, passes) = ServedView(Keys()), at
    mission = {"ordered": "command", "stage": stage, "zone": zone or None}
    mission |= {"pass": number, "passes": passes, "zones": [{"name": of} for of in zones.split()]}
    tell(view, "status", {"state": "covering", "mission": mission}, 1.0)
    told = heard(view, "state", 1.0)["mission"]
    assert (told["part"], told["more"]) == (part, more)


def test_a_gone_robot_is_shown_with_its_last_state():
    view = ServedView(Keys())
    view.take("token", Token("robot", here=True), 1.0)
    drives = walk_of(view, 4, 1.0, state="covering")
    assert (drives["does"], drives["absent"]) == ("Sweeps everything it can reach", "")
    view.take("token", Token("robot", here=False), 2.0)
    gone = heard(view, "state", 2.0)
    assert gone["does"] == "When last seen: sweeps everything it can reach"
    assert gone["absent"].startswith("The robot has been gone")
    assert gone["to_go_s"] is None


def test_no_number_that_a_status_may_have_ends_the_page():
    view, now = ServedView(Keys("robot")), 1.0
    view.take("path", Sample("", encode_path(np.eye(3, 2), np.zeros(3), "map", 1)), now)
    shown = 0
    for payload in extreme_statuses():
        now += 10.0
        view.take("status", Sample("", payload), now)
        shown += "state" in view.news(now)
    assert shown > 70


@pytest.mark.parametrize("name", MALFORMED)
def test_a_malformed_status_keeps_the_last_one_and_is_an_event(name):
    view = ServedView(Keys("robot"))
    view.robots.add("robot")
    tell(view, "status", FULL, 1.0)
    assert heard(view, "state", 1.0)["state"] == "covering"
    view.take("status", Sample("", malformed_status(name)), 2.0)
    now = view.news(2.0)
    assert '"state":"covering"' in now.get("state", '"state":"covering"')
    assert "status cannot be read (1 so far)" in now["events"]


def test_a_room_has_one_figure_on_the_map_and_in_the_list_of_the_order():
    """The list counted cells: 100 % of a room beside 94 % on the map."""
    view = ServedView(Keys())
    rooms = [{"id": 3, "name": "bath", "outline": CORNERS, "swept": 0.94}]
    tell(view, "rooms", {"rooms": rooms}, 1.0)
    zones = [{"name": name, "passes": 1, "cells": 8, "covered": 8} for name in ("bath", "area 1")]
    tell(view, "status", {"state": "done", "mission": {"zones": zones}}, 2.0)
    found = heard(view, "state", 2.0)["mission"]["zones"]
    assert {zone["name"]: zone["share"] for zone in found} == {"bath": 0.94, "area 1": 1.0}
    # A corner of the room that was given its name has its own.
    zones[0]["polygon"] = [[2, 2], [3, 2], [3, 3]]
    tell(view, "status", {"state": "done", "mission": {"zones": zones}}, 3.0)
    found = heard(view, "state", 3.0)["mission"]["zones"]
    assert found[0] == {"name": "bath", "pass": 0, "passes": 1, "share": 1.0}
    # A single zone has that above the list; of one that is not on the map nothing is known.
    left = {"reachable_m2": 4.0, "left": [{"m2": 1.0, "reason": "too narrow"}]}
    for floor, share in ((left, 0.75), ({}, None)):
        alone = {"zones": [{"name": "area 1", "passes": 1}]}
        tell(view, "status", {"state": "done", "mission": alone, "floor": floor}, 4.0 + (not floor))
        (zone,) = heard(view, "state", 4.0 + (not floor))["mission"]["zones"]
        assert zone["share"] == share


@pytest.mark.parametrize(("coverable", "share"), [(8, 0.5), (0, None)])
def test_no_share_is_shown_of_an_order_without_floor(coverable, share):
    view = ServedView(Keys())
    coverage = {"coverable": coverable, "covered": coverable // 2, "fraction": share or 1.0}
    tell(view, "status", {"state": "done", "coverage": coverage}, 1.0)
    assert heard(view, "state", 1.0)["cells"] == share
