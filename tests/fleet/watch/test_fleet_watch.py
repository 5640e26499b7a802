"""The command itself for a fleet: real buses, real daemons, a real terminal."""

from __future__ import annotations

import contextlib
import json
import signal
import time
from collections.abc import Iterator
from typing import Any

import pytest

from fasaco_edge.bus.session import Bus, open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.host.processes import own_mb
from fasaco_edge.wire import topics
from fasaco_edge.wire.keys import Keys
from tests.fleet.told import Teller
from tests.fleet.watch.fleets import AHEAD, PARTS
from tests.support.outsider import Outsider
from tests.support.processes import daemon_process, fasaco_edge, free_endpoint, mapped_files
from tests.support.rooms import map_bytes, pose_bytes, room
from tests.support.waiting import meanwhile
from tests.watch.terminal import Terminal, piped
from tests.watch.test_watch import WATCH_MB

EVERY_S = 0.3
HALL = room(9.0, 6.0)


class Hall:
    def __init__(self, bus: Bus, *names: str, **members: Any) -> None:
        self.tellers = {name: Teller(bus, name) for name in names}
        ours = {"division": 7, "by": "b", "parts": PARTS, **members}
        self.said: dict[str, dict[str, Any]] = {name: dict(ours) for name in names}
        self.said["a"] |= {"cells": [(2, col) for col in range(4)], "ahead": AHEAD}
        self.silent: set[str] = set()

    def published(self) -> contextlib.AbstractContextManager[None]:
        return meanwhile(self._publish, EVERY_S)

    def _publish(self) -> None:
        for name, teller in self.tellers.items():
            if name not in self.silent:
                teller.tell(**self.said[name])


@pytest.fixture(scope="module")
def hall() -> Iterator[tuple[Hall, str]]:
    endpoint = free_endpoint()
    with (
        open_bus(BusSettings("router", (), (endpoint,))) as bus,
        open_bus(BusSettings(connect=(endpoint,))) as told,
    ):
        bus.token(Keys("a").of(topics.ALIVE))
        robots = Hall(told, "a", "b")
        with robots.published():
            stranger = Teller(told, "stranger")
            robots.tellers["stranger"] = stranger
            robots.said["stranger"] = {"fleet": "yard"}
            yield robots, endpoint


def test_it_shows_all_robots(hall):
    robots, endpoint = hall
    words = ("--fleet", "house", "--connect", endpoint)
    with Terminal(*words, columns=100, lines=30, executed=True) as terminal:
        screen = terminal.wait(lambda seen: "2 of 2 robots at work" in seen and "% swept" in seen)
        assert "a joined: covering" in screen
        assert "stranger" not in screen
        resident = own_mb(terminal.process.pid)
        print(f"watch --fleet: {resident:.1f} MB")
        assert resident < WATCH_MB
        mapped = mapped_files(terminal.process.pid)
        heavy = ("numba", "llvmlite", "rerun", "pyarrow", "PIL")
        assert [name for name in heavy if name in mapped] == []
        robots.said["b"] |= {"waits_for": "a", "cells": [(17, 28)]}
        terminal.wait_text("b     waits for a")
        robots.tellers["a"].send("fleet", b"\xff")
        robots.tellers["a"].send("status", b"[]")
        robots.silent.add("b")
        terminal.wait_text("b is gone")
        robots.silent.clear()
        terminal.wait_text("b is back: waits for a")
        terminal.quit()
        assert "Traceback" not in terminal.written


def test_once_is_one_page(hall):
    _, endpoint = hall
    ended = fasaco_edge("watch", "--fleet", "house", "--once", "--connect", endpoint)
    assert ended.code == 0
    assert "2 of 2 robots at work" in ended.out
    assert "\x1b" not in ended.out
    ended = fasaco_edge("watch", "--fleet", "house", "--once", "--json", "--connect", endpoint)
    document = json.loads(ended.out)
    assert [robot["name"] for robot in document["robots"]] == ["a", "b"]
    assert document["cells"] == 600
    assert document["division"] == 7


