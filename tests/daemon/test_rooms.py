"""Rooms of a real daemon: found while it is idle, named, ordered, and known after a restart."""

from __future__ import annotations

import contextlib
import io
import json
from typing import Any

import pytest

from fasaco_edge.cli import main
from tests.daemon.test_commands import ask, command
from tests.daemon.test_mission import about, planned
from tests.support.outsider import Outsider, joined_daemon
from tests.support.processes import Daemon
from tests.support.rooms import cells_of, show_room, two_rooms
from tests.wire.schemas import check

FLAT = two_rooms(door=True)
IN_WEST = (1.05, 1.05)
IDLE: dict[str, Any] = {"mission": {"autostart": False}}


def show(outsider: Outsider) -> None:
    show_room(outsider, FLAT, *IN_WEST)


def room_command(outsider: Outsider, name: str, /, **room: Any) -> dict[str, Any]:
    asked = {"command": f"room_{name}", "room": room}
    check("mission.json", asked)
    return ask(outsider, json.dumps(asked).encode())


def rooms_of(outsider: Outsider) -> dict[str, Any]:
    (reply,) = outsider.session.get(f"{outsider.prefix}/@rpc/rooms", timeout=10.0)
    document: dict[str, Any] = json.loads(reply.ok.payload.to_bytes())
    check("rooms.json", document)
    return document


def cli(daemon: Daemon, *words: str) -> str:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main([*words, "--connect", daemon.endpoint])
    assert code == 0, err.getvalue()
    return out.getvalue()


def test_rooms_are_named_ordered_and_known_again(tmp_path):
    # A broken file of rooms is only a named fault.
    broken = tmp_path / "state" / "robot.rooms.json"
    broken.parent.mkdir()
    broken.write_text("{}")
    with joined_daemon(tmp_path, **IDLE) as (running, outsider):
        heard = outsider.listen("rooms")
        heard.wait(lambda sample: True)
        status = outsider.wait_status(lambda status: status["errors"]["total"])
        assert status["errors"]["by_code"] == {"rooms_file": 1}
        assert rooms_of(outsider) == {"frame": "", "revision": 0, "rooms": []}
        show(outsider)
        found = heard.wait(lambda sample: len(sample.json()["rooms"]) == 2).json()
        check("rooms.json", found)
        assert found["frame"] == "map"
        assert [room["id"] for room in found["rooms"]] == [1, 2]
        assert [room["neighbours"] for room in found["rooms"]] == [[2], [1]]
        assert outsider.ask_status()["state"] == "idle"
        west, east = sorted(found["rooms"], key=lambda room: min(room["outline"]))
        assert west["area_m2"] == pytest.approx(8.5, abs=1.0)

        assert "done" in cli(running, "rooms", "name", str(east["id"]), "kitchen")
        cli(running, "rooms", "set", "kitchen", "--passes", "2", "--priority", "80")
        heard.wait(lambda sample: any(room["name"] == "kitchen" for room in sample.json()["rooms"]))
        assert room_command(outsider, "name", id=west["id"], name="kitchen")["code"] == "bad_order"
        table = cli(running, "rooms", "list")
        drawn = json.loads(cli(running, "rooms", "list", "--geojson"))
        names = {feature["properties"]["name"] for feature in drawn["features"]}
        assert names == {"kitchen", f"room {west['id']}"}
        assert "kitchen" in table
        assert "passes: 2; priority: 80" in table

        # What is not known yet is refused with what there is, or waited for.
        attic = {"zones": [{"name": "attic"}]}
        assert "'kitchen'" in command(outsider, "start", attic)["message"]
        answer = command(outsider, "start", attic | {"unknown": "wait"})
        assert answer["mission"]["waits_for_room"] == "attic"
        outsider.wait_status(lambda status: "waits for a room 'attic'" in status["reason"])
        running.kill()
    with joined_daemon(tmp_path, **IDLE) as (_, outsider):
        heard, paths = outsider.listen("rooms"), outsider.listen("path")
        # Before any map the rooms are known, and can be ordered.
        again = heard.wait(lambda sample: sample.json()["rooms"]).json()
        assert {room["id"]: room["name"] for room in again["rooms"]} == {
            west["id"]: "",
            east["id"]: "kitchen",
        }
        assert room_command(outsider, "split", id=1, cut=[[0, 0], [1, 1]])["code"] == "not_now"
        answer = command(outsider, "start", {"zones": [{"name": "kitchen"}]})
        assert answer["mission"]["zones"][0]["passes"] == 2
        show(outsider)
        first = paths.wait(lambda sample: len(planned(sample)[0]) > 0)
        assert about(first)["reason"].startswith("zone 'kitchen', pass 1 of 2")
        swept = cells_of(planned(first)[0])
        assert sum(col >= 11 for _, col in swept) > 40
        # A reset forgets what is swept, and no room.
        command(outsider, "reset")
        assert [room["name"] for room in rooms_of(outsider)["rooms"]].count("kitchen") == 1
