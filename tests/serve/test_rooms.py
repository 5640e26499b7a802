"""Rooms on the page: what the server says of them, and what is done to them by finger."""

from __future__ import annotations

import itertools
import json
import shutil
from contextlib import contextmanager

import pytest

pytest.importorskip("websockets")

from fasaco_edge.grid.label_place import label_place
from fasaco_edge.serve.served_view import ServedView
from fasaco_edge.wire.documents.rooms import RoomReport, Rooms
from fasaco_edge.wire.keys import Keys
from tests.serve.serving import served
from tests.serve.test_browser import Tab, browsing, photograph, press
from tests.serve.test_plain import TECHNICAL
from tests.serve.test_served_view import heard, tell
from tests.support.outsider import Outsider, joined_daemon
from tests.support.rooms import show_room, two_rooms
from tests.support.waiting import until

IN_VIEW = """(() => {
  const { top, bottom, height } = find("answer").getBoundingClientRect();
  return height > 0 && top >= 0 && bottom <= innerHeight;
})()"""


def square(x: float, y: float, size: float = 3.0) -> tuple[tuple[float, float], ...]:
    return (x, y), (x + size, y), (x + size, y + size), (x, y + size)


GRID = [square(3.1 * col, 3.1 * row) for row in range(4) for col in range(5)]


def test_rooms_are_sent_once_and_shares_on_change():
    view = ServedView(Keys())
    assert heard(view, "rooms", 1.0) == {"kind": "rooms", "rooms": []}
    rooms = [RoomReport(index + 1, outline=each) for index, each in enumerate(GRID)]
    rooms[1] = RoomReport(
        2, "kit\x1bchen", GRID[1], 9.04, (1, 3), (), 0.25, passes=("auto", "cross"), skip=True
    )
    far = RoomReport(90, outline=square(1e9, 0.0))
    tell(view, "rooms", Rooms("map", 1, (*rooms, far, RoomReport(91))), 2.0)
    news = view.news(2.0)
    assert len(news["rooms"]) < 6_000
    said = json.loads(news["rooms"])["rooms"]
    assert [room["id"] for room in said] == list(range(1, 21))
    assert "\x1b" not in said[1]["title"]
    assert (said[1]["m2"], said[1]["passes"], said[1]["skip"]) == (9.0, ["auto", "cross"], True)
    assert said[0]["title"] == "room 1"
    shares = json.loads(news["shares"])["swept"]
    assert (shares["1"], shares["2"]) == (None, 0.25)
    # A drive changes the shares alone.
    rooms[1] = RoomReport(
        2, "kit\x1bchen", GRID[1], 9.04, (1, 3), (), 0.5, passes=("auto", "cross"), skip=True
    )
    tell(view, "rooms", Rooms("map", 1, tuple(rooms)), 3.0)
    news = view.news(3.0)
    assert "rooms" not in news
    assert json.loads(news["shares"])["swept"]["2"] == 0.5


def test_rooms_beside_each_other_have_other_tints_and_keep_them():
    view = ServedView(Keys())
    # Numbers in an order of no meaning.
    numbers = [1 + (7 * index) % len(GRID) for index in range(len(GRID))]
    every = [RoomReport(number, outline=each) for number, each in zip(numbers, GRID, strict=True)]
    before: dict[int, int] = {}
    for count in range(1, len(every) + 1):
        there = sorted(every, key=lambda room: room.id)[:count]
        tell(view, "rooms", Rooms("map", count, tuple(there)), float(count))
        tints = {room["id"]: room["tint"] for room in heard(view, "rooms", float(count))["rooms"]}
        assert before.items() <= tints.items()
        before = tints
    tint_at = [before[number] for number in numbers]
    for (i, a), (j, b) in itertools.combinations(enumerate(GRID), 2):
        if max(abs(a[0][0] - b[0][0]), abs(a[0][1] - b[0][1])) < 3.2:
            assert tint_at[i] != tint_at[j]