def test_lines_and_json_where_there_is_no_terminal(hall):
    robots, endpoint = hall
    with piped("--fleet", "house", "--connect", endpoint) as process:
        said = [process.stdout.readline()]
        while "of cells  a: covering, b: " not in said[-1]:
            said.append(process.stdout.readline())
            assert said[-1]
        process.send_signal(signal.SIGTERM)
        assert process.wait(60.0) == 0
    assert any("a joined: covering" in line for line in said), said
    assert not any("\x1b" in line for line in said)
    with piped("--fleet", "house", "--json", "--connect", endpoint) as process:
        documents = [json.loads(process.stdout.readline())]
        # The first may hold all there is to say, and what has not changed is not printed again.
        robots.said["b"] |= {"state": "planning"}
        documents.append(json.loads(process.stdout.readline()))
        robots.said["b"] |= {"state": "covering"}
        process.send_signal(signal.SIGINT)
        assert process.wait(60.0) == 0
    assert documents[0] != documents[1]
    assert documents[1]["fleet"] == "house"


def test_once_without_a_robot_of_the_fleet_names_the_fleets(hall):
    _, endpoint = hall
    words = ("watch", "--once", "--timeout", "1", "--fleet")
    ended = fasaco_edge(*words, "hose", "--connect", endpoint)
    assert ended.code == 1
    assert "no robot of a fleet 'hose' answers" in ended.err
    assert "of these fleets: house, yard" in ended.err
    assert ended.out == ""
    nowhere = free_endpoint()
    ended = fasaco_edge(*words, "house", "--connect", nowhere)
    assert ended.code == 1
    assert nowhere in ended.err


def test_it_outlives_the_router():
    endpoint = free_endpoint()
    with Terminal("--fleet", "house", "--connect", endpoint) as terminal:
        terminal.wait_text(f"waiting for the bus at {endpoint}")
        for state in ("covering", "planning"):
            router = BusSettings("router", (), (endpoint,))
            with open_bus(router) as bus, Hall(bus, "a", "b", state=state).published():
                terminal.wait_text("2 of 2 robots at work")
                terminal.wait_text(f"b     {state}")
        terminal.quit()


def test_daemons_of_a_fleet_are_shown(tmp_path):
    """What real ones tell."""
    endpoint = free_endpoint()
    starts = {"r1": (0.75, 0.75), "r2": (8.25, 5.25)}
    with contextlib.ExitStack() as stack:
        stack.enter_context(open_bus(BusSettings("router", (), (endpoint,))))
        for name, at in starts.items():
            (tmp_path / name).mkdir()
            bus = {"mode": "client", "listen": [], "connect": [endpoint]}
            stack.enter_context(
                daemon_process(
                    tmp_path / name, bus=bus, robot={"name": name}, fleet={"name": "house"}
                )
            )
            seat = stack.enter_context(Outsider(endpoint, name))
            seat.put("map", map_bytes(HALL))
            seat.put("pose", pose_bytes(*at))
            seat.wait_status(lambda status: status["state"] == "covering")
        words = ("watch", "--fleet", "house", "--once", "--json", "--connect", endpoint)
        deadline = time.monotonic() + 60.0
        while True:
            document = json.loads(fasaco_edge(*words).out)
            if document["division"] and document["robots"][0]["part_cells"]:
                break
            assert time.monotonic() < deadline, document
    assert [robot["state"] for robot in document["robots"]] == ["covering"] * 2
    assert [(robot["x"], robot["y"]) for robot in document["robots"]] == list(starts.values())
    assert all(robot["path"] for robot in document["robots"])
    parts = [robot["part_cells"] for robot in document["robots"]]
    assert sum(parts) == document["cells"] - document["swept_cells"]
    assert abs(parts[0] - parts[1]) < 0.2 * document["cells"]
