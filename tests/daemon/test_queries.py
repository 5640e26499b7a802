"""What can be asked of a running daemon, by a program that shares no code with it."""

from __future__ import annotations

import json
import time
from importlib import metadata
from typing import Any

import numpy as np
import pytest
import zenoh

from fasaco_edge import __version__
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.config.security import BusConfig
from fasaco_edge.daemon.loop.answers import LEFT_OUT, config_document
from fasaco_edge.wire.messages.pheromone import decode_pheromone
from fasaco_edge.wire.query_table import RPC_NAMES
from tests.daemon.test_mission import about, covers, planned
from tests.support.outsider import Outsider, joined_daemon
from tests.support.rooms import pillared_room, pose_bytes, show_room
from tests.support.waiting import until

ANTS = {"name": "fasaco", "ants": 24, "velocities": "8,4,1", "budget_s": 2.0}


def get(outsider: Outsider, name: str, payload: bytes | None = None) -> list[zenoh.Reply]:
    return list(outsider.session.get(f"{outsider.prefix}/{name}", payload=payload, timeout=60.0))


def error(outsider: Outsider, name: str, payload: bytes | None = None) -> dict[str, Any]:
    (reply,) = get(outsider, name, payload)
    assert reply.ok is None, reply.ok.payload.to_bytes()
    assert str(reply.err.encoding) == "application/json"
    document: dict[str, Any] = json.loads(reply.err.payload.to_bytes())
    assert document.keys() == {"code", "message", "hint"}
    assert all(document.values())
    return document


@pytest.fixture(scope="module")
def covering(tmp_path_factory):
    folder = tmp_path_factory.mktemp("covering")
    with joined_daemon(folder, planner=ANTS) as (_, outsider):
        for name in ("coverage", "pheromone"):
            assert error(outsider, f"@rpc/{name}")["code"] == "not_yet"
        assert error(outsider, "@rpc/replan")["code"] == "not_now"
        path = outsider.listen("path")
        show_room(outsider, pillared_room(), 0.75, 0.75)
        path.wait(lambda heard: covers(heard, pillared_room()))
        outsider.wait_status(lambda status: status["plan"]["plans"] == 1)
        yield outsider


def test_the_versions_are_answered(covering):
    answer = covering.ask("@rpc/version").json()
    assert answer == {
        "package": "fasaco-edge",
        "version": __version__,
        "protocol": "v1",
        "zenoh": metadata.version("eclipse-zenoh"),
    }


def test_the_configuration_is_the_one_in_force(covering):
    answer = covering.ask("@rpc/config").json()
    assert answer["planner"] | ANTS == answer["planner"]
    assert answer == covering.ask("@rpc/status").json()["config"]


def test_secrets_are_left_out():
    secret = "tls/10.0.0.1:7447#connect_private_key_base64=c2VjcmV0;verify_name_on_connect=true"
    plain = "tcp/127.0.0.1:7447?prio=1-7"
    config = DaemonConfig(bus=BusConfig(listen=(plain,), connect=(secret,)))
    document = config_document(config)
    assert document["bus"]["listen"] == [plain]
    assert document["bus"]["connect"] == [f"tls/10.0.0.1:7447#{LEFT_OUT}"]
    assert "c2VjcmV0" not in json.dumps(document)


@pytest.mark.parametrize("name", ["xyz", "paths", "Path", "pa$*x"])
def test_an_unknown_query_lists_the_known_ones(covering, name):
    answer = error(covering, f"@rpc/{name}")
    assert answer["code"] == "unknown_query"
    assert all(known in answer["message"] for known in RPC_NAMES)


def test_a_query_for_everything_changes_nothing(covering):
    before = covering.ask_status()["plan"]["plans"]
    replies = get(covering, "@rpc/*")
    answered = {str(reply.ok.key_expr).rpartition("/")[2] for reply in replies if reply.ok}
    assert answered == set(RPC_NAMES) - {"replan"}
    (refused,) = [json.loads(reply.err.payload.to_bytes()) for reply in replies if reply.err]
    assert (refused["code"], refused["message"][:6]) == ("bad_query", "replan")
    time.sleep(0.3)
    assert covering.ask_status()["plan"]["plans"] == before


@pytest.mark.parametrize("name", [*(f"@rpc/{name}" for name in RPC_NAMES), "path", "status"])
def test_a_parameter_that_is_not_known_is_an_error(covering, name):
    answer = error(covering, f"{name}?colour=red")
    assert answer["code"] == "bad_query"
    assert "takes no parameters, got 'colour'" in answer["message"]


@pytest.mark.parametrize("name", [name for name in RPC_NAMES if name != "mission"])
def test_a_payload_that_is_not_taken_is_an_error(covering, name):
    answer = error(covering, f"@rpc/{name}", b"{}")
    assert answer["code"] == "bad_query"
    assert answer["message"] == f"{name} takes no payload, got one of 2 bytes"


def test_the_living_trail_is_answered_without_subscribers(covering):
    def told() -> tuple[bytes, dict]:
        reply = covering.ask("@rpc/pheromone")
        return reply.payload, json.loads(reply.attachment)

    revision, deadline = covering.ask_status()["path"]["revision"], time.monotonic() + 10
    while told()[1]["revision"] != revision and time.monotonic() < deadline:
        time.sleep(0.05)
    payload, note = told()
    trail = decode_pheromone(payload)
    assert trail.ants > 0
    assert note["revision"] == revision
    assert note["cells"] == np.count_nonzero(trail.levels)
    assert 1.0 <= note["branching"] < 2.0
    assert covering.ask("pheromone").payload == payload


def test_a_full_plan_is_made_when_asked_for_but_not_all_the_time(covering):
    path, commands = covering.listen("path"), covering.listen("command", late=False)
    before = covering.ask_status()["plan"]["plans"]
    answer = covering.ask("@rpc/replan").json()
    assert answer == {"robot": "robot", "accepted": True, "plan": before + 1}
    again = error(covering, "@rpc/replan")
    assert again["code"] == "not_now"
    assert again["hint"].startswith("ask again in 0.") or again["hint"].startswith(
        "ask again in 1."
    )
    assert commands.wait(lambda heard: True).json() == {"command": "replan"}
    covering.wait_status(lambda status: status["plan"]["plans"] == before + 1)
    # The same problem and the same seed lead to the same path: nobody need hear of it again.
    assert len(path.heard) == len(commands.heard) == 1


def test_a_requested_path_has_that_reason(tmp_path):
    with joined_daemon(tmp_path, planner={"budget_s": 0.05}) as (_, outsider):
        path = outsider.listen("path")
        show_room(outsider, pillared_room(), 0.75, 0.75)
        path.wait(lambda heard: True)
        # Elsewhere the walk has another beginning.
        outsider.put("pose", pose_bytes(0.75, 1.05))
        outsider.wait_status(lambda status: (status["pose"] or {}).get("y") == 1.05)
        answer = outsider.ask("@rpc/replan").json()
        heard = path.wait(lambda heard: about(heard)["reason"] == "asked for")
        assert planned(heard)[0][0].tolist() == pytest.approx([0.75, 1.05])
        outsider.wait_status(lambda status: status["plan"]["plans"] >= answer["plan"])
        # The trail is kept twice a second at most.
        assert until(lambda: decode_pheromone(outsider.ask("@rpc/pheromone").payload).best_steps)