@pytest.mark.parametrize(
    ("outline", "place"),
    [
        (square(0.0, 0.0, 4.0), (2.0, 2.0, 4.0)),
        # An L: not at the mean of its corners, which is outside.
        (((0, 0), (6, 0), (6, 2), (1, 2), (1, 8), (0, 8)), (3.0, 1.0, 6.0)),
        # A corridor from south to north.
        (((0, 0), (1, 0), (1, 9), (0, 9)), (0.5, 4.5, 1.0)),
    ],
)
def test_a_label_lies_where_there_is_place(outline, place):
    assert label_place(outline) == pytest.approx(place, abs=0.3)


def test_no_area_has_no_label():
    assert label_place(((0, 0), (1, 1), (2, 2))) is None
    assert label_place(()) is None


@contextmanager
def two_rooms_shown(folder):
    with (
        joined_daemon(folder, mission={"autostart": False}) as (daemon, outsider),
        served(folder, daemon.endpoint, "--allow-commands") as page,
        browsing(page.url, folder / "browser") as tab,
    ):
        show_room(outsider, two_rooms(door=True), 1.05, 1.05)
        until(lambda: tab.js("foundRooms().length") == 2 and tab.js("Boolean(model.map)"))
        yield tab, outsider


@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium")
def test_rooms_are_named_set_ordered_merged_and_split_by_finger(tmp_path):
    with two_rooms_shown(tmp_path) as (tab, outsider):
        for xy, name in (((1.05, 2.5), "kitchen"), ((4.65, 2.5), "bath")):
            tap(tab, *xy)
            tab.js(f"find('roomname').value = {name!r}")
            tab.click("rename")
            until(lambda name=name: tab.js(f"foundRooms().some((r) => r.name === {name!r})"))
        # A name that another room has is refused, and the owner reads why.
        tab.js("find('roomname').value = 'kitchen'")
        tab.click("rename")
        until(lambda: tab.js("find('answer').innerText").startswith("Choose another name"))
        assert "is 'kitchen' already" in tab.js("find('answer').innerText")
        assert is_said_in_view(tab)
        assert tab.js("find('roomtitle').innerText") == "bath"
        tab.click("roomcross")
        until(lambda: tab.js("JSON.stringify(roomOf(pickedRoom).passes)") == '["auto","cross"]')
        assert tab.js("find('roompasses').value") == "2"
        field = "find('roompriority')"
        tab.js(f"{field}.value = 80; {field}.dispatchEvent(new Event('change'))")
        until(lambda: tab.js("roomOf(pickedRoom).priority") == 80)
        tab.js(f"{field}.value = ''; {field}.dispatchEvent(new Event('change'))")
        assert not TECHNICAL.search(tab.js("document.body.innerText"))
        photograph(tab, "room")

        order_both(tab, outsider)

        # What is left out of an order for everything, the page says.
        tap(tab, 4.65, 2.5)
        tab.click("roomskip")
        # An empty field of the priority has changed nothing.
        until(lambda: tab.js("roomOf(pickedRoom).skip && roomOf(pickedRoom).priority") == 80)
        tab.js("start({ until_min: 40 }, true)")
        # The answer takes the choice back, and would take back a tap before it.
        until(lambda: tab.js("find('answer').innerText").startswith("It begins anew"))
        until(lambda: {"left out", "home in"} <= set(tab.js("find('zones').innerText").split("\n")))

        tab.js("document.querySelector('#room details').open = true")
        tap(tab, 1.05, 2.5)
        press(tab, "Merge")
        press(tab, "Tap again")
        until(lambda: tab.js("foundRooms().length") == 1)
        until(lambda: tab.js("find('roomtitle').innerText") == "kitchen")
        # The line begins and ends before the walls; the page leads it on to them.
        tab.click("split")
        tab.js("canvas.scrollIntoView()")
        (x0, y0), (x1, y1) = tab.on_screen(1.6, 1.0), tab.on_screen(1.6, 2.0)
        tab.touch((x0, y0), ((x0 + x1) / 2, (y0 + y1) / 2), (x1, y1))
        until(
            lambda: tab.js("foundRooms().length") == 2,
            why=lambda: tab.js("find('answer').innerText"),
        )
        photograph(tab, "split")
        assert tab.complaints == []


