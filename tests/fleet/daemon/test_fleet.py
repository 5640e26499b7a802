"""Robots on one router: each hears its own maps alone, whatever the others are called."""

from __future__ import annotations

import contextlib
import time

import pytest

from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings
from tests.daemon.test_security import SILENCE_S
from tests.support.outsider import Outsider, open_client
from tests.support.processes import daemon_process, free_endpoint
from tests.support.rooms import map_bytes, pillared_room, pose_bytes, room

# One name begins with the other, and one is a word of the contract.
FLEET = ("r1", "r10", "map")


@pytest.fixture(scope="module")
def router():
    endpoint = free_endpoint()
    with open_bus(BusSettings("router", (), (endpoint,))):
        yield endpoint


@pytest.fixture(scope="module")
def fleet(router, tmp_path_factory):
    with contextlib.ExitStack() as stack:
        for name in FLEET:
            bus = {"mode": "client", "listen": [], "connect": [router]}
            folder = tmp_path_factory.mktemp(name)
            stack.enter_context(daemon_process(folder, bus=bus, robot={"name": name}))
        yield


@pytest.fixture
def seats(router, fleet):
    with contextlib.ExitStack() as stack:
        yield {name: stack.enter_context(Outsider(router, name)) for name in FLEET}


def test_no_robot_receives_the_map_of_another(seats):
    for rows, name in enumerate(FLEET, start=3):
        seats[name].put("map", map_bytes(room(3.0, float(rows))))
        seats[name].put("pose", pose_bytes(0.75, 0.75))
        seats[name].wait_status(lambda status: status["map"] is not None)
        time.sleep(SILENCE_S)
        heard = {other: seats[other].ask_status()["map"] for other in FLEET}
        assert [other for other in FLEET if heard[other]] == list(FLEET[: rows - 2])
        assert heard[name]["rows"] == 20 * rows
        assert heard[name]["revision"] == 1


@pytest.mark.parametrize("key", ["fasaco/@v1/*/map", "fasaco/@v1/r$*/map"])
def test_a_map_on_a_key_expression_reaches_matching_robots(router, seats, key):
    """Zenoh lets a key expression be published on; only access control forbids it."""
    before = {name: (seats[name].ask_status()["map"] or {"revision": 0}) for name in FLEET}
    session = open_client(router)
    session.put(key, map_bytes(pillared_room()))
    matched = [name for name in FLEET if "$*" not in key or name.startswith("r")]
    for name in matched:
        seats[name].wait_status(
            lambda status, old=before[name]: (status["map"] or {"revision": 0}) != old
        )
        assert seats[name].ask_status()["errors"]["total"] == 0
    session.close()
