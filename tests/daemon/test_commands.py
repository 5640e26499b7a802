"""Commands to a real daemon: as queries of somebody else's program, and from the command line."""

from __future__ import annotations

import contextlib
import io
import json
from typing import Any

import numpy as np
import pytest

from fasaco_edge.cli import main
from tests.daemon.test_mission import about, planned
from tests.support.outsider import Outsider, joined_daemon
from tests.support.processes import Daemon, fasaco_edge
from tests.support.rooms import (
    HALL,
    begin,
    cells_of,
    drive,
    lanes,
    map_bytes,
    room,
    show_room,
)

# Lanes 3 and 4 of the hall, columns 1 to 4.
KITCHEN = {"name": "kitchen", "polygon": [[0.3, 0.9], [1.5, 0.9], [1.5, 1.5], [0.3, 1.5]]}
KITCHEN_CELLS = {(row, col) for row in (3, 4) for col in range(1, 5)}


def command(
    outsider: Outsider, name: str, order: dict[str, Any] | None = None, *, discard: bool = True
) -> dict[str, Any]:
    asked: dict[str, Any] = {"command": name} | ({"order": order} if order is not None else {})
    if name in ("start", "reset"):
        asked["discard"] = discard
    return ask(outsider, json.dumps(asked).encode())


def ask(outsider: Outsider, payload: bytes | None) -> dict[str, Any]:
    (reply,) = outsider.session.get(
        f"{outsider.prefix}/@rpc/mission", payload=payload, timeout=60.0
    )
    answer = reply.ok or reply.err
    assert "json" in str(answer.encoding)
    document: dict[str, Any] = json.loads(answer.payload.to_bytes())
    assert ("code" in document) == (reply.ok is None)
    return document


def told(daemon: Daemon, *words: str) -> Any:
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(["mission", *words, "--connect", daemon.endpoint, "--json"])
    assert code == 0, err.getvalue()
    return json.loads(out.getvalue())


@pytest.mark.parametrize(
    ("payload", "code", "said"),
    [
        (b"{", "malformed_message", "JSON object"),
        (b"[]", "malformed_message", "JSON object"),
        (b"\xff", "malformed_message", "JSON object"),
        (b"{}", "bad_order", "command: missing"),
        (b'{"command":"go"}', "bad_order", "got 'go'"),
        (b'{"command":"start","order":{"zone":1}}', "bad_order", "order.zone: unknown key"),
        (b'{"command":"start","order":{"keep_out":[[[0,0],[1,1],[1,0],[0,1]]]}}', "bad_order",
         "keep_out[0]: crosses or touches itself"),
        (b'{"command":"start","order":{"passes":1e9}}', "bad_order", "order.passes"),
        (b'{"command":"start","order":{"zones":[{"name":"a"}]}}', "bad_order", "nor a room"),
        (b'{"command":"room_name","room":{"id":1}}', "bad_order", "room.name: missing"),
        (b'{"command":"room_set","room":{"id":1,"skip":true}}', "bad_order", "no room 1"),
        (b'{"command":"room_split","room":{"id":1,"cut":[[0,0],[1,1]]}}', "not_now", "no map yet"),
    ],
)  # fmt: skip
def test_an_invalid_command_is_answered_with_an_error(outsider, payload, code, said):
    error = ask(outsider, payload)
    assert error["code"] == code
    assert said in error["message"]
    assert error["hint"]
    # Nothing has happened, and nothing is counted against those who sent maps and poses.
    assert outsider.ask_status()["errors"]["total"] == 0


def test_a_question_without_a_payload_is_one_for_the_status(outsider):
    for payload in (None, b"", b'{"command":"status"}'):
        answer = ask(outsider, payload)
        assert (answer["robot"], answer["state"]) == ("robot", "waiting for map")
        assert answer["mission"]["ordered"] == "itself"


