"""One command to all robots of a fleet: each takes it, or its refusal is shown."""

from __future__ import annotations

import contextlib
import json

import pytest

from fasaco_edge.bus.session import BusSettings, open_bus
from fasaco_edge.cli import main
from tests.support.outsider import Outsider
from tests.support.processes import daemon_process, free_endpoint
from tests.support.rooms import map_bytes, pose_bytes, room

# The third is of another fleet; the second has no map yet.
ROBOTS = {"r1": "hall", "r2": "hall", "r3": "yard"}


@pytest.fixture(scope="module")
def router(tmp_path_factory):
    endpoint = free_endpoint()
    with contextlib.ExitStack() as stack:
        stack.enter_context(open_bus(BusSettings("router", (), (endpoint,))))
        for name, fleet in ROBOTS.items():
            stack.enter_context(
                daemon_process(
                    tmp_path_factory.mktemp(name),
                    bus={"mode": "client", "listen": [], "connect": [endpoint]},
                    robot={"name": name},
                    fleet={"name": fleet},
                )
            )
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
    assert "r3" not in told


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


def test_a_fleet_that_nobody_is_of(router, capsys):
    assert command(router, "pause", "--fleet", "garden") == 1
    error = capsys.readouterr().err
    assert "no robot of a fleet 'garden' answers" in error
    assert "3 robots answer, of these fleets: hall, yard" in error
