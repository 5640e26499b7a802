"""Questions to a running daemon from the command line."""

from __future__ import annotations

import json

import pytest

from fasaco_edge.bus.queries import QueryReply
from fasaco_edge.cli import main
from fasaco_edge.cli.ask import show, show_rooms
from fasaco_edge.wire.documents.json_text import encode_json
from fasaco_edge.wire.documents.replies import TroubleReport
from fasaco_edge.wire.documents.rooms import RoomReport, Rooms
from fasaco_edge.wire.documents.status import Status
from fasaco_edge.wire.query_table import RPC_NAMES
from tests.support.outsider import Outsider
from tests.support.processes import daemon_process
from tests.support.rooms import room, show_room

SAID = {
    "path": "poses ",
    "status": "covering",
    "coverage": "to_cover",
    "pheromone": "best_steps",
    "rooms": "room",
    "config": "tool_width_m: 0.3",
    "version": "protocol: v1",
    "mission": "begun by itself",
    "replan": "accepted: true",
}


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory):
    with daemon_process(tmp_path_factory.mktemp("ask")) as running:
        with Outsider(running.endpoint) as outsider:
            show_room(outsider, room(3.0, 3.0), 0.75, 0.75)
            outsider.wait_status(lambda status: status["state"] == "covering")
            outsider.wait_status(lambda status: status["plan"]["plans"] == 1)
        yield running.endpoint


@pytest.mark.parametrize("name", RPC_NAMES)
def test_every_question_has_an_answer_people_can_read(endpoint, capsys, name):
    assert main(["ask", name, "--connect", endpoint]) == 0
    told = capsys.readouterr()
    assert SAID[name] in told.out
    assert "None" not in told.out
    assert told.err == ""


def test_a_program_gets_json(endpoint, capsys):
    def told(*words):
        assert main(["ask", *words, "--json", "--connect", endpoint]) == 0
        return json.loads(capsys.readouterr().out)

    path, version = told("path"), told("version")
    trail = told("pheromone")
    assert path["poses"] == path["steps"] + 1
    assert path["length_m"] == pytest.approx(0.3 * path["steps"])
    assert trail["rows"] * trail["cols"] == 100
    assert version["package"] == "fasaco-edge"


def test_no_room_is_swept_whole_before_it_is(capsys):
    show_rooms(Rooms("map", 1, (RoomReport(1, swept=0.9996), RoomReport(2, swept=1.0))))
    told = capsys.readouterr().out
    assert "99.9 %" in told
    assert "100.0 %" in told


def test_a_wrong_query_is_an_error_with_its_cause(endpoint, capsys):
    words = ("replan", "--json")
    assert main(["ask", *words, "--connect", endpoint]) == 1
    told = capsys.readouterr()
    assert json.loads(told.out)["code"] == "not_now"
    assert "planned anew" in told.err
    assert main(["ask", "status", "--robot", "other", "--connect", endpoint]) == 1
    assert "robots on this bus: robot; choose one by --robot" in capsys.readouterr().err
    for words in (("ask", "colour"), ("ask", "path", "colour"), ("ask",)):
        with pytest.raises(SystemExit, match="2"):
            main([*words])


def test_troubles_are_shown_with_what_to_do(capsys):
    trouble = TroubleReport(
        code="no_effect", text="no ground beside keep-out far", do="move it", since_s=7.0
    )
    show(
        "status", QueryReply(encode_json(Status(robot="r1", state="covering", troubles=(trouble,))))
    )
    shown = " ".join(capsys.readouterr().out.split())
    assert "no ground beside keep-out far" in shown
    assert "move it" in shown


@pytest.mark.parametrize(("reason", "shown"), [("path 7", False), ("paused by command", True)])
def test_a_reason_is_shown_unless_it_is_the_number_of_a_path(capsys, reason, shown):
    show("status", QueryReply(encode_json(Status(robot="r1", state="covering", reason=reason))))
    assert ("reason" in capsys.readouterr().out) == shown