def order_both(tab: Tab, outsider: Outsider) -> None:
    tab.click("chooseroom")
    tap(tab, 1.05, 2.5)
    tab.click("chooseroom")
    assert tab.js("find('roomsnow').textContent") == "Sweep bath, then kitchen"
    assert tab.js("find('roomnow').hidden && find('start').hidden")
    assert tab.js("find('chose').innerText").startswith("You chose or drew bath, kitchen: ")
    # By number: a configured zone of that name would come first.
    by_number = "order().zones.every((zone) => roomOf(zone.room).name === zone.name)"
    assert tab.js(f"chosen.size === 2 && {by_number}")
    tab.click("roomsnow")
    mission = outsider.wait_status(lambda s: s["mission"]["zones"])["mission"]
    assert [(z["name"], z["passes"]) for z in mission["zones"]] == [("bath", 2), ("kitchen", 1)]
    until(lambda: tab.js("chosen.size") == 0 and tab.js("find('room').hidden"))
    # The figures are of one of its parts; the same order goes on.
    until(lambda: tab.js("find('togo-of').innerText") == "to go in this pass")
    assert tab.js("find('share-of').innerText") == "in this pass"
    assert "now, pass 1 of 2" in tab.js("find('zones').innerText")
    same = "[...mission.zones].map(({ name }) => foundRooms().find((r) => r.name === name).id)"
    tab.js(f"{{ const {{ mission }} = model.state; {same}.forEach(choose); }}")
    photograph(tab, "under_way")
    tab.click("order")
    until(lambda: tab.js("find('answer').innerText").startswith("It goes on"))
    photograph(tab, "goes_on")


def is_said_in_view(tab: Tab) -> bool:
    tops = (0, 9_999)
    return all(tab.js(f"scrollTo(0, {top}); {IN_VIEW}") for top in tops)


def tap(tab: Tab, x: float, y: float) -> None:
    tab.js("canvas.scrollIntoView()")
    tab.touch(tab.on_screen(x, y))
    until(lambda: tab.js("find('room').offsetParent !== null"))


@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium")
def test_words_and_typed_numbers_are_of_the_right_room(tmp_path):
    with two_rooms_shown(tmp_path) as (tab, _):
        # On a page that is opened anew, rooms come after the state.
        tab.js("start({ zones: foundRooms().map((room) => zoneOf(room.id)) })")
        until(lambda: "room" in tab.js("find('share-of').textContent"))
        rooms = tab.js("JSON.stringify(model.rooms)")
        words = tab.js(
            f"model.rooms = null; showState(); model.rooms = {rooms}; showRooms();"
            "find('share-of').textContent"
        )
        assert "room" in words
        one, other = (int(tab.js(f"roomAt([{x}, 2.5])")) for x in (1.05, 4.65))
        tab.touch(tab.on_screen(1.05, 2.5))
        until(lambda: tab.js("pickedRoom") == one)
        # Another room is tapped before the field is left.
        tab.js("find('roompasses').focus(); find('roompasses').select(); canvas.scrollIntoView()")
        tab.call("Input.insertText", text="4")
        tab.touch(tab.on_screen(4.65, 2.5))
        until(lambda: tab.js("pickedRoom") == other)
        until(lambda: tab.js("foundRooms().some((room) => room.passes === 4)"))
        assert tab.js(f"roomOf({one}).passes") == 4
        assert tab.js(f"roomOf({other}).passes") is None
        assert tab.complaints == []