def test_an_order_before_any_map_and_a_life_after_it(tmp_path):
    with joined_daemon(tmp_path, mission={"autostart": False}) as (running, outsider):
        paths, taken = outsider.listen("path"), outsider.listen("command", late=False)
        assert outsider.ask_status()["state"] == "idle"
        assert outsider.ask_status()["reason"] == "no order yet: start a mission"
        assert command(outsider, "pause")["code"] == "not_now"
        answer = command(outsider, "start", {"zones": [KITCHEN], "passes": 2, "return_home": True})
        assert answer["state"] == "waiting for map"
        assert answer["mission"]["zones"] == [
            KITCHEN | {"passes": 2, "pass": 0, "cells": 0, "covered": 0}
        ]
        status = begin(outsider)
        assert status["state"] == "covering"
        first = paths.wait(lambda heard: True)
        assert about(first)["reason"] == "zone 'kitchen', pass 1 of 2"
        assert set(cells_of(planned(first)[0])) >= KITCHEN_CELLS
        mission = outsider.ask_status()["mission"]
        assert (mission["zone"], mission["pass"], mission["passes"]) == ("kitchen", 1, 2)
        assert mission["zones"][0]["cells"] == 8
        assert mission["home"] == {"x": 0.45, "y": 0.45}

        # Paused, the robot gets an empty path, and what it passes over still counts.
        answer = command(outsider, "pause")
        assert (answer["state"], answer["mission"]["paused"]) == ("paused", True)
        stop = paths.wait(lambda heard: about(heard)["reason"] == "paused by command")
        assert len(planned(stop)[0]) == 0
        status = drive(outsider, lanes(5))
        assert status["coverage"]["covered"] == 5
        assert status["state"] == "paused"
        # Killed, it still is.
        running.kill()
        order = taken.wait(lambda heard: heard.json()["command"] == "start").json()["order"]
        assert order["zones"][0]["name"] == "kitchen"
        assert [heard.json()["command"] for heard in taken.heard] == ["start", "pause"]
    with joined_daemon(tmp_path, mission={"autostart": False}) as (_, outsider):
        assert outsider.ask_status()["state"] == "paused"
        show_room(outsider, room(6.0, 4.5), *lanes(5)[-1])
        status = outsider.wait_status(lambda status: status["pose"] is not None)
        assert status["state"] == "paused"
        assert (status["mission"]["zone"], status["mission"]["pass"]) == ("kitchen", 1)
        paths = outsider.listen("path")
        assert command(outsider, "resume")["mission"]["paused"] is False
        path = planned(paths.wait(lambda heard: len(planned(heard)[0]) > 0))[0].tolist()
        assert set(cells_of(path)) >= KITCHEN_CELLS
        # It drives each path to its end: the second pass, and the way home.
        for number in range(1, 6):
            status = drive(outsider, [(x, y) for x, y in path])
            if status["state"] == "done":
                break
            heard = paths.wait(lambda heard: True, since=number)
            path = planned(heard)[0].tolist()
        status = outsider.wait_status(lambda status: status["state"] == "done")
        assert status["reason"] == "every reachable cell of the zones is covered"
        done = {"passes": 2, "pass": 2, "cells": 8, "covered": 8}
        assert status["mission"]["zones"] == [KITCHEN | done]
        assert (status["pose"]["x"], status["pose"]["y"]) == (0.45, 0.45)


def test_an_order_ends_at_its_time_limit(tmp_path):
    with joined_daemon(tmp_path) as (running, outsider):
        begin(outsider)
        answer = told(running, "start", "--until-min", "0.03", "--yes")
        assert 0.0 < answer["mission"]["time_left_s"] <= 1.8
        status = outsider.wait_status(lambda status: status["state"] == "done")
        assert status["reason"].startswith("time is up after 0.03 min: ")
        assert status["mission"]["time_left_s"] is None
        assert status["mission"]["unreached"]["areas"][0]["reason"] == "no time left"


