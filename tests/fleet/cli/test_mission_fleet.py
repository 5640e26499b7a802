"""One command to all robots of a fleet: each takes it, or its refusal is shown."""

from __future__ import annotations

import contextlib
import json
import signal

import pytest

from fasaco_edge.bus.session import BusSettings, open_bus
from fasaco_edge.cli import main
from tests.support.outsider import Outsider, open_client
from tests.support.processes import daemon_process, free_endpoint
from tests.support.rooms import map_bytes, pose_bytes, room

# The third is of another fleet; the second has no map yet.
ROBOTS = {"r1": "hall", "r2": "hall", "r3": "yard"}


@pytest.fixture(scope="module")
def endpoint():
    endpoint = free_endpoint()
    with open_bus(BusSettings("router", (), (endpoint,))):
        yield endpoint


@pytest.fixture(scope="module")
def daemons(endpoint, tmp_path_factory):
    with contextlib.ExitStack() as stack:
        yield {
            name: stack.enter_context(
                daemon_process(
                    tmp_path_factory.mktemp(name),
                    bus={"mode": "client", "listen": [], "connect": [endpoint]},
                    robot={"name": name},
                    fleet={"name": fleet},
                )
            )
            for name, fleet in ROBOTS.items()
        }


@pytest.fixture(scope="module")
def router(endpoint, daemons):
    with contextlib.ExitStack() as stack:
        seats = {name: stack.enter_context(Outsider(endpoint, name)) for name in ROBOTS}
        seats["r1"].put("map", map_bytes(room(3.0, 3.0)))
        seats["r1"].put("pose", pose_bytes(0.75, 0.75))
        seats["r1"].wait_status(lambda status: status["state"] == "covering")
        for name in ("r2", "r3"):
            seats[name].wait_status(lambda status: status["state"] != "covering")
        yield endpoint


def command(router, *words):
    return main(["mission", *words, "--connect", router])


def test_each_robot_of_the_fleet_takes_it(router, capsys):
    assert command(router, "pause", "--fleet", "hall", "--json") == 0
    answers = json.loads(capsys.readouterr().out)
    assert {robot: answer["robot"] for robot, answer in answers.items()} == {"r1": "r1", "r2": "r2"}
    assert answers["r1"]["state"] == "paused"
    assert command(router, "resume", "--fleet", "hall") == 0
    told = capsys.readouterr().out
    assert "Fleet hall" in told
    assert "covering" in told
    assert told.count("accepted: path ") >= 1
    assert "r3" not in told
    assert command(router, "status", "--fleet", "hall") == 0
    assert "accepted" not in capsys.readouterr().out


def test_a_refusal_is_shown_for_each(router, capsys):
    zone = ("--zone", "a zone that no configuration has")
    assert command(router, "start", "--fleet", "hall", *zone, "--json") == 1
    answers = json.loads(capsys.readouterr().out)
    assert {robot: answer["code"] for robot, answer in answers.items()} == {
        "r1": "bad_order",
        "r2": "bad_order",
    }
    assert command(router, "start", "--fleet", "hall", *zone) == 1
    assert capsys.readouterr().out.count("refused: ") == 2


def test_an_unknown_fleet_is_an_error_that_lists_fleets(router, capsys):
    assert command(router, "pause", "--fleet", "garden") == 1
    error = capsys.readouterr().err
    assert "no robot of a fleet 'garden' answers" in error
    assert "robots that answer: 3, of these fleets: hall, yard" in error


def test_an_invalid_status_does_not_block_a_fleet(router, capsys):
    stranger = open_client(router)
    noise = {"a junk": b"\xff\xfe", "a list": b"[1]", "long": b'"' + b"a" * 2**21 + b'"'}
    for number, payload in enumerate(noise.values()):
        key = f"fasaco/@v1/noise{number}/@rpc/status"
        stranger.declare_queryable(key, answering(key, payload))
    # This one says that it is of the fleet, and answers the command with nothing to be read.
    liar = {"robot": "liar", "fleet": {"name": "hall"}}
    for name, payload in (("status", json.dumps(liar).encode()), ("mission", b"\xff\xfe")):
        key = f"fasaco/@v1/liar/@rpc/{name}"
        stranger.declare_queryable(key, answering(key, payload))
    try:
        assert command(router, "pause", "--fleet", "hall", "--json") == 1
        answers = json.loads(capsys.readouterr().out)
        assert {robot: answer and answer["state"] for robot, answer in answers.items()} == {
            "liar": None,
            "r1": "paused",
            "r2": "paused",
        }
        assert command(router, "resume", "--fleet", "hall") == 1
        assert "its answer cannot be read" in " ".join(capsys.readouterr().out.split())
    finally:
        stranger.close()


def answering(key, payload):
    return lambda query: query.reply(key, payload)


def test_robots_that_would_forget_are_named_and_need_consent(router, capsys):
    def words(*more):
        return "start", "--passes", "2", "--fleet", "hall", *more

    with Outsider(router, "r1") as first:
        for step in range(1, 4):
            first.put("pose", pose_bytes(0.75 + 0.3 * step, 0.75))
        first.wait_status(lambda status: status["coverage"]["covered"] >= 4)
        assert command(router, *words()) == 1
        shown = " ".join(capsys.readouterr().out.split())
        assert "start forgets 3 covered cells" in shown
        assert "--yes" in shown
        assert first.ask_status()["coverage"]["covered"] >= 4
        assert command(router, *words("--yes")) == 0
        first.wait_status(lambda status: status["coverage"]["covered"] == 1)
    area = "keep-out", "add", "--name", "vase", "1.5,1.5;2,1.5;2,2", "--fleet", "hall"
    assert command(router, *area) == 0
    capsys.readouterr()
    assert command(router, "keep-out", "list", "--fleet", "hall") == 0
    assert capsys.readouterr().out.count("vase") == 2
    assert command(router, "keep-out", "remove", "vase", "--fleet", "hall") == 0
    capsys.readouterr()


def test_a_frozen_robot_is_reported_and_blocks_no_other(router, daemons, capsys):
    with Outsider(router, "r2") as second, Outsider(router, "r1") as first:
        second.put("map", map_bytes(room(3.0, 3.0)))
        second.put("pose", pose_bytes(0.75, 0.75))
        first.wait_status(lambda status: bool(status["fleet"]["members"]))
    daemons["r2"].process.send_signal(signal.SIGSTOP)
    try:
        assert command(router, "pause", "--robot", "r2", "--timeout", "1") == 1
        assert "is on the bus, but has not answered in time" in capsys.readouterr().err
        assert command(router, "pause", "--fleet", "hall", "--json", "--timeout", "2") == 1
        answers = json.loads(capsys.readouterr().out)
        assert answers["r1"]["state"] == "paused"
        assert answers["r2"] is None
        assert command(router, "resume", "--fleet", "hall", "--timeout", "2") == 1
        assert "no answer" in capsys.readouterr().out
    finally:
        daemons["r2"].process.send_signal(signal.SIGCONT)