def test_a_map_of_dirt_says_what_comes_first_where_time_is_short(tmp_path):
    dirt = np.full(HALL.shape, -1, np.int8)
    dirt[:, HALL.shape[1] // 2 :] = 90
    with joined_daemon(tmp_path) as (running, outsider):
        outsider.put("priority", map_bytes(dirt))
        begin(outsider)
        told(running, "start", "--until-min", "0.7", "--yes")
        outsider.wait_status(lambda status: status["mission"]["first_from"] == 90)
        outsider.put("priority", map_bytes(dirt, frame="odom"))
        outsider.put("priority", b"no grid")
        counted = {"wrong_frame": 1, "malformed_message": 1}
        status = outsider.wait_status(lambda status: status["errors"]["by_code"] == counted)
        assert status["mission"]["first_from"] == 90
        told(running, "start", "--until-min", "60", "--yes")
        outsider.wait_status(lambda status: status["mission"]["first_from"] is None)


def test_reset_keeps_the_ledger_aside(tmp_path):
    with joined_daemon(tmp_path) as (_, outsider):
        begin(outsider)
        drive(outsider, lanes(10))
        answer = command(outsider, "reset")
        assert answer["state"] == "idle"
        assert answer["coverage"]["covered"] == 1, "the tool stands there"
        assert outsider.ask_status()["ledger"]["fault"] is None
        outsider.wait_status(lambda status: status["ledger"]["restored_cells"] == 0)
        assert command(outsider, "start")["mission"]["stage"] == "covering"
        outsider.wait_status(lambda status: status["state"] == "covering")
    names = [path.name for path in (tmp_path / "state").iterdir()]
    assert any(name.startswith("robot.ledger.reset-") for name in names), names
    with joined_daemon(tmp_path) as (_, outsider):
        assert outsider.ask_status()["ledger"]["restored_cells"] == 1
        assert command(outsider, "reset")["state"] == "idle", "before there is a map, too"
    with joined_daemon(tmp_path) as (_, outsider):
        assert outsider.ask_status()["state"] == "idle"
        assert outsider.ask_status()["ledger"]["restored_cells"] == 0


def test_the_command_line(tmp_path):
    with joined_daemon(tmp_path, mission={"autostart": False}) as (running, outsider):
        assert told(running, "status")["state"] == "idle"
        begin_idle(outsider)
        zone = "kitchen:0.3,0.9;1.5,0.9;1.5,1.5;0.3,1.5"
        keep_out = "-1,-1;0,-1;0,0"
        words = "start", "--zone", zone, "--keep-out", keep_out, "--passes", "2", "--return-home"
        mission = told(running, *words)["mission"]
        assert mission["zones"][0]["passes"] == 2
        assert (mission["keep_out"], mission["return_home"]) == (1, True)
        outsider.wait_status(lambda status: status["state"] == "covering")
        assert told(running, "pause")["state"] == "paused"
        assert told(running, "resume")["mission"]["paused"] is False
        shown = fasaco_edge("mission", "status", "--connect", running.endpoint)
        assert shown.code == 0
        for word in ("kitchen", "pass 1 of 2", "covering", "keep-out zones", "of all floor"):
            assert word in shown.out
        file = tmp_path / "order.yaml"
        file.write_text("keep_out:\n  - [[1, 1], [2, 1], [2, 2]]\npasses: 3\n")
        mission = told(running, "start", "--order", str(file), "--yes")["mission"]
        assert (mission["passes"], mission["zones"]) == (3, [])
        cancelled = told(running, "cancel")
        assert cancelled["state"] == "idle"
        assert cancelled["mission"]["last_order"]["passes"] == 3
        reset = told(running, "reset")
        assert reset["reason"] == "reset: what was covered is forgotten"
        assert reset["mission"]["last_order"] is None
        refused = fasaco_edge("mission", "pause", "--connect", running.endpoint)
        assert refused.code == 1
        assert refused.out == ""
        assert refused.err == (
            "fasaco-edge: there is no mission to pause\n"
            "  hint: check the status, and start a mission first\n"
        )
        refused = fasaco_edge("mission", "resume", "--connect", running.endpoint, "--json")
        assert (refused.code, json.loads(refused.out)["code"]) == (1, "not_now")
        other = fasaco_edge("mission", "status", "--robot", "x", "--connect", running.endpoint)
        assert other.code == 1
        assert "no daemon answers at fasaco/@v1/x" in other.err
        assert "robots on this bus: robot; choose one by --robot" in other.err


def begin_idle(outsider: Outsider) -> None:
    show_room(outsider, room(6.0, 4.5), 0.45, 0.45)
    outsider.wait_status(lambda status: status["pose"] is not None)


def test_the_answer_says_what_is_special_about_a_pass(outsider, daemon):
    passes = ["edge", {"angle_deg": 30}, "cross"]
    answer = command(outsider, "start", {"zones": [KITCHEN], "passes": passes})
    assert (answer["mission"]["pass_kind"], answer["mission"]["passes"]) == ("edge", 3)
    said = command(outsider, "start", {"passes": ["cross"]})
    assert said["code"] == "bad_order"
    assert "passes[0]: cross goes after a pass with lanes" in said["message"]
    assert command(outsider, "start", {"passes": 2})["mission"]["pass_kind"] is None
